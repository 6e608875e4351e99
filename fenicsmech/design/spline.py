"""Cubic Hermite splines of links: centreline (x, y) and local thickness δ as functions of design parameters.

With control points C_k (position P_k and tangent M_k, three components each) and t = k + τ, 0 ≤ τ ≤ 1,

    (x, y, δ)(p, t) = h₀₀(τ) P_k + h₁₀(τ) M_k + h₀₁(τ) P_{k+1} + h₁₁(τ) M_{k+1}.

The parameters p are the tangents at joints, and position and tangent at all other control points: a joint stays where
it is and keeps its thickness. The curve is linear in p.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyder

# rows: powers of τ in h₀₀ (P_k), h₁₀ (M_k), h₀₁ (P_{k+1}), h₁₁ (M_{k+1})
_HERMITE = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
_DERIVATIVES = [polyder(_HERMITE, order, axis=1) for order in range(5)]


@dataclass(frozen=True, eq=False)
class LinkSpline:
    """The spline of one link.

    Attributes:
        controls: initial control points, (n, 2, 3): position and tangent, each (x, y, δ).
        is_joint: which control points are joints, (n,).
    """

    controls: np.ndarray
    is_joint: np.ndarray

    @property
    def segments(self) -> int:
        """Number of cubic segments; t runs from 0 to this."""
        return len(self.controls) - 1

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.entries)

    @cached_property
    def entries(self) -> np.ndarray:
        """Which of ``controls.ravel()`` the parameters are, (size,)."""
        free = np.ones(self.controls.shape, dtype=bool)
        free[self.is_joint, 0] = False
        return np.flatnonzero(free)

    @property
    def initial(self) -> np.ndarray:
        """Initial parameters, (size,)."""
        return self.controls.ravel()[self.entries]

    @property
    def is_thickness(self) -> np.ndarray:
        """Which parameters belong to δ; the others are lengths, (size,)."""
        return self.entries % 3 == 2

    def controls_at(self, p: np.ndarray) -> np.ndarray:
        """The control points for parameters ``p`` (size,), (n, 2, 3)."""
        controls = self.controls.copy()
        controls.ravel()[self.entries] = p
        return controls

    def evaluate(self, p: np.ndarray, t: np.ndarray) -> np.ndarray:
        """(x, y, δ) at ``t`` (m,), (m, 3)."""
        return self.basis(t) @ self.controls_at(p).reshape(-1, 3)

    def derivative(self, p: np.ndarray, t: np.ndarray) -> np.ndarray:
        """d(x, y, δ)/dt at ``t`` (m,), (m, 3); at a control point both segments agree."""
        return self.basis(t, order=1) @ self.controls_at(p).reshape(-1, 3)

    def gradient(self, t: np.ndarray, *, order: int = 0, segments: np.ndarray | None = None) -> np.ndarray:
        """∂/∂p of (x, y, δ), differentiated ``order`` times by t, at ``t`` (m,), (m, 3, size); the same for all p."""
        rows, component = np.divmod(self.entries, 3)
        gradient = np.zeros((len(t), 3, self.size))
        gradient[:, component, np.arange(self.size)] = self.basis(t, order=order, segments=segments)[:, rows]
        return gradient

    def segments_of(self, t: np.ndarray) -> np.ndarray:
        """The segment of each ``t`` (m,), the later one at a control point, (m,)."""
        return np.clip(np.floor(t).astype(int), 0, self.segments - 1)

    def basis(self, t: np.ndarray, *, order: int = 0, segments: np.ndarray | None = None) -> np.ndarray:
        """Weights of P_0, M_0, P_1, M_1, … in the curve, differentiated ``order`` times by t, at ``t`` (m,), (m, 2n).

        segments: the segment of each t; tells at a control point which of the two cubics is meant.
        """
        segments = self.segments_of(t) if segments is None else segments
        weights = np.zeros((len(t), 2 * len(self.controls)))
        columns = 2 * segments[:, None] + np.arange(4)
        coefficients = _DERIVATIVES[order]
        powers = (t - segments)[:, None] ** np.arange(coefficients.shape[1])
        weights[np.arange(len(t))[:, None], columns] = powers @ coefficients.T
        return weights
