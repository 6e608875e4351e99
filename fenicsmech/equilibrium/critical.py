"""Limit points, turning points and bifurcations of a path: noticed between two equilibria, and located.

What a step across each of them changes, with n unstable modes, the parameter's rate ṗ and the displacement's ḋ:

    limit point     ṗ changes sign, n by one        the load has an extremum: a dead load snaps from here
    turning point   ḋ changes sign                  so has the displacement: a held point snaps from here
    bifurcation     n changes otherwise             other paths cross this one

Intervals are halved, at the root of a line through the rates where these change sign, until what changes is known
closely enough and single.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fenicsmech.equilibrium.lead import Heading
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.solver import NotConverged
from fenicsmech.log import logger

_log = logger(__name__)
_ELSEWHERE = (
    0.5,
    0.35,
    0.65,
    0.2,
    0.8,
    0.1,
    0.9,
)  # of an interval: where to look if there is no equilibrium to be found
_STRAYED = 1.0  # of the way along a step: how far off it a point is none of the path any more
_NO_RATE = 1e-9  # of the references: less is rounding


class Critical(Enum):
    """What a critical point of a path is."""

    LIMIT = "limit point"
    TURNING = "turning point"
    BIFURCATION = "bifurcation"


@dataclass(frozen=True)
class CriticalPoint:
    """A critical point of a path.

    Attributes:
        kind: what it is.
        point: the equilibrium.
        modes: by how many the unstable modes change there.
        course: the direction of the path over the step in which it lies. The tangent in the point itself is no measure
            of it: rounding and the asymmetry of meshes let it lean towards the paths that cross.
    """

    kind: Critical
    point: PathPoint
    modes: int
    course: Heading


def locate(points: PathPoints, before: PathPoint, after: PathPoint, *, tolerance: float) -> list[CriticalPoint]:
    """All critical points between two neighbouring points of a path, in its order (collective).

    Args:
        points: the path.
        before, after: two of its points.
        tolerance: how closely they are located, as a part of the distance between the two.
    """
    if not _changes(points, before, after):
        return []
    width = points.along(before, after)
    course = points.metric.unit(points.difference(after.state, before.state))
    piece = _Piece(points, before, after, course)
    return _search(piece, (0.0, before), (width, after), tolerance * width)


@dataclass(frozen=True)
class _Piece:
    """A step of the path."""

    points: PathPoints
    before: PathPoint
    after: PathPoint
    course: Heading

    def at(self, distance: float) -> PathPoint:
        """The equilibrium on the way, unless it strays off it.

        Meshes without a column's symmetry turn its bifurcation into two paths that pass each other closely; what turns
        off from one to the other there is none of this path's points.
        """
        point = self.points.between(self.before, self.after, distance)
        metric, chord = self.points.metric, self.points.difference(point.state, self.before.state)
        off = chord + self.course.scaled(-metric.dot(chord, self.course))
        if metric.norm(off) > _STRAYED * metric.dot(chord, self.course):
            raise NotConverged("it strays off the path", point.iterations)
        return point


def _search(
    piece: _Piece, low: tuple[float, PathPoint], high: tuple[float, PathPoint], tolerance: float
) -> list[CriticalPoint]:
    """The critical points between two distances along ``piece``."""
    turn, failures = 0, 0
    while high[0] - low[0] > tolerance and failures < len(_ELSEWHERE):
        distance = _guess(piece.points, low, high, tolerance, halve=turn % 3 == 2)
        if failures:
            distance = low[0] + _ELSEWHERE[failures] * (high[0] - low[0])
        turn += 1
        try:
            middle, failures = (distance, piece.at(distance)), 0
        except NotConverged as failure:
            _log.debug("no equilibrium on the way to a critical point: %s", failure)
            failures += 1
            continue
        left, right = _changes(piece.points, low[1], middle[1]), _changes(piece.points, middle[1], high[1])
        if left and right:
            return _search(piece, low, middle, tolerance) + _search(piece, middle, high, tolerance)
        low, high = (low, middle) if left else (middle, high)
    return _classified(piece, low[1], high[1])


def _guess(
    points: PathPoints, low: tuple[float, PathPoint], high: tuple[float, PathPoint], tolerance: float, *, halve: bool
) -> float:
    """Where to look next: where a rate that changes sign vanishes on the line, a little to its farther side."""
    (a, before), (b, after) = low, high
    middle = 0.5 * (a + b)
    if halve:
        return middle
    for rate in (_parameter_rate, _conjugate_rate):
        first, second = rate(points, before), rate(points, after)
        if first * second < 0.0:
            root = a + (b - a) * first / (first - second)
            root += 0.4 * tolerance if root < middle else -0.4 * tolerance
            return min(max(root, a + 0.1 * tolerance), b - 0.1 * tolerance)
    return middle


def _parameter_rate(points: PathPoints, point: PathPoint) -> float:
    rate = point.tangent.parameter / points.metric.parameter
    return rate if abs(rate) > _NO_RATE else 0.0


def _conjugate_rate(points: PathPoints, point: PathPoint) -> float:
    """Of a displacement; what motors exert may have any number of extrema without harm."""
    if points.lead.displaces:
        return 0.0
    rate = point.conjugate / points.metric.conjugate
    return rate if abs(rate) > _NO_RATE else 0.0


def _changes(points: PathPoints, a: PathPoint, b: PathPoint) -> bool:
    return (
        a.unstable_modes != b.unstable_modes
        or _parameter_rate(points, a) * _parameter_rate(points, b) < 0.0
        or _conjugate_rate(points, a) * _conjugate_rate(points, b) < 0.0
    )


def _classified(piece: _Piece, a: PathPoint, b: PathPoint) -> list[CriticalPoint]:
    """What lies between two points that are as good as one."""
    points, course = piece.points, piece.course
    found, modes = [], abs(b.unstable_modes - a.unstable_modes)
    if _parameter_rate(points, a) * _parameter_rate(points, b) < 0.0:
        nearer = min(a, b, key=lambda point: abs(point.tangent.parameter))
        kind = Critical.TURNING if points.lead.displaces else Critical.LIMIT
        found.append(CriticalPoint(kind, nearer, 1, course))
        modes = abs(modes - 1)
    if modes:
        found.append(CriticalPoint(Critical.BIFURCATION, b, modes, course))
    if _conjugate_rate(points, a) * _conjugate_rate(points, b) < 0.0:
        nearer = min(a, b, key=lambda point: abs(point.conjugate))
        found.append(CriticalPoint(Critical.TURNING, nearer, 0, course))
    return found
