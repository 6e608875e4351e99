"""Limit points, turning points and bifurcations of a path, and the paths that cross at bifurcations.

They are detected by a change over a step of n, the number of unstable modes, of v̇, the rate of the followed value, or
of q̇, that of its conjugate:

    limit point     force's rate changes sign           a dead load has an extremum: the mechanism snaps
    turning point   displacement's rate changes sign    so has a held displacement, or a motor
    bifurcation     n changes otherwise                 other paths cross this one

n changes by one where v̇ changes sign. The point is located at the root of the line through the rates or, at a
bifurcation, through the stiffness μ of the softest mode on either side; the inertia brackets it, until the interval is
small and holds a single change. μ comes from inverse iteration with the factor of the KKT matrix K,

    y = K⁻¹ M φ,    μ = (y · M φ) / (y · M y),    φ ← y / √(y · M y),

M the identity of the coordinates s and 0 for multipliers and force; it is an eigenvalue of K under the constraints,
with an error of second order in that of φ. Near a bifurcation μ is by far the smallest of all, and one iteration
suffices.

The path that crosses at a simple bifurcation y_b is entered along the null vector φ of K, made orthogonal to the path,
and found in the plane normal to φ, which meets the new path but, near the bifurcation, not the old one,

    y = y_b ± ε φ,    ⟨φ, y − y_b⟩ = ± ε.

Source of the latter: Wagner & Wriggers (doi:10.1108/eb023727).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fenicsmech.continuation.arc_length import ArcLengthStepper
from fenicsmech.continuation.eigen import softest_modes
from fenicsmech.equilibrium import EquilibriumPoint, Linearisation, NotConverged, Step
from fenicsmech.log import logger

_log = logger(__name__)


class Critical(Enum):
    """Kinds of critical points of a path."""

    LIMIT = "limit point"
    TURNING = "turning point"
    BIFURCATION = "bifurcation"


class Sense(Enum):
    """Sense of a branch: along the null vector, or against it."""

    ALONG = 1.0
    AGAINST = -1.0


@dataclass(frozen=True)
class CriticalPoint:
    """A critical point of a path.

    Attributes:
        kind: limit point, turning point or bifurcation.
        point: the equilibrium nearest to it that was found.
        value: the followed value there. Where the mesh turns a bifurcation into two paths that pass each other, no
            equilibrium is near it, but the line through the stiffnesses on either side has its root where they would
            cross.
        modes: number of modes that change their stability there.
        course: the direction of the path over the step in which it lies. The tangent at the point itself differs:
            rounding and the asymmetry of meshes turn it towards the paths that cross.
    """

    kind: Critical
    point: EquilibriumPoint
    value: float
    modes: int
    course: Step


def locate(path: ArcLengthStepper, before: EquilibriumPoint, after: EquilibriumPoint) -> list[CriticalPoint]:
    """All critical points between two neighbouring points of a path, in its order."""
    if not _changes(path, before, after):
        return []
    piece = _Piece(path, before, after)
    return _search(piece, *piece.ends(), path.steps.tolerance * piece.width)


def null_space(path: ArcLengthStepper, critical: CriticalPoint) -> list[Step]:
    """A basis of the KKT matrix's null space at a bifurcation, largest displacements the mechanism's length.

    As many vectors as modes change their stability there.
    """
    found = softest_modes(path.solver, path.followed, critical.point.state, count=critical.modes)
    return [mode.step for mode in found]


def crossing(path: ArcLengthStepper, critical: CriticalPoint, mode: Step, sense: Sense) -> EquilibriumPoint:
    """The first point of the path that crosses at ``critical``, with the null vector ``mode``.

    Steps of ``path`` continue from there.

    Raises:
        NotConverged: there is none near.
    """
    metric, point = path.metric, critical.point
    course = metric.unit(critical.course)
    across = mode + course.scaled(-metric.dot(mode, course))
    across = metric.unit(across).scaled(sense.value)
    size = 0.02 / path.system.size(across)  # ε, of the mechanism's length, or rad
    for _ in range(8):
        try:
            found = path.correct(path.system.moved(point.state, across.scaled(size)), across, point)
        except NotConverged:
            size *= 0.5
            continue
        path.length = metric.norm(path.system.difference(found.state, point.state))
        return found
    raise NotConverged("no path was found across the bifurcation")


@dataclass(frozen=True)
class _PiecePoint:
    """A point of a piece, its distance along it, and the stiffness of its softest mode."""

    distance: float
    point: EquilibriumPoint
    stiffness: float


class _Piece:
    """A step of the path, with the softest mode found last."""

    def __init__(self, path: ArcLengthStepper, before: EquilibriumPoint, after: EquilibriumPoint) -> None:
        self.path, self.before, self.after = path, before, after
        self.width = path.along(before, after)
        self.course = path.metric.unit(path.chord(before, after))
        self._mask = path.system.unknowns.coordinates_mask()
        self._mode = self._mask.duplicate()
        # without symmetry, so that it has a component in every mode
        self._mode.array_w[:] = np.random.default_rng(path.system.comm.rank).standard_normal(self._mode.local_size)

    def ends(self) -> tuple[_PiecePoint, _PiecePoint]:
        """Both ends."""
        path, local = self.path, self.path.local_parameter(self.before)

        def end(distance: float, point: EquilibriumPoint) -> _PiecePoint:
            path.system.load(point.state)
            at = path.solver.linearise(point.state, local.at(local.value(path.system, point.state)))
            return _PiecePoint(distance, point, self._stiffness(at))

        return end(0.0, self.before), end(self.width, self.after)

    def at(self, distance: float) -> _PiecePoint:
        """The equilibrium ``distance`` along the step, unless it deviates from the step by more than ``distance``.

        Meshes without a column's symmetry turn its bifurcation into two paths that pass each other closely; points
        that lie on the other one are rejected.
        """
        point, metric = self.path.between(self.before, self.after, distance), self.path.metric
        chord = self.path.chord(self.before, point)
        ahead = metric.dot(chord, self.course)
        if metric.norm(chord + self.course.scaled(-ahead)) > ahead:
            raise NotConverged("it leaves the path", point.iterations)
        return _PiecePoint(distance, point, self._stiffness(point.linearisation))

    def _stiffness(self, at: Linearisation) -> float:
        """μ of a KKT matrix, to a relative change of 1e-3.

        At most twelve iterations: where two modes are equally soft, either suffices.
        """
        mask, mode, before = self._mask, self._mode, math.inf
        right, masked = mask.duplicate(), mask.duplicate()
        for _ in range(12):
            right.pointwiseMult(mask, mode)
            right.normalize()
            mode = at.solve(right)
            masked.pointwiseMult(mask, mode)
            value = mode.dot(right) / masked.norm() ** 2
            if abs(value - before) <= 1e-3 * abs(value):
                break
            before = value
        self._mode = mode
        return value


def _search(piece: _Piece, low: _PiecePoint, high: _PiecePoint, tolerance: float) -> list[CriticalPoint]:
    """The critical points between two points of ``piece``.

    Equilibria are computed 0.4 tolerances away from the estimated root, so that it is bracketed; where none is found,
    eight times farther away.
    """
    path, least, before = piece.path, 0.4 * tolerance, None
    while (width := high.distance - low.distance) > tolerance and least < width:
        root = _root(path, low, high)
        aside = least if before is None else max(least, abs(root - before))  # the true root may be as far off
        before = root
        middle = 0.5 * (low.distance + high.distance)
        # on the side of the farther end, and within the ends
        beside = min(root + aside, middle) if root < middle else max(root - aside, middle)
        try:
            between = piece.at(beside)
        except NotConverged as failure:
            _log.debug("no equilibrium on the way to a critical point: %s", failure)
            least *= 8.0
            continue
        left, right = _changes(path, low.point, between.point), _changes(path, between.point, high.point)
        if left and right:
            return _search(piece, low, between, tolerance) + _search(piece, between, high, tolerance)
        low, high = (low, between) if left else (between, high)
    return _classified(piece, low, high)


def _root(path: ArcLengthStepper, low: _PiecePoint, high: _PiecePoint) -> float:
    """Root of the line through the quantity that changes sign; the middle if none does."""
    pairs = zip((*_rates(path, low.point), low.stiffness), (*_rates(path, high.point), high.stiffness), strict=True)
    for first, second in pairs:
        if first * second < 0.0:
            return low.distance + (high.distance - low.distance) * first / (first - second)
    return 0.5 * (low.distance + high.distance)


def _rates(path: ArcLengthStepper, point: EquilibriumPoint) -> tuple[float, float]:
    """v̇ and q̇ over their references, without rounding; extrema of the torques of motors, q̇, are not critical."""
    value = path.value_rate(point) / path.metric.value
    conjugate = 0.0 if path.followed.displaces else point.conjugate_rate / path.metric.conjugate
    return value if abs(value) > 1e-9 else 0.0, conjugate if abs(conjugate) > 1e-9 else 0.0


def _turns(path: ArcLengthStepper, a: EquilibriumPoint, b: EquilibriumPoint) -> tuple[bool, bool]:
    """Whether v̇ and q̇ change sign between two points."""
    (value, conjugate), (other, other_conjugate) = _rates(path, a), _rates(path, b)
    return value * other < 0.0, conjugate * other_conjugate < 0.0


def _changes(path: ArcLengthStepper, a: EquilibriumPoint, b: EquilibriumPoint) -> bool:
    return a.unstable_modes != b.unstable_modes or any(_turns(path, a, b))


def _classified(piece: _Piece, low: _PiecePoint, high: _PiecePoint) -> list[CriticalPoint]:
    """Critical points between two points within the tolerance."""
    path, course, a, b = piece.path, piece.course, low.point, high.point
    found, modes = [], abs(b.unstable_modes - a.unstable_modes)
    value_turns, conjugate_turns = _turns(path, a, b)
    if value_turns:
        nearer = min(a, b, key=lambda point: abs(path.value_rate(point)))
        kind = Critical.TURNING if path.followed.displaces else Critical.LIMIT
        found.append(CriticalPoint(kind, nearer, path.value(nearer), 1, course))
        modes = abs(modes - 1)
    if modes:
        nearer = min(low, high, key=lambda end: abs(end.stiffness)).point
        value, p, q = path.value(nearer), path.value(a), path.value(b)
        if low.stiffness * high.stiffness < 0.0:
            value = p + (q - p) * low.stiffness / (low.stiffness - high.stiffness)
        found.append(CriticalPoint(Critical.BIFURCATION, nearer, value, modes, course))
    if conjugate_turns:
        nearer = min(a, b, key=lambda point: abs(point.conjugate_rate))
        found.append(CriticalPoint(Critical.TURNING, nearer, path.value(nearer), 0, course))
    return found
