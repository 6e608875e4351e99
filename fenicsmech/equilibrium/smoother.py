"""Chebyshev smoother: a polynomial of the stiffness of free nodes that damps what varies from node to node.

With D the 3 × 3 (2 × 2 in the plane) diagonal blocks of A and λ the largest eigenvalue of D⁻¹A,

    S = q(D⁻¹A) D⁻¹,     1 − t q(t) = T_m((θ − t)/δ) / T_m(θ/δ),     θ, δ = (b ± a)/2,  a = ratio · b,  b ≥ λ:

errors with eigenvalues in [a, b] shrink alike. S is symmetric, positive definite even if A is not, and the same on any
number of processes. Source: Adams et al. (doi:10.1016/S0021-9991(03)00194-3).
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

_SAFETY = 1.3  # on the estimate of λ, which is one from below: single bad cells are seen late
_FIRST, _AGAIN = 40, 3  # power iterations for the first matrix, and for those after it


class Chebyshev:
    """S for one matrix after another of the same pattern.

    Args:
        degree: m, products with A that one application takes, plus one.
        ratio: a/b.
    """

    def __init__(self, *, degree: int, ratio: float) -> None:
        self._degree, self._ratio = degree, ratio
        self._mode: PETSc.Vec | None = None
        self._work: tuple[PETSc.Vec, ...] | None = None
        self._blocks: PETSc.PC | None = None

    def update(self, matrix: PETSc.Mat) -> bool:
        """Takes A, of square blocks; whether its diagonal blocks can be inverted (collective)."""
        self._matrix = matrix
        if self._work is None:
            self._work = tuple(matrix.createVecLeft() for _ in range(3))
        if self._blocks is not None:
            self._blocks.destroy()
        self._blocks = PETSc.PC().create(matrix.comm)
        self._blocks.setType("pbjacobi")
        self._blocks.setOperators(matrix)
        self._blocks.setUp()
        self._b = _SAFETY * self._largest()
        return bool(np.isfinite(self._b) and self._b > 0.0)

    def apply(self, r: PETSc.Vec, x: PETSc.Vec) -> None:
        """x = S r (collective)."""
        a = self._ratio * self._b
        centre, half = 0.5 * (self._b + a), 0.5 * (self._b - a)
        residual, step, damped = self._work
        r.copy(residual)
        self._blocks.apply(residual, step)
        step.scale(1.0 / centre)
        step.copy(x)
        rho = half / centre
        for _ in range(self._degree - 1):
            self._matrix.mult(step, damped)
            residual.axpy(-1.0, damped)
            self._blocks.apply(residual, damped)
            following = 1.0 / (2.0 * centre / half - rho)
            step.axpby(2.0 * following / half, following * rho, damped)
            x.axpy(1.0, step)
            rho = following

    def _largest(self) -> float:
        """λ by power iteration, from where the last one ended."""
        count = _AGAIN
        if self._mode is None:
            count = _FIRST
            self._mode = self._matrix.createVecRight()
            self._mode.array_w[:] = np.random.default_rng(self._matrix.comm.rank).standard_normal(
                self._mode.getLocalSize()
            )
            self._mode.normalize()
        product, largest = self._work[0], np.nan
        for _ in range(count):
            self._matrix.mult(self._mode, product)
            self._blocks.apply(product, self._mode)
            largest = self._mode.normalize()
        return largest
