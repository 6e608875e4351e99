"""Smooth closed curves through the vertices of polygons: lines and arcs where these are exact, else splines.

With edges l_i from vertex i to i + 1 a polygon turns by θ_i at vertex i, and per length by
κ_i = 2 θ_i / (l_{i-1} + l_i). A smooth curve with the curvatures of the neighbouring vertices turns by
(κ_{i-1} l_{i-1} + κ_{i+1} l_i) / 2; where θ_i exceeds that by much, the shape has a true corner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from fenicsmech.meshing import CircleArc, Curve, straight_line
from fenicsmech.polygons import chord_lengths


@dataclass(frozen=True)
class OutlineTolerances:
    """Tolerances for corners, straight lines and arcs of circles.

    Attributes:
        sharp: turn (rad) of a corner, whatever its neighbours; more than that of a circle of eight vertices.
        unexpected: largest deviation (rad) of the turn of a smooth curve from the one expected.
        irregular: the same over the turns nearby: 1/4 where a curvature sets in, and up to 1/2 if the edges grow there.
        distance: largest distance of vertices from their line or arc over the polygon's extent; some CAD rounding.
        widest_arc: greatest radius of an arc over the polygon's extent.
        least_sweep: of an arc (rad) inside a smooth curve; over shorter ones any curve is close to a circle.
    """

    sharp: float = math.radians(60.0)
    unexpected: float = math.radians(15.0)
    irregular: float = 0.5
    distance: float = 5e-8
    widest_arc: float = 1e3
    least_sweep: float = 0.25 * math.pi


TOLERANCES = OutlineTolerances()


def smooth_outline(polygon: np.ndarray) -> list[Curve]:
    """The curves through all vertices (n, 2) of a closed polygon, which have corners where the polygon has true ones.

    Returns:
        Curves, each from the end of the one before; none is closed by itself. Straight lines are B-splines of degree 1
        with two coefficients. Arcs of circles run through three vertices between corners, and wherever more of them
        are on one circle. The others are B-splines of degree 3, or 2 if there are only three vertices.
    """
    allowed, count = TOLERANCES.distance * _extent(polygon), len(polygon)
    corner, ends = corners_of(polygon), set[int]()
    for first, last in _exact_runs(polygon):
        corner[np.arange(first + 1, last) % count] = False
        ends.update((first, last % count))
    breaks = sorted(ends.union(np.flatnonzero(corner).tolist()))
    slopes = _halves(polygon, breaks) if len(breaks) < 2 else {}
    breaks = sorted({*breaks, *slopes})
    curves: list[Curve] = []
    for start, end in zip(breaks, [*breaks[1:], breaks[0] + count], strict=True):
        run = polygon[np.arange(start, end + 1) % count]
        if _sagitta(run) <= allowed:
            curves.append(straight_line(*run[[0, -1]]))
        elif _is_arc(run, allowed):
            curves.append(_arc_through(run))
        else:
            curves.append(_interpolant(run, slopes.get(start), slopes.get(end % count)))
    return curves


def _exact_runs(polygon: np.ndarray) -> Iterator[tuple[int, int]]:
    """The first and the last vertex of each line of three edges or more and each arc of four or more.

    Four vertices are on one circle by chance: on a chamfer, or on both sides of the axis of a symmetric shape.
    """
    count, allowed = len(polygon), TOLERANCES.distance * _extent(polygon)
    if count < 4:
        return
    sharp = _sharp_corners_of(polygon)
    fours = polygon[(np.arange(count)[:, None] + np.arange(4)) % count]
    smooth = ~np.roll(sharp, -1) & ~np.roll(sharp, -2)
    straight = smooth & np.array([_sagitta(four) <= allowed for four in fours])
    circular = smooth & np.array([_is_arc(four, allowed) for four in fours])
    for first, last in _runs(straight):
        yield first, last + 3
    for first, last in _runs(circular):
        # a whole circle has no ends
        if first < last < first + count - 3:
            arc = _arc_through(polygon[np.arange(first, last + 4) % count])
            if abs(arc.sweep) >= TOLERANCES.least_sweep:
                yield first, last + 3


def _runs(holds: np.ndarray) -> Iterator[tuple[int, int]]:
    """The first and the last index of each sequence of True in the cyclic array ``holds``; none if all are.

    The last is not less than the first, and may lie beyond the end of the array.
    """
    firsts = np.flatnonzero(holds & ~np.roll(holds, 1))
    lasts = np.flatnonzero(holds & ~np.roll(holds, -1))
    if len(firsts) and lasts[0] < firsts[0]:
        lasts = np.append(lasts[1:], lasts[0] + len(holds))
    return zip(firsts.tolist(), lasts.tolist(), strict=True)


def _extent(points: np.ndarray) -> float:
    return float(np.ptp(points, axis=0).max())


def _sagitta(points: np.ndarray) -> float:
    """The greatest distance of ``points`` ((n, 2)) from the line through the first and the last."""
    (x, y), offsets = points[-1] - points[0], points - points[0]
    return float(np.abs(x * offsets[:, 1] - y * offsets[:, 0]).max()) / math.hypot(x, y)


def _is_arc(points: np.ndarray, allowed: float) -> bool:
    """Whether ``points`` ((n, 2)) lie on an arc but for ``allowed``, and not on a line."""
    if _sagitta(points[[0, len(points) // 2, -1]]) <= allowed:
        return False
    arc = _arc_through(points)
    off = np.abs(np.linalg.norm(points - arc.centre, axis=1) - arc.radius)
    return arc.radius <= TOLERANCES.widest_arc * _extent(points) and bool(off.max() <= allowed)


def _halves(polygon: np.ndarray, breaks: list[int]) -> dict[int, np.ndarray]:
    """Vertices at which a curve with at most one break is divided, and its derivatives there."""
    start, count = (breaks or [0])[0], len(polygon)
    around = polygon[np.arange(start, start + count + 1) % count]
    curve = CubicSpline(chord_lengths(around), around, bc_type="not-a-knot" if breaks else "periodic")
    return {(start + k) % count: curve(curve.x[k], 1) for k in ([count // 2] if breaks else [0, count // 2])}


def _arc_through(points: np.ndarray) -> CircleArc:
    """The arc from the first of ``points`` ((n, 2)), which are not in line, through one in the middle to the last."""
    return CircleArc.through(*points[[0, len(points) // 2, -1]])


def _interpolant(points: np.ndarray, start: np.ndarray | None = None, end: np.ndarray | None = None) -> BSpline:
    """The spline through ``points`` with the derivatives ``start`` and ``end`` by chord length, where they are given.

    At an end without derivative the first two pieces are one polynomial ("not a knot").
    """
    x = chord_lengths(points)
    slopes = [None if slope is None else [(1, slope)] for slope in (start, end)]
    conditions = len(x) + sum(slope is not None for slope in slopes)
    degree = min(3, conditions - 1)
    inner = x[1:-1][start is None : len(x) - 2 - (end is None)] if conditions > 4 else x[:0]
    knots = np.concatenate([np.full(degree + 1, x[0]), inner, np.full(degree + 1, x[-1])])
    return make_interp_spline(x, points, k=degree, t=knots, bc_type=tuple(slopes) if conditions > len(x) else None)


def corners_of(polygon: np.ndarray) -> np.ndarray:
    """Mask of the vertices of a closed polygon that are corners of the shape it approximates.

    The clearest corner (see the head of this file) is found first, and does not count as a bend of the curve for its
    neighbours any more. A single vertex between two corners that turn the other way is the middle of a small arc, not a
    tip.
    """
    ahead = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    behind, turn = np.roll(ahead, 1), _turns(polygon)
    curvature, corner = 2.0 * turn / (behind + ahead), _sharp_corners_of(polygon)
    while True:
        # the bends at the vertices before and after, from the other side where one of these is a corner
        before, after = np.roll(curvature, 1), np.roll(curvature, -1)
        left, right = np.where(np.roll(corner, 1), after, before), np.where(np.roll(corner, -1), before, after)
        unexpected = np.abs(turn - 0.5 * (left * behind + right * ahead))
        smooth = np.abs(np.where(corner, 0.0, curvature))
        nearby = np.max([np.roll(smooth, k) for k in range(-2, 3)], axis=0)
        excess = unexpected / np.maximum(TOLERANCES.unexpected, TOLERANCES.irregular * 0.5 * nearby * (behind + ahead))
        excess[corner | _between(corner)] = 0.0
        clearest = int(np.argmax(excess))
        if excess[clearest] <= 1.0:
            break
        corner[clearest] = True
    dents = turn * np.roll(turn, 1) < 0.0, turn * np.roll(turn, -1) < 0.0
    return corner & ~(_between(corner) & np.all(dents, axis=0)) | _sharp_corners_of(polygon)


def _sharp_corners_of(polygon: np.ndarray) -> np.ndarray:
    """Mask (n,) of the vertices of a closed polygon (n, 2) that turn more than any curve of its resolution."""
    return np.abs(_turns(polygon)) > TOLERANCES.sharp


def _turns(polygon: np.ndarray) -> np.ndarray:
    """The angle (rad) by which a closed polygon turns left at each vertex."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    x, y = np.roll(ahead, 1, axis=0).T
    return np.arctan2(x * ahead[:, 1] - y * ahead[:, 0], x * ahead[:, 0] + y * ahead[:, 1])


def _between(corner: np.ndarray) -> np.ndarray:
    """Mask of the vertices between two corners."""
    return np.roll(corner, 1) & np.roll(corner, -1)
