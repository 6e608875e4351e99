"""Arc-length continuation: steps along a path, as long as its curvature allows.

Sources: Riks (doi:10.1016/0020-7683(79)90081-7), Crisfield (doi:10.1016/0045-7949(81)90108-5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fenicsmech.checks import positive
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.solver import NotConverged
from fenicsmech.equilibrium.state import State
from fenicsmech.errors import DescriptionError
from fenicsmech.log import logger

_log = logger(__name__)
_TURN = 0.25  # rad between the tangents at both ends of a step that is as long as it should be
_LARGEST_TURN = 0.9  # rad; more is a jump to another branch, or a bend that was cut off
_ITERATIONS = 5  # of a step as long as it should be; the last one only judges the stability


@dataclass(frozen=True)
class ArcSteps:
    """How finely a path is followed.

    Attributes:
        first: length of the first step; 1 is as far as ``until`` would be if the mechanism were linear.
        largest: the longest step, likewise, in force and in the displacement of its point.
        smallest: the shortest step, likewise; where even that fails the path ends with an error.
        motion: how far a step may move anything, in lengths of the mechanism or rad.
        tolerance: how closely limit points and bifurcations are located, as a part of the step they lie in.

    Raises:
        DescriptionError: a length is not positive, or the tolerance not between 0 and 1.
    """

    first: float = 0.02
    largest: float = 0.05
    smallest: float = 1e-6
    motion: float = 0.1
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("first", "largest", "smallest", "motion", "tolerance"):
            positive(f"{name} of arc-length steps", getattr(self, name))
        if not self.tolerance < 1.0:
            raise DescriptionError(
                "tolerance of arc-length steps", f"{self.tolerance:g} is not below 1", "Give a part of a step, as 1e-4"
            )


class ArcLength:
    """Steps along one path (all methods are collective).

    Args:
        points: its equilibria.
        steps: how fine the steps are.
        conjugate_reference: change of the parameter's conjugate that is of interest; infinite if none is.

    Attributes:
        length: of the next step, to begin with.
    """

    def __init__(self, points: PathPoints, *, steps: ArcSteps, conjugate_reference: float) -> None:
        self.points, self.steps, self._conjugate_reference = points, steps, conjugate_reference
        self.length = steps.first
        self._before: PathPoint | None = None

    def advance(self, point: PathPoint) -> PathPoint:
        """The next point of the path, as far ahead as its curvature allows.

        Raises:
            NotConverged: not even the shortest step succeeded.
        """
        tangent = point.tangent
        longest = self._longest(point)
        self.length = min(self.length, longest)
        while True:
            reason = "the path bends too sharply, or another one is too near"
            try:
                guess = self._guess(point)
                if not math.isfinite(self.points.system.elastic_energy()):
                    raise NotConverged("elements are inverted in the predicted state", 0)
                found = self.points.correct(guess, tangent, point)
                turn = self._turn(point, found)
                _log.debug("arc %.2e: turn %.2f, %d iterations", self.length, turn, found.iterations)
                if turn <= _LARGEST_TURN:
                    ease = min(_TURN / max(turn, 1e-12), math.sqrt(_ITERATIONS / found.iterations))
                    self.length *= min(max(ease, 0.5), 2.0)
                    self._before = point
                    return found
            except NotConverged as failure:
                reason = str(failure)
            self.length *= 0.5
            if self.length < self.steps.smallest * min(longest / self.steps.largest, 1.0):
                raise NotConverged(reason, 0)

    def _guess(self, point: PathPoint) -> State:
        """Along the tangent, and along the curvature if the last two tangents tell it.

        y = y₁ + h y₁′ + ½ h² (y₁′ − y₀′) / |y₁ − y₀|
        """
        ahead, before = point.tangent.scaled(self.length), self._before
        if before is not None:
            width = self.points.metric.norm(self.points.difference(point.state, before.state))
            bend = point.tangent + before.tangent.scaled(-1.0)
            if width > 0.0 and self.length * self.points.metric.norm(bend) <= 2.0 * _TURN * width:
                ahead = ahead + bend.scaled(0.5 * self.length**2 / width)
        return self.points.lead.moved(self.points.system, point.state, ahead)

    def _longest(self, point: PathPoint) -> float:
        """The arc that changes neither parameter nor conjugate nor anything's place too much."""
        steps, tangent = self.steps, point.tangent
        rates = (
            abs(tangent.parameter) / (steps.largest * self.points.metric.parameter),
            abs(point.conjugate) / (steps.largest * self._conjugate_reference),
            self.points.system.size(tangent.step) / steps.motion,
        )
        return 1.0 / max(rates)

    def _turn(self, a: PathPoint, b: PathPoint) -> float:
        """Largest angle between the tangents at both points and the chord."""
        chord = self.points.metric.unit(self.points.difference(b.state, a.state))
        cosines = (
            self.points.metric.dot(a.tangent, b.tangent),
            self.points.metric.dot(a.tangent, chord),
            self.points.metric.dot(chord, b.tangent),
        )
        return math.acos(min(max(min(cosines), -1.0), 1.0))
