"""Smooth closed curves through the vertices of polygons: lines and arcs where these are exact, else splines."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from fenicsmech.meshing.corners import corners_of, sharp_corners_of
from fenicsmech.meshing.outline_curves import Curve, arc_through, chord_lengths, interpolant

_EXACT = 5e-8  # of the polygon's extent: how far vertices on a line or an arc may lie off it, as CAD leaves them
_WIDEST = 1e3  # of its extent: the radius of an arc
_LEAST_SWEEP = 0.25 * math.pi  # of an arc inside a smooth curve; a gentle curve is anywhere close to some circle


def smooth_outline(polygon: np.ndarray) -> list[Curve]:
    """The curves through all vertices of a closed polygon, which have corners where the polygon has true ones.

    Args:
        polygon: vertices (n, 2), all of them different.

    Returns:
        Curves, each from the end of the one before; none is closed by itself. Straight lines are B-splines of degree 1
        with two coefficients. Arcs of circles run through three vertices between corners, and wherever more of them
        are on one circle. The others are B-splines of degree 3, or 2 if there are only three vertices.
    """
    breaks = _breaks(polygon)
    slopes: dict[int, np.ndarray] = {}
    if len(breaks) < 2:
        slopes = _halves(polygon, breaks)
        breaks = sorted({*breaks, *slopes})
    allowed, count = _EXACT * _extent(polygon), len(polygon)
    curves: list[Curve] = []
    for start, end in zip(breaks, [*breaks[1:], breaks[0] + count], strict=True):
        run = polygon[np.arange(start, end + 1) % count]
        if _bulge(run) <= allowed:
            curves.append(interpolant(run[[0, -1]]))
        elif _is_arc(run, allowed):
            curves.append(arc_through(run))
        else:
            curves.append(interpolant(run, slopes.get(start), slopes.get(end % count)))
    return curves


def _breaks(polygon: np.ndarray) -> list[int]:
    """The corners of a polygon, and the vertices where exact lines and arcs begin and end."""
    count, corner, ends = len(polygon), corners_of(polygon), set()
    for first, last in _exact_runs(polygon):
        corner[np.arange(first + 1, last) % count] = False
        ends.update((first, last % count))
    return sorted(ends.union(np.flatnonzero(corner).tolist()))


def _exact_runs(polygon: np.ndarray) -> Iterator[tuple[int, int]]:
    """The first and the last vertex of each line of three edges or more and each arc of four or more.

    Four vertices are on one circle by chance: on a chamfer, or on both sides of the axis of a symmetric shape.
    """
    count, allowed = len(polygon), _EXACT * _extent(polygon)
    if count < 4:
        return
    sharp = sharp_corners_of(polygon)
    fours = polygon[(np.arange(count)[:, None] + np.arange(4)) % count]
    smooth = ~np.roll(sharp, -1) & ~np.roll(sharp, -2)
    straight = smooth & np.array([_bulge(four) <= allowed for four in fours])
    circular = smooth & np.array([_is_arc(four, allowed) for four in fours])
    for first, last in _runs(straight):
        yield first, last + 3
    for first, last in _runs(circular):
        # a whole circle has no ends
        if first < last < first + count - 3:
            arc = arc_through(polygon[np.arange(first, last + 4) % count])
            if abs(arc.sweep) >= _LEAST_SWEEP:
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


def _bulge(points: np.ndarray) -> float:
    """The greatest distance of ``points`` ((n, 2)) from the line through the first and the last."""
    (x, y), offsets = points[-1] - points[0], points - points[0]
    return float(np.abs(x * offsets[:, 1] - y * offsets[:, 0]).max()) / math.hypot(x, y)


def _is_arc(points: np.ndarray, allowed: float) -> bool:
    """Whether ``points`` ((n, 2)) lie on an arc but for ``allowed``, and not on a line."""
    if _bulge(points[[0, len(points) // 2, -1]]) <= allowed:
        return False
    arc = arc_through(points)
    off = np.abs(np.linalg.norm(points - arc.centre, axis=1) - arc.radius)
    return arc.radius <= _WIDEST * _extent(points) and bool(off.max() <= allowed)


def _halves(polygon: np.ndarray, breaks: list[int]) -> dict[int, np.ndarray]:
    """Where to divide a curve that has one break, or none, and its derivatives there."""
    start, count = (breaks or [0])[0], len(polygon)
    around = polygon[np.arange(start, start + count + 1) % count]
    curve = CubicSpline(chord_lengths(around), around, bc_type="not-a-knot" if breaks else "periodic")
    middle = count // 2
    slopes = {(start + middle) % count: curve(curve.x[middle], 1)}
    return slopes if breaks else {start: curve(curve.x[0], 1), **slopes}
