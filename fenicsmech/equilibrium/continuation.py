"""A path from an equilibrium until it passes given values, with its critical points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from fenicsmech.equilibrium.arc_length import ArcLength
from fenicsmech.equilibrium.critical import CriticalPoint, locate
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.solver import NotConverged
from fenicsmech.log import logger

_log = logger(__name__)
_ROOT = 1e-10  # how closely a path ends where it is asked to, in units of its references,
_WITHIN = 1e-8  # and of the change over the step it ends in
_MISSED = 1e-6  # likewise: ends farther off than that are told


@dataclass(frozen=True)
class Finish:
    """A value of some quantity at which a path ends.

    Attributes:
        value: of the quantity at a point (collective).
        rate: of the quantity along the path at a point.
        target: where the path ends.
        scale: of the quantity.
    """

    value: Callable[[PathPoint], float]
    rate: Callable[[PathPoint], float]
    target: float
    scale: float

    def passed(self, before: PathPoint, after: PathPoint) -> bool:
        """Whether the target lies between two neighbouring points (collective)."""
        a, b = self.value(before) - self.target, self.value(after) - self.target
        return a * b < 0.0 or (b == 0.0 and a != 0.0)


@dataclass(frozen=True)
class Stretch:
    """A step of a path: its end, the critical points on the way there, and whether the path ends with it."""

    point: PathPoint
    critical: tuple[CriticalPoint, ...]
    last: bool


def follow(arc: ArcLength, start: PathPoint, finishes: Sequence[Finish], *, most: int) -> Iterator[Stretch]:
    """Steps along the path from ``start`` until a finish is passed, or ``most`` of them (collective).

    Raises:
        NotConverged: the path cannot be followed further.
    """
    points, point = arc.points, start
    for _ in range(most):
        following = arc.advance(point)
        ends = [_end(points, point, following, finish) for finish in finishes if finish.passed(point, following)]
        if ends:
            following = min(ends, key=lambda end: points.along(point, end))
        yield Stretch(following, tuple(locate(points, point, following, tolerance=arc.steps.tolerance)), bool(ends))
        if ends:
            return
        point = following


def _end(points: PathPoints, before: PathPoint, after: PathPoint, finish: Finish) -> PathPoint:
    """Where the path has the finish's value, by Newton's method within the step; as near as can be got to it."""
    width = points.along(before, after)
    low, high = 0.0, width
    change = finish.value(after) - finish.value(before)
    near, rising = min(_ROOT * finish.scale, _WITHIN * abs(change)), change > 0.0
    distance, best = width, after
    for _ in range(30):
        gap = finish.value(best) - finish.target
        if abs(gap) <= near:
            break
        low, high = (low, distance) if (gap > 0.0) == rising else (distance, high)
        slope = finish.rate(best) / points.metric.dot(before.tangent, best.tangent)
        wanted = distance - gap / slope if slope else low
        distance = wanted if low < wanted < high else 0.5 * (low + high)
        try:
            best = points.between(before, after, distance)
        except NotConverged:
            break
    reached = finish.value(best)
    if abs(reached - finish.target) > _MISSED * abs(change):
        _log.warning("the path ends at %g, not at %g: no equilibrium was found there", reached, finish.target)
    return best
