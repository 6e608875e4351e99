"""A step along a path of equilibria: prediction from the last two points, correction by a solver, acceptance.

Load steps and arc-length steps differ in the parameter p of the path, the value of a control or its arc length, and in
the size of steps. Both predict with the tangents y′ = dy/dp at the last two points; h is the distance of the guess
from the last, w that between the two:

    constant   y₀
    tangent    y₀ + h y₀′
    parabola   y₀ + h y₀′ + ½ h² (y₀′ − y₋₁′) / w
    cubic      y₀ + t² (3 + 2 t) (y₋₁ − y₀) + w t² (1 + t) y₋₁′ + w t (1 + t)² y₀′,     t = h / w
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import ArcMetric, EquilibriumPoint, EquilibriumSolver, EquilibriumSystem, State, Step
from fenicsmech.errors import set_options


class Predictor(ABC):
    """Extrapolates a path."""

    @abstractmethod
    def predict(
        self, system: EquilibriumSystem, points: Sequence[EquilibriumPoint], width: float, ahead: float
    ) -> State:
        """The guess ``ahead`` of the last of ``points``, of which there are one or two, ``width`` apart."""


class ConstantPredictor(Predictor):
    """The last equilibrium again."""

    def predict(self, system, points, width, ahead):
        return points[-1].state


class TangentPredictor(Predictor):
    """Along the tangent."""

    def predict(self, system, points, width, ahead):
        return system.moved(points[-1].state, points[-1].tangent.scaled(ahead))


@dataclass(frozen=True)
class HermitePredictor(Predictor):
    """The cubic through the last two equilibria and their tangents.

    The tangent replaces it while there is only one, and where the two lie close together compared with the step.

    Attributes:
        extrapolation: longest one, over the distance between the two equilibria: the error grows as t⁴.

    Raises:
        DescriptionError: it is not a positive number.
    """

    extrapolation: float = 4.0

    def __post_init__(self) -> None:
        set_options(self, "predictions")

    def predict(self, system, points, width, ahead):
        if len(points) == 1 or abs(ahead) > self.extrapolation * abs(width):
            return TangentPredictor().predict(system, points, width, ahead)
        before, last = points
        return on_cubic(system, (last.state, before.state), (last.tangent, before.tangent), -width, -ahead / width)


@dataclass(frozen=True)
class ParabolaPredictor(Predictor):
    """Along the tangent and the curvature, unless that turns by more than ``turn`` rad over the step."""

    metric: ArcMetric
    turn: float

    def predict(self, system, points, width, ahead):
        step = points[-1].tangent.scaled(ahead)
        if len(points) == 2 and width > 0.0:
            change = points[1].tangent + points[0].tangent.scaled(-1.0)
            if ahead * self.metric.norm(change) <= 2.0 * self.turn * width:
                step = step + change.scaled(0.5 * ahead**2 / width)
        return system.moved(points[-1].state, step)


def on_cubic(
    system: EquilibriumSystem, ends: tuple[State, State], rates: tuple[Step, Step], width: float, t: float
) -> State:
    """The cubic from y₀ to y₁, y₀ + t² (3 − 2 t) (y₁ − y₀) + w t (1 − t)² y₀′ − w t² (1 − t) y₁′, w the ``width``."""
    step = (
        system.difference(ends[1], ends[0]).scaled(t * t * (3.0 - 2.0 * t))
        + rates[1].scaled(-width * t * t * (1.0 - t))
        + rates[0].scaled(width * t * (1.0 - t) ** 2)
    )
    return system.moved(ends[0], step)


class Stepper:
    """The last two points of a path, from which the next is predicted.

    Args:
        solver: for the equilibria.
        predictor: of the next one.
        start: near the first of them.
    """

    def __init__(self, solver: EquilibriumSolver, predictor: Predictor, start: State) -> None:
        self.solver, self.system, self.predictor, self._start = solver, solver.system, predictor, start
        self._points: list[EquilibriumPoint] = []
        self._width = 0.0  # by which the two are apart

    def _predict(self, ahead: float) -> State:
        """The guess ``ahead`` of the last point."""
        return self.predictor.predict(self.system, self._points, self._width, ahead)

    def _others_touch(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Whether other points touch obstacles in ``b`` than in ``a``, as in ``EquilibriumPoint.touching``."""
        system = self.system
        return system.contact is not None and system.comm.allreduce(int(np.any(a != b))) > 0

    def _accept(self, point: EquilibriumPoint, width: float) -> None:
        """Keeps ``point``, ``width`` ahead of the last one, and that one unless they are in the same place.

        Raises:
            EquilibriumError: a potential does not hold for the step.
        """
        before = self._points[-1].state if self._points else self._start
        for potential in self.system.potentials:
            potential.check_step(before.poses, point.state.poses)
        self._points, self._width = [*(self._points[-1:] if width else []), point], width
