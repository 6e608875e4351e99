"""The curves that outlines are made of: B-splines, straight lines among them, and arcs of circles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

_COARSEST = 0.92  # cos φ: a circle has eight chords at least


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

    def at(self, share: np.ndarray) -> np.ndarray:
        """The points (k, 2) at the given shares (k,) of the sweep."""
        angles = self.first + self.sweep * np.asarray(share)
        return self.centre + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])


Curve = BSpline | CircleArc  # a B-spline is clamped to its ends; one of degree 1 is a single straight line


def start_of(curve: Curve) -> np.ndarray:
    """The point (2,) in which a curve begins."""
    return curve.at(np.zeros(1))[0] if isinstance(curve, CircleArc) else curve.c[0]


def sampled(curves: Sequence[Curve], tolerance: float) -> np.ndarray:
    """The closed polygon (m, 2) with vertices on ``curves``, from which it deviates by at most ``tolerance``."""
    return np.concatenate([_samples(curve, tolerance) for curve in curves])


@singledispatch
def _samples(curve: Curve, tolerance: float) -> np.ndarray:
    """Points of a curve, from its start to before its end."""
    raise TypeError(f"{type(curve).__name__} is not a curve of an outline")


@_samples.register
def _(curve: BSpline, tolerance: float) -> np.ndarray:
    knots = np.unique(curve.t)
    # the chord over a piece of length h in the parameter misses the curve by at most h² max|C''| / 8
    second = np.linalg.norm(curve(knots, 2), axis=1) if curve.k > 1 else np.zeros(len(knots))
    most = np.maximum(second[:-1], second[1:])
    parts = np.maximum(1, np.ceil(np.diff(knots) * np.sqrt(most / (8.0 * tolerance)))).astype(int)
    pieces = zip(knots[:-1], knots[1:], parts, strict=True)
    return curve(np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in pieces]))


@_samples.register
def _(curve: CircleArc, tolerance: float) -> np.ndarray:
    parts = _arc_parts(curve.radius, curve.sweep, tolerance)
    return curve.at(np.arange(parts) / parts)


def _arc_parts(radius: float, sweep: float, tolerance: float) -> int:
    """Number of chords that stand for an arc: one over the angle 2 φ misses it by r (1 − cos φ)."""
    return math.ceil(abs(sweep) / (2.0 * math.acos(max(_COARSEST, 1.0 - tolerance / radius))))


def arc_through(points: np.ndarray) -> CircleArc:
    """The arc from the first of ``points`` ((n, 2)), which are not in line, through one in the middle to the last."""
    start, via, end = points[[0, len(points) // 2, -1]]
    (a, b), (c, d) = via - start, end - start
    p, q = a * a + b * b, c * c + d * d
    centre = start + np.array([p * d - q * b, q * a - p * c]) / (2.0 * (a * d - b * c))
    first, between, last = (math.atan2(*(at - centre)[::-1]) for at in (start, via, end))
    turn = 2.0 * math.pi
    sweep = (last - first) % turn
    if (between - first) % turn > sweep:
        sweep -= turn
    return CircleArc(centre, math.dist(start, centre), first, sweep)


def interpolant(points: np.ndarray, start: np.ndarray | None = None, end: np.ndarray | None = None) -> BSpline:
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


def chord_lengths(points: np.ndarray) -> np.ndarray:
    """The length (n,) of the polygon through ``points`` ((n, 2)) up to each of them."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
