"""The KKT system without a factor of it: conjugate gradients between linear and higher-order displacements.

P holds the linear displacements and all poses, multipliers and forces, KKT₁ = Pᵀ KKT P is factored. What is left,

    W = {x : Pᵀ KKT x = 0},     In(KKT) = In(KKT₁) + In(KKT on W),

holds every constraint exactly, has no multipliers, and KKT is positive definite on it but for modes that linear
elements are too stiff to show. Conjugate gradients stay in W if the smoother S is followed by the coarse correction:

    x ← P KKT₁⁻¹ Pᵀ b,     then with the preconditioner  (I − P KKT₁⁻¹ Pᵀ KKT) S.

Their directions p are conjugate, so that the number of negative pᵀ KKT p is that of the negative eigenvalues they have
met. For the inertia they start from random vectors, until one meets none in the complement of those found: what was
found is certain, that there is no more is as likely as the iteration has converged.

Sources: Tang, Nabben, Vuik & Erlangga on the preconditioner, A-DEF2 (doi:10.1007/s10915-009-9272-6); Haynsworth
(doi:10.1016/0024-3795(68)90050-5) on the inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.coarse import CoarseLevel
from fenicsmech.equilibrium.factor import Inertia
from fenicsmech.equilibrium.smoother import Chebyshev
from fenicsmech.equilibrium.system import EquilibriumSystem
from fenicsmech.log import logger

_log = logger(__name__)
_DEGREE, _RATIO = 8, 0.03  # of the smoother (measured)
_MOST = 300  # iterations
_SEEN = 1e-6  # how far a random start is followed for the inertia
_ROUNDOFF = 1e-15  # of the solution, in units of the mean stiffness


class Stalled(Exception):
    """Conjugate gradients did not converge."""


@dataclass(frozen=True)
class Direction:
    """p with KKT p and pᵀ KKT p."""

    p: PETSc.Vec
    image: PETSc.Vec
    curvature: float


class TwoLevelSolver:
    """Solves with the KKT matrix of ``system`` and tells its inertia; all methods are collective.

    Args:
        system: with displacements of order 2 or more.
        matrix: its KKT matrix; refactor after changing its values.
        tolerance: of the energy norm of the error, relative.

    Attributes:
        iterations: of each solve so far.
        probes: iterations spent on each inertia so far.
    """

    def __init__(self, system: EquilibriumSystem, matrix: PETSc.Mat, *, tolerance: float) -> None:
        self._matrix, self._tolerance = matrix, tolerance
        self._coarse = CoarseLevel(system, matrix)
        self._smoother = Chebyshev(degree=_DEGREE, ratio=_RATIO)
        layout = system.layout
        self._free = PETSc.IS().createStride(len(layout.free), layout.first_unknown, 1, comm=matrix.comm)
        self._free.setBlockSize(system.joints.space.dim)
        self._links: PETSc.Mat | None = None
        self._work = matrix.createVecLeft()
        self.iterations: list[int] = []
        self.probes: list[int] = []

    def refactor(self) -> bool:
        """Takes the matrix's current values; whether that could be done."""
        self._links = self._matrix.createSubMatrix(self._free, self._free, self._links)
        self._nodal = self._links.createVecs()
        return self._smoother.update(self._links) and self._coarse.update()

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solves with the matrix last refactored.

        Raises:
            Stalled: too many iterations.
        """
        self._coarse.correction(right, solution)
        residual = right - self._matrix * solution
        self._descend(residual, solution, self._tolerance)
        self._coarse.correction(right - self._matrix * solution, self._work)
        solution.axpy(1.0, self._work)

    def inertia(self) -> Inertia:
        """Of the matrix last refactored."""
        coarse = self._coarse.inertia()
        found: list[Direction] = []
        spent = 0
        while True:
            direction, iterations = self._probe(found)
            spent += iterations
            if direction is None:
                break
            found.append(direction)
        self.probes.append(spent)
        _log.debug("inertia: %d negative on the coarse level, %d more", coarse.negative, len(found))
        return Inertia(coarse.negative + len(found), coarse.zero)

    def _descend(self, r: PETSc.Vec, x: PETSc.Vec, tolerance: float) -> None:
        """Adds KKT⁻¹ r to x for a residual r of which Pᵀ r = 0."""
        floor = _ROUNDOFF * x.norm()
        p = q = None
        before = first = 0.0
        for iteration in range(_MOST):
            z, image = self._preconditioned(r, ())
            energy = r.dot(z)
            first = first or energy
            if abs(energy) <= max(tolerance**2 * abs(first), floor**2):
                self.iterations.append(iteration)
                return
            p, q = (z, image) if p is None else (z + p * (energy / before), image + q * (energy / before))
            length = energy / p.dot(q)
            x.axpy(length, p)
            r.axpy(-length, q)
            before = energy
        raise Stalled(f"conjugate gradients did not converge in {_MOST} iterations")

    def _probe(self, found: list[Direction]) -> tuple[Direction | None, int]:
        """A direction of negative curvature conjugate to those ``found``, None if there seems to be none."""
        r = self._random()
        self._coarse.correction(r, self._work)
        r -= self._matrix * self._work
        for known in found:
            r.axpy(-known.p.dot(r) / known.curvature, known.image)
        p = q = None
        before = first = 0.0
        for iteration in range(_MOST):
            z, image = self._preconditioned(r, found)
            energy = r.dot(z)
            first = first or energy
            if abs(energy) <= _SEEN**2 * abs(first):
                return None, iteration
            p, q = (z, image) if p is None else (z + p * (energy / before), image + q * (energy / before))
            curvature = p.dot(q)
            if curvature < 0.0:
                return Direction(p, q, curvature), iteration
            r.axpy(-energy / curvature, q)
            before = energy
        raise Stalled(f"the inertia is not known after {_MOST} iterations")

    def _preconditioned(self, r: PETSc.Vec, found) -> tuple[PETSc.Vec, PETSc.Vec]:
        """z = S r, conjugate to P and to the directions ``found``, and KKT z."""
        rough, smooth = self._nodal
        rough.array_w[:] = r.array_r[: rough.getLocalSize()]
        self._smoother.apply(rough, smooth)
        z = r.duplicate()
        z.set(0.0)
        z.array_w[: smooth.getLocalSize()] = smooth.array_r
        self._coarse.correction(self._matrix * z, self._work)
        z -= self._work
        image = self._matrix * z
        for known in found:
            share = -known.image.dot(z) / known.curvature
            z.axpy(share, known.p)
            image.axpy(share, known.image)
        return z, image

    def _random(self) -> PETSc.Vec:
        """A random vector of forces on free nodes."""
        vector = self._matrix.createVecLeft()
        vector.set(0.0)
        count = self._nodal[0].getLocalSize()
        vector.array_w[:count] = np.random.default_rng(self._matrix.comm.rank).standard_normal(count)
        return vector
