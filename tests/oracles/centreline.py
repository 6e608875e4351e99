"""Smooth planar centrelines by arc length: the reference shape of the beam oracle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

Curve = Callable[[np.ndarray], np.ndarray]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True)
class Centreline:
    """A planar curve with arc length s in [0, length].

    position: s (n,) -> (n, 2); angle: s (n,) -> (n,), the tangent's angle in rad, continuous between breaks;
    breaks: arc lengths at which the curve is less smooth (spline knots, corners), for integration to respect.
    """

    length: float
    position: Curve
    angle: Curve
    breaks: tuple[float, ...] = ()

    def trimmed(self, start: float, end: float) -> Centreline:
        """The part that remains after ``start`` is cut off at s = 0 and ``end`` at s = length."""
        if start < 0.0 or end < 0.0 or start + end >= self.length:
            raise ValueError(f"cannot cut {start} and {end} off a centreline of length {self.length}")
        length = self.length - start - end
        return Centreline(
            length,
            lambda s: self.position(np.asarray(s) + start),
            lambda s: self.angle(np.asarray(s) + start),
            tuple(b - start for b in self.breaks if start < b < start + length),
        )


def from_function(curve: Callable[[float], tuple[float, float, float]], length: float) -> Centreline:
    """Centreline of a scalar function s -> (x, y, angle) that is already in arc length and smooth."""
    return Centreline(
        length,
        lambda s: np.array([curve(float(si))[:2] for si in np.atleast_1d(s)]),
        lambda s: np.array([curve(float(si))[2] for si in np.atleast_1d(s)]),
    )


def straight(start: Sequence[float], end: Sequence[float]) -> Centreline:
    """The straight line from ``start`` to ``end``."""
    origin = np.asarray(start, dtype=float)
    chord = np.asarray(end, dtype=float) - origin
    length = float(np.hypot(*chord))
    heading = float(np.arctan2(chord[1], chord[0]))
    return Centreline(
        length,
        lambda s: origin + np.multiply.outer(np.asarray(s), chord / length),
        lambda s: np.full(np.shape(s), heading),
    )


def arc(radius: float, opening: float, *, start: Sequence[float] = (0.0, 0.0), heading: float = 0.0) -> Centreline:
    """Circular arc of signed ``opening`` (rad, positive turns left) that leaves ``start`` at angle ``heading``."""
    origin = np.asarray(start, dtype=float)
    curvature = np.sign(opening) / radius

    def angle(s: np.ndarray) -> np.ndarray:
        return heading + curvature * np.asarray(s)

    def position(s: np.ndarray) -> np.ndarray:
        turned = angle(s)
        offset = np.stack([np.sin(turned) - np.sin(heading), np.cos(heading) - np.cos(turned)], axis=-1)
        return origin + offset / curvature

    return Centreline(radius * abs(opening), position, angle)


def through(points: Sequence[Sequence[float]]) -> Centreline:
    """The C² cubic spline through ``points`` (n, 2), chord-length parameter, not-a-knot ends; two points: a line."""
    points = np.asarray(points, dtype=float)
    if len(points) == 2:
        return straight(*points)
    knots = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spline = CubicSpline(knots, points)
    return from_parametric(spline, spline.derivative(), knots)


def from_parametric(curve: Curve, derivative: Curve, knots: Sequence[float], *, panels: int = 32) -> Centreline:
    """Arc-length form of a regular parametric curve.

    curve, derivative: t (n,) -> (n, 2); knots: increasing parameters, first and last are the ends, between two of
    them the curve is smooth; panels: integration panels between two knots.
    """
    knots = np.asarray(knots, dtype=float)
    edges = np.concatenate([np.linspace(a, b, panels, endpoint=False) for a, b in zip(knots, knots[1:], strict=False)])
    edges = np.append(edges, knots[-1])

    def arc_length(t0: np.ndarray, t1: np.ndarray) -> np.ndarray:
        """∫ |dr/dt| dt from t0 to t1 by ten-point Gauss quadrature."""
        half = 0.5 * (t1 - t0)
        t = (0.5 * (t0 + t1))[..., None] + half[..., None] * _NODES
        speed = np.linalg.norm(derivative(t.ravel()), axis=-1).reshape(t.shape)
        return half * (speed @ _WEIGHTS)

    lengths = np.concatenate([[0.0], np.cumsum(arc_length(edges[:-1], edges[1:]))])
    tangents = derivative(edges)
    edge_angles = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))

    def parameter(s: np.ndarray) -> np.ndarray:
        s = np.clip(np.asarray(s, dtype=float), 0.0, lengths[-1])
        panel = np.clip(np.searchsorted(lengths, s, side="right") - 1, 0, len(edges) - 2)
        t = np.interp(s, lengths, edges)
        for _ in range(4):  # Newton on s(t) = s from a guess that is already good to the panel size squared
            excess = lengths[panel] + arc_length(edges[panel], t) - s
            t = np.clip(t - excess / np.linalg.norm(derivative(t), axis=-1), edges[panel], edges[panel + 1])
        return t

    def angle(s: np.ndarray) -> np.ndarray:
        t = parameter(s)
        tangent = derivative(t)
        principal = np.arctan2(tangent[..., 1], tangent[..., 0])
        turns = np.round((np.interp(t, edges, edge_angles) - principal) / (2.0 * np.pi))
        return principal + 2.0 * np.pi * turns

    breaks = tuple(float(b) for b in lengths[panels:-1:panels])
    return Centreline(float(lengths[-1]), lambda s: curve(parameter(s)), angle, breaks)
