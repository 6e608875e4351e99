"""The smooth curve through given points: the centreline of a strip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import fixed_quad
from scipy.interpolate import CubicSpline

from fenicsmech.errors import DescriptionError


class Centreline:
    """The interpolating C² cubic spline c(s) through ``points``, with not-a-knot ends.

    The parameter s runs along the chords: s₀ = 0, s_{k+1} = s_k + |p_{k+1} − p_k|. Two points give the straight
    line, three the parabola.

    Args:
        points: (n, dim) with n ≥ 2; neighbours must differ.
        part: what the curve belongs to, for messages.

    Attributes:
        knots: parameters s_k of the points, shape (n,).

    Raises:
        DescriptionError: two neighbouring points coincide.
    """

    def __init__(self, points: Sequence[Sequence[float]], *, part: str = "centreline") -> None:
        points = np.asarray(points, dtype=float)
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if not np.all(chords > 0.0):
            k = int(np.argmin(chords))
            where = ", ".join(f"{c:g}" for c in points[k])
            raise DescriptionError(part, f"points {k} and {k + 1} coincide at ({where})", "Remove one of them")
        self.knots = np.concatenate([[0.0], np.cumsum(chords)])
        self._curve = CubicSpline(self.knots, points, bc_type="not-a-knot")

    @property
    def end(self) -> float:
        """The last parameter; the first is 0."""
        return float(self.knots[-1])

    @property
    def length(self) -> float:
        """Arc length ∫ |c′(s)| ds."""
        pieces = zip(self.knots[:-1], self.knots[1:], strict=True)
        return float(sum(fixed_quad(self._speed, a, b, n=20)[0] for a, b in pieces))

    def evaluate(self, s: np.ndarray | float) -> np.ndarray:
        """Points c(s), shape (*s.shape, dim)."""
        return self._curve(s)

    def tangent(self, s: np.ndarray | float) -> np.ndarray:
        """Unit tangents c′/|c′|, shape (*s.shape, dim)."""
        velocity = self._curve(s, 1)
        return velocity / np.linalg.norm(velocity, axis=-1, keepdims=True)

    def normal(self, s: np.ndarray | float) -> np.ndarray:
        """Unit normals to the left of a planar centreline, shape (*s.shape, 2)."""
        tangent = self.tangent(s)
        return np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)

    def curvature(self, s: np.ndarray | float) -> np.ndarray:
        """Signed curvature det(c′, c″)/|c′|³ of a planar centreline, positive for a left turn, shape s.shape."""
        velocity, bend = self._curve(s, 1), self._curve(s, 2)
        cross = velocity[..., 0] * bend[..., 1] - velocity[..., 1] * bend[..., 0]
        return cross / np.linalg.norm(velocity, axis=-1) ** 3

    def samples(self, per_span: int) -> np.ndarray:
        """Parameters that divide each span between neighbouring points evenly into ``per_span`` parts."""
        spans = [np.linspace(a, b, per_span, endpoint=False) for a, b in zip(self.knots, self.knots[1:], strict=False)]
        return np.concatenate([*spans, self.knots[-1:]])

    def closest(self, point: Sequence[float]) -> float:
        """Parameter of the point of the curve nearest to ``point``: (c(s) − p)·c′(s) = 0, or an end."""
        s = self.samples(64)
        nearest = int(np.argmin(np.linalg.norm(self.evaluate(s) - point, axis=1)))
        low, high = s[max(nearest - 1, 0)], s[min(nearest + 1, len(s) - 1)]
        # bisection on the sign of the slope of the distance: plain, and exact to the last digits
        for _ in range(60):
            middle = 0.5 * (low + high)
            slope = np.dot(self.evaluate(middle) - point, self._curve(middle, 1))
            low, high = (middle, high) if slope < 0.0 else (low, middle)
        return min((0.0, 0.5 * (low + high), self.end), key=lambda t: np.linalg.norm(self.evaluate(t) - point))

    def _speed(self, s: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self._curve(s, 1), axis=-1)
