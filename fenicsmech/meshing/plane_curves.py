"""Closed curves in the plane: B-splines, straight lines among them, and arcs of circles; polygons that stand for them.

A loop is a list of curves, each of which begins where the one before ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline

from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.request import LEAST_SEGMENTS


@dataclass(frozen=True, eq=False)
class CircleArc:
    """A part of a circle.

    Attributes:
        centre: shape (2,).
        radius: of the circle.
        first: angle (rad) from x at which it begins.
        sweep: angle that it goes on from there, positive if counter-clockwise.
    """

    centre: np.ndarray
    radius: float
    first: float
    sweep: float

    @classmethod
    def through(cls, start: Sequence[float], via: Sequence[float], end: Sequence[float]) -> CircleArc:
        """The arc from ``start`` through ``via`` to ``end``, points (2,) that are not in line."""
        start, via, end = (np.asarray(at, dtype=float) for at in (start, via, end))
        # |c − start| = |c − via| = |c − end|
        (a, b), (c, d) = via - start, end - start
        p, q = a * a + b * b, c * c + d * d
        centre = start + np.array([p * d - q * b, q * a - p * c]) / (2.0 * (a * d - b * c))
        first, between, last = (math.atan2(*(at - centre)[::-1]) for at in (start, via, end))
        turn = 2.0 * math.pi
        sweep = (last - first) % turn
        if (between - first) % turn > sweep:
            sweep -= turn
        return cls(centre, math.dist(start, centre), first, sweep)

    def at(self, fraction: np.ndarray) -> np.ndarray:
        """The points (k, 2) at the given fractions (k,) of the sweep."""
        angles = self.first + self.sweep * np.asarray(fraction)
        return self.centre + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])


Curve = BSpline | CircleArc  # a B-spline is clamped to its ends; one of degree 1 is a single straight line


def line(start: Sequence[float], end: Sequence[float]) -> BSpline:
    """The straight line between two points (2,)."""
    return BSpline([0.0, 0.0, 1.0, 1.0], np.array([start, end], dtype=float), 1)


def start_of(curve: Curve) -> np.ndarray:
    """The point (2,) in which a curve begins."""
    return curve.at(np.zeros(1))[0] if isinstance(curve, CircleArc) else curve.c[0]


def sampled(loop: Sequence[Curve], tolerance: float) -> np.ndarray:
    """The closed polygon (m, 2) with vertices on ``loop``, from which it deviates by at most ``tolerance``."""
    return np.concatenate([_samples(curve, tolerance) for curve in loop])


def _samples(curve: Curve, tolerance: float) -> np.ndarray:
    """Points of a curve, from its start to before its end."""
    if isinstance(curve, CircleArc):
        # a chord over the angle 2 φ misses the arc by r (1 − cos φ)
        widest = max(math.cos(math.pi / LEAST_SEGMENTS), 1.0 - tolerance / curve.radius)
        parts = math.ceil(abs(curve.sweep) / (2.0 * math.acos(widest)))
        return curve.at(np.arange(parts) / parts)
    knots = np.unique(curve.t)
    # the chord over a piece of length h in the parameter misses the curve by at most h² max|C''| / 8
    second = np.linalg.norm(curve(knots, 2), axis=1) if curve.k > 1 else np.zeros(len(knots))
    most = np.maximum(second[:-1], second[1:])
    parts = np.maximum(1, np.ceil(np.diff(knots) * np.sqrt(most / (8.0 * tolerance)))).astype(int)
    pieces = zip(knots[:-1], knots[1:], parts, strict=True)
    return curve(np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in pieces]))


def draw_loop(loop: Sequence[Curve], height: float = 0.0) -> int:
    """The tag of ``loop`` as a curve loop of the plane z = ``height`` in the current gmsh model.

    A single curve is a whole circle.
    """
    if len(loop) == 1:
        circle = gmsh.model.occ.addCircle(*loop[0].centre, height, loop[0].radius)
        return gmsh.model.occ.addCurveLoop([circle])
    starts = [gmsh.model.occ.addPoint(*start_of(curve), height) for curve in loop]
    ends = zip(starts, [*starts[1:], starts[0]], strict=True)
    edges = [edge for curve, pair in zip(loop, ends, strict=True) for edge in _draw(curve, pair, height)]
    return gmsh.model.occ.addCurveLoop(edges)


def _draw(curve: Curve, ends: tuple[int, int], height: float) -> list[int]:
    """The edges that draw a curve between two points of the current gmsh model."""
    occ = gmsh.model.occ
    if isinstance(curve, CircleArc):
        # in pieces below a half turn, whose ends say on which side they run
        pieces = math.ceil(abs(curve.sweep) / (0.75 * math.pi))
        between = [occ.addPoint(*at, height) for at in curve.at(np.arange(1, pieces) / pieces)]
        helpers = [occ.addPoint(*curve.centre, height)]
        edges = [occ.addCircleArc(a, helpers[0], b) for a, b in pairwise([ends[0], *between, ends[1]])]
    elif curve.k == 1:
        return [occ.addLine(*ends)]
    else:
        helpers = [occ.addPoint(*at, height) for at in curve.c[1:-1]]
        knots, repeats = (a.tolist() for a in np.unique(curve.t, return_counts=True))
        edges = [occ.addBSpline([ends[0], *helpers, ends[1]], degree=curve.k, knots=knots, multiplicities=repeats)]
    # points that no edge begins or ends in would go into files
    occ.remove([(0, at) for at in helpers])
    return edges


def first_crossing(polygon: np.ndarray) -> np.ndarray | None:
    """A point where two edges of the closed ``polygon`` ((n, 2)) that are not neighbours meet, or None."""
    count, edge = len(polygon), np.roll(polygon, -1, axis=0) - polygon
    ends = np.stack([polygon, polygon + edge])
    # sweep along the longer side of the polygon: only edges that overlap there can meet
    sweep = ends[..., int(np.argmax(np.ptp(polygon, axis=0)))]
    order = np.argsort(sweep.min(axis=0))
    behind = np.searchsorted(sweep.min(axis=0)[order], sweep.max(axis=0)[order], side="right") - np.arange(count) - 1
    first = np.repeat(np.arange(count), behind)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(behind) - behind, behind)
    i, j = np.sort([order[first], order[second]], axis=0)
    strangers = (j - i > 1) & (j - i < count - 1)
    i, j = i[strangers], j[strangers]
    # p_i + t e_i = p_j + u e_j; edges in line with each other do not cross
    between, sine, lengths = polygon[j] - polygon[i], _cross(edge[i], edge[j]), np.linalg.norm(edge, axis=1)
    sine[np.abs(sine) <= 1e-10 * lengths[i] * lengths[j]] = np.nan
    t, u = _cross(between, edge[j]) / sine, _cross(between, edge[i]) / sine
    meetings = np.flatnonzero((t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0))
    if not len(meetings):
        return None
    k = min(meetings, key=lambda k: (i[k], j[k]))
    return polygon[i[k]] + t[k] * edge[i[k]]


def inside(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Whether ``point`` (2,) lies in the closed ``polygon`` ((n, 2)): a ray from it crosses an odd number of edges."""
    a, b = polygon - point, np.roll(polygon, -1, axis=0) - point
    straddles = (a[:, 1] > 0.0) != (b[:, 1] > 0.0)
    a, b = a[straddles], b[straddles]
    reach = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(reach > 0.0) % 2)


def distance(polygon: np.ndarray, point: np.ndarray) -> float:
    """Distance of ``point`` (2,) from the edges of the closed ``polygon`` ((n, 2))."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    along = np.einsum("ij,ij->i", point - polygon, edge) / np.einsum("ij,ij->i", edge, edge)
    nearest = polygon + np.clip(along, 0.0, 1.0)[:, None] * edge
    return float(np.linalg.norm(point - nearest, axis=1).min())


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
