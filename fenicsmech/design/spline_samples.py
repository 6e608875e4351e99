"""Samples of a spline that fabrication bounds are put on: local thickness, and curvature ratio.

r = h / R,    h the mean length of two consecutive segments a, b, R the circumradius of their three ends:
r = (|a| + |b|) (a × b) / (|a| |b| |a + b|),     with the sign of the bend, which keeps it smooth.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy

from fenicsmech.design.spline import LinkSpline

COUNT = 500
"""Samples per spline (section VI-A of the paper)."""


class SplineSamples:
    """Uniform samples in t of one spline; both δ and the points are linear in p."""

    def __init__(self, spline: LinkSpline, *, count: int = COUNT) -> None:
        self.t = np.linspace(0.0, spline.segments, count)
        self._gradient = spline.gradient(self.t)
        self._fixed = spline.evaluate(np.zeros(spline.size), self.t)

    @property
    def thickness_gradient(self) -> np.ndarray:
        """∂δ/∂p, the same for all p, (count, size)."""
        return self._gradient[:, 2]

    def thickness(self, p: np.ndarray) -> np.ndarray:
        """δ, (count,)."""
        return self._fixed[:, 2] + self._gradient[:, 2] @ p

    def curvature(self, p: np.ndarray) -> np.ndarray:
        """r, signed, at the inner samples, (count − 2,)."""
        return _ratio(self._triples(p, slice(None)))[0]

    def curvature_gradient(self, p: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """∂r/∂p at some of the inner samples, a mask (count − 2,), (chosen, size)."""
        moves = np.stack([self._gradient[k : len(self.t) - 2 + k, :2][chosen] for k in range(3)], axis=1)
        return np.einsum("nkc,nkcp->np", _ratio(self._triples(p, chosen))[1], moves)

    def _triples(self, p: np.ndarray, chosen: np.ndarray | slice) -> np.ndarray:
        """Three consecutive points around the chosen inner samples, (chosen, 3, 2)."""
        points = self._fixed[:, :2] + self._gradient[:, :2] @ p
        return np.stack([points[k : len(points) - 2 + k][chosen] for k in range(3)], axis=1)


def _ratio(triples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """r (n,) of triples of points (n, 3, 2), and ∂r/∂points (n, 3, 2)."""
    numbers = _compiled()(*triples.reshape(-1, 6).T)
    values, *partial = (np.broadcast_to(n, len(triples)) for n in numbers)
    return values, np.stack(partial, axis=1).reshape(-1, 3, 2)


@cache
def _compiled():
    """r and its gradient, derived symbolically (x0, x1, … are names that cse takes)."""
    coordinates = sympy.symbols("px py qx qy sx sy", real=True)
    p, q, s = (sympy.Matrix(coordinates[k : k + 2]) for k in (0, 2, 4))
    a, b = q - p, s - q
    lengths = [sympy.sqrt(v.dot(v)) for v in (a, b, a + b)]
    cross = a[0] * b[1] - a[1] * b[0]
    signed = (lengths[0] + lengths[1]) * cross / (lengths[0] * lengths[1] * lengths[2])
    expressions = [signed, *(sympy.diff(signed, c) for c in coordinates)]
    return sympy.lambdify(coordinates, expressions, "numpy", cse=True)
