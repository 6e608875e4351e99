"""Limit points, turning points and bifurcations of a path: noticed between two equilibria, and located.

What a step across each of them changes, with n unstable modes, the rates ṗ of the parameter and q̇ of its conjugate:

    limit point     force's rate changes sign           a dead load has an extremum and snaps from here
    turning point   displacement's rate changes sign    so has a held point, or a motor
    bifurcation     n changes otherwise                 other paths cross this one

n changes by one where ṗ changes sign. Located is the root of the line through the rates or, at a bifurcation, through
the stiffness μ of the softest mode on either side; the inertia judges on which side of it an equilibrium lies, until
what changes is known closely enough and single.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fenicsmech.equilibrium.lead import Heading
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.soft_mode import SoftMode
from fenicsmech.equilibrium.solver import NotConverged
from fenicsmech.log import logger

_log = logger(__name__)
_STRAYED = 1.0  # of the way along a step: how far off it a point is none of the path any more
_NO_RATE = 1e-9  # of the references: less is rounding
_ASIDE = 0.4  # tolerances off a root: where to look, so that both sides of it become known
_WIDER = 8.0  # times farther off, where there was nothing to be found


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
        point: the equilibrium nearest to it that was found.
        value: p there. Where the mesh turns a bifurcation into two paths that pass each other, no equilibrium is near
            it, but the line through the stiffnesses on either side has its root where they would cross.
        modes: by how many the unstable modes change there.
        course: the direction of the path over the step in which it lies. The tangent in the point itself is no measure
            of it: rounding and the asymmetry of meshes let it lean towards the paths that cross.
    """

    kind: Critical
    point: PathPoint
    value: float
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
    piece = _Piece(points, before, after)
    return _search(piece, *piece.ends(), tolerance * piece.width)


@dataclass(frozen=True)
class _Sample:
    """A point of a piece: how far along it lies, and the stiffness of its softest mode."""

    distance: float
    point: PathPoint
    stiffness: float


class _Piece:
    """A step of the path."""

    def __init__(self, points: PathPoints, before: PathPoint, after: PathPoint) -> None:
        self.points, self.before, self.after = points, before, after
        self.width = points.along(before, after)
        self.course = points.metric.unit(points.difference(after.state, before.state))
        self._mode = SoftMode(points.system)

    def ends(self) -> tuple[_Sample, _Sample]:
        """Both ends."""
        samples = []
        for distance, point in ((0.0, self.before), (self.width, self.after)):
            at = self.points.linearise(point, self.before)
            samples.append(_Sample(distance, point, self._mode.stiffness(at)))
        return samples[0], samples[1]

    def at(self, distance: float) -> _Sample:
        """The equilibrium on the way, unless it strays off it.

        Meshes without a column's symmetry turn its bifurcation into two paths that pass each other closely; what turns
        off from one to the other there is none of this path's points.
        """
        point = self.points.between(self.before, self.after, distance)
        metric, chord = self.points.metric, self.points.difference(point.state, self.before.state)
        off = chord + self.course.scaled(-metric.dot(chord, self.course))
        if metric.norm(off) > _STRAYED * metric.dot(chord, self.course):
            raise NotConverged("it strays off the path", point.iterations)
        return _Sample(distance, point, self._mode.stiffness(point.linearisation))


def _search(piece: _Piece, low: _Sample, high: _Sample, tolerance: float) -> list[CriticalPoint]:
    """The critical points between two samples of ``piece``."""
    points, least, before = piece.points, _ASIDE * tolerance, None
    while (width := high.distance - low.distance) > tolerance and least < width:
        root = _root(points, low, high)
        aside = least if before is None else max(least, abs(root - before))  # it is no nearer to where it will be
        before = root
        try:
            middle = piece.at(_across(root, aside, low, high))
        except NotConverged as failure:
            _log.debug("no equilibrium on the way to a critical point: %s", failure)
            least *= _WIDER
            continue
        left, right = _changes(points, low.point, middle.point), _changes(points, middle.point, high.point)
        if left and right:
            return _search(piece, low, middle, tolerance) + _search(piece, middle, high, tolerance)
        low, high = (low, middle) if left else (middle, high)
    return _classified(piece, low, high)


def _root(points: PathPoints, low: _Sample, high: _Sample) -> float:
    """Where the line through what changes sign vanishes; the middle if nothing does."""
    pairs = [(rate(points, low.point), rate(points, high.point)) for rate in (_parameter_rate, _conjugate_rate)]
    for first, second in (*pairs, (low.stiffness, high.stiffness)):
        if first * second < 0.0:
            return low.distance + (high.distance - low.distance) * first / (first - second)
    return 0.5 * (low.distance + high.distance)


def _across(root: float, aside: float, low: _Sample, high: _Sample) -> float:
    """``aside`` of a root, on the side of the farther end, so that both sides of it become known; within the ends."""
    middle = 0.5 * (low.distance + high.distance)
    return min(root + aside, middle) if root < middle else max(root - aside, middle)


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


def _classified(piece: _Piece, low: _Sample, high: _Sample) -> list[CriticalPoint]:
    """What lies between two samples that are as good as one."""
    points, course, a, b = piece.points, piece.course, low.point, high.point
    p, q = points.lead.value(a.state), points.lead.value(b.state)
    found, modes = [], abs(b.unstable_modes - a.unstable_modes)
    if _parameter_rate(points, a) * _parameter_rate(points, b) < 0.0:
        nearer = min(a, b, key=lambda point: abs(point.tangent.parameter))
        kind = Critical.TURNING if points.lead.displaces else Critical.LIMIT
        found.append(CriticalPoint(kind, nearer, points.lead.value(nearer.state), 1, course))
        modes = abs(modes - 1)
    if modes:
        nearer = min(low, high, key=lambda sample: abs(sample.stiffness)).point
        value = points.lead.value(nearer.state)
        if low.stiffness * high.stiffness < 0.0:
            value = p + (q - p) * low.stiffness / (low.stiffness - high.stiffness)
        found.append(CriticalPoint(Critical.BIFURCATION, nearer, value, modes, course))
    if _conjugate_rate(points, a) * _conjugate_rate(points, b) < 0.0:
        nearer = min(a, b, key=lambda point: abs(point.conjugate))
        found.append(CriticalPoint(Critical.TURNING, nearer, points.lead.value(nearer.state), 0, course))
    return found
