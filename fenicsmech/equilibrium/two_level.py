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

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.coarse import CoarseLevel
from fenicsmech.equilibrium.factor import Inertia
from fenicsmech.equilibrium.smoother import Chebyshev
from fenicsmech.equilibrium.system import EquilibriumSystem

_DEGREE, _RATIO = 8, 0.03  # of the smoother (measured)
_MOST = 300  # iterations
_SEEN = 1e-6  # how far a random start is followed for the inertia
_ROUNDOFF = 1e-15  # of the solution, in units of the mean stiffness


@dataclass(frozen=True)
class Direction:
    """p with KKT p and pᵀ KKT p."""

    p: PETSc.Vec
    image: PETSc.Vec
    curvature: float


class TwoLevelSolver:
    """Solves with the KKT matrix of ``system`` and tells its inertia; all methods are collective.

    Args:
        system: with displacements of order 2 or more; refactor after changing its KKT matrix.

    Attributes:
        iterations: of each solve so far.
        probes: iterations spent on each inertia so far.
    """

    def __init__(self, system: EquilibriumSystem) -> None:
        self._coarse = CoarseLevel(system)
        self._smoother = Chebyshev(degree=_DEGREE, ratio=_RATIO)
        layout = system.layout
        self._free = PETSc.IS().createStride(len(layout.free), layout.first_unknown, 1, comm=layout.comm)
        extras = layout.extras if layout.last else 0
        self._extra = PETSc.IS().createStride(extras, layout.first_extra, 1, comm=layout.comm)
        self._system = system
        self._stiffness: PETSc.Mat | None = None
        self._border: PETSc.Mat | None = None
        self._corner: PETSc.Mat | None = None
        # petsc4py destroys what it creates late: nothing is created per iteration
        self._work, self._residual, self._z, self._image, self._p, self._q = (system.unknowns.zeros() for _ in range(6))
        self._nodal: tuple[PETSc.Vec, PETSc.Vec] | None = None
        self._met = 0
        self.iterations: list[int] = []
        self.probes: list[int] = []

    def refactor(self) -> bool:
        """Takes the KKT matrix's current values; whether that could be done."""
        if self._stiffness is not None:
            self._stiffness.destroy()
        self._stiffness = self._system.kkt.nodal_stiffness()
        columns = self._system.kkt.extra_columns()
        self._border = columns.createSubMatrix(self._free, None, self._border)
        self._corner = columns.createSubMatrix(self._extra, None, self._corner)
        if self._nodal is None:
            self._nodal, self._bordering = self._stiffness.createVecs(), self._corner.createVecs()
        return self._smoother.update(self._stiffness) and self._coarse.update()

    @property
    def memory(self) -> float:
        """Bytes of the factor of KKT₁ and of the blocked stiffness, on all ranks."""
        blocks = self._stiffness.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
        size = self._stiffness.getBlockSize() ** 2
        return self._coarse.memory + blocks * (8.0 + 4.0 / size)

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> bool:
        """Solves with the matrix last refactored; False if that takes too many iterations.

        Args:
            right: right-hand side.
            solution: where the solution goes.
            tolerance: of the energy norm of the error, relative to that of the error after one coarse correction.
        """
        self._start(right, solution)
        return self._iterate(solution, tolerance)

    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> Inertia | None:
        """``solve`` and ``inertia`` in one: a solve that starts from a random guess is a probe; None if not solved."""
        self._start(right, solution)
        error = abs(self._smooth(self._residual))
        self._randomise(self._work)
        self._smooth(self._work)
        self._project(())
        curvature = self._z.dot(self._image)
        if curvature > 0.0:
            # as much of it as of the error there is, in energy
            share = math.sqrt(error / curvature)
            solution.axpy(share, self._z)
            self._residual.axpy(-share, self._image)
        if not self._iterate(solution, min(tolerance, _SEEN)):
            return None
        return self.inertia() if self._met or curvature <= 0.0 else self._coarse.inertia()

    def _start(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """P KKT₁⁻¹ Pᵀ b and its residual."""
        self._coarse.correction(right, solution)
        self._multiply(solution, self._residual)
        self._residual.aypx(-1.0, right)

    def _iterate(self, solution: PETSc.Vec, tolerance: float) -> bool:
        """Conjugate gradients from a ``solution`` with its residual; whether they reach the ``tolerance``."""
        floor, iterations, self._met = _ROUNDOFF * solution.norm(), 0, 0
        for energy, direction in self._conjugate(self._residual, tolerance, floor=floor):
            if iterations == _MOST:
                return False
            iterations += 1
            solution.axpy(energy / direction.curvature, direction.p)
            # later ones may be copies of the first: long recurrences forget what they were conjugate to
            self._met = max(self._met, int(direction.curvature < 0.0))
        self.iterations.append(iterations)
        return True

    def known_inertia(self) -> Inertia:
        """What is certain after the last solve: the coarse level's, and one more if it met a negative curvature."""
        coarse = self._coarse.inertia()
        return Inertia(coarse.negative + self._met, coarse.zero)

    def inertia(self) -> Inertia:
        """Of the matrix last refactored."""
        coarse, found, spent = self._coarse.inertia(), [], 0
        while True:
            direction, iterations = self._probe(found)
            spent += iterations
            if direction is None:
                break
            found.append(direction)
        self.probes.append(spent)
        return Inertia(coarse.negative + len(found), coarse.zero)

    def _probe(self, found: list[Direction]) -> tuple[Direction | None, int]:
        """A direction of negative curvature conjugate to those ``found``, None if there seems to be none."""
        r, iterations = self._residual, 0
        self._randomise(r)
        self._coarse.correction(r, self._work)
        self._multiply(self._work, self._image)
        r.axpy(-1.0, self._image)
        for known in found:
            r.axpy(-known.p.dot(r) / known.curvature, known.image)
        for iterations, (_, direction) in zip(range(_MOST), self._conjugate(r, _SEEN, found), strict=False):
            if direction.curvature < 0.0:
                return Direction(direction.p.copy(), direction.image.copy(), direction.curvature), iterations
        return None, iterations

    def _conjugate(
        self, r: PETSc.Vec, tolerance: float, found: Sequence[Direction] = (), *, floor: float = 0.0
    ) -> Iterator[tuple[float, Direction]]:
        """Conjugate directions for a residual r with Pᵀ r = 0: its energy rᵀ z, and where to go on.

        They end when the energy is ``floor``² or has fallen by ``tolerance``². One is good until the next is asked for.
        """
        z, image, p, q = self._z, self._image, self._p, self._q
        p.set(0.0)
        q.set(0.0)
        before, least = math.inf, floor**2
        # rᵀ S r is the same but for what rounding leaves in Pᵀ r: if that ends here, no projection is needed
        while not abs(self._smooth(r)) <= least:
            self._project(found)
            energy = r.dot(z)
            if before == math.inf:
                least = max(tolerance**2 * abs(energy), least)
            if abs(energy) <= least:
                break
            p.aypx(energy / before, z)
            q.aypx(energy / before, image)
            curvature = p.dot(q)
            yield energy, Direction(p, q, curvature)
            r.axpy(-energy / curvature, q)
            before = energy

    def _smooth(self, r: PETSc.Vec) -> float:
        """z = S r, and rᵀ z."""
        z = self._z
        rough, smooth = self._nodal
        count = rough.getLocalSize()
        rough.array_w[:] = r.array_r[:count]
        self._smoother.apply(rough, smooth)
        z.array_w[:count], z.array_w[count:] = smooth.array_r, 0.0
        return r.dot(z)

    def _project(self, found: Sequence[Direction]) -> None:
        """Makes z conjugate to P and to the directions ``found``, and its image KKT z."""
        z, image = self._z, self._image
        self._multiply(z, image)
        self._coarse.correction(image, self._work)
        z.axpy(-1.0, self._work)
        self._multiply(z, image)
        for known in found:
            share = -known.image.dot(z) / known.curvature
            z.axpy(share, known.p)
            image.axpy(share, known.image)

    def _multiply(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = KKT x by its blocks."""
        nodes, rows = self._nodal
        extras, sums = self._bordering
        count = nodes.getLocalSize()
        nodes.array_w[:], extras.array_w[:] = x.array_r[:count], x.array_r[count:]
        self._stiffness.mult(nodes, rows)
        self._border.multAdd(extras, rows, rows)
        self._corner.mult(extras, sums)
        self._border.multTransposeAdd(nodes, sums, sums)
        y.array_w[:count], y.array_w[count:] = rows.array_r, sums.array_r

    def _randomise(self, r: PETSc.Vec) -> None:
        """Makes r random forces on free nodes."""
        count = self._nodal[0].getLocalSize()
        r.array_w[:count] = np.random.default_rng(self._system.layout.comm.rank).standard_normal(count)
        r.array_w[count:] = 0.0
