"""KKT systems of large links as in textbooks, for comparison: algebraic multigrid on the finite elements, the Schur
complement on bodies, joints and forces.

    KKT = [[K, Bᵀ], [B, C]],     S = C − B K⁻¹ Bᵀ,     S y = b_y − B K⁻¹ b_x,     K x = b_x − Bᵀ y

K is solved with by conjugate gradients, preconditioned by one cycle that knows the rigid motions as near-null space.
S is formed column by column: it is the stiffness of links that are free to move with their pins, a small
difference of two large terms.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium import EquilibriumSystem

EXACT, MOST = 1e-10, 1000  # of the energy norm of the error; iterations


class Multigrid(Enum):
    """The preconditioner, by the name its authors gave it, with its best options of those tried."""

    GAMG = "GAMG", {"pc_type": "gamg"}
    BOOMERAMG = (
        "BoomerAMG",
        {
            "pc_type": "hypre",
            "pc_hypre_type": "boomeramg",
            "pc_hypre_boomeramg_strong_threshold": 0.7,
            "pc_hypre_boomeramg_coarsen_type": "HMIS",
            "pc_hypre_boomeramg_interp_type": "ext+i",
            "pc_hypre_boomeramg_P_max": 4,
        },
    )

    def __init__(self, title: str, options: dict[str, object]) -> None:
        self.title, self.options = title, options


class SchurSolver:
    """Solves with the KKT ``matrix`` of ``system`` at its present values.

    Attributes:
        columns: of S that take a solve with K.
        iterations: of each solve with K.
    """

    def __init__(self, system: EquilibriumSystem, matrix: PETSc.Mat, multigrid: Multigrid) -> None:
        self._free, self._border = system.blocks.links.index_set(), system.blocks.border.index_set()
        self._b = matrix.createSubMatrix(self._border, self._free)
        self._c = matrix.createSubMatrix(self._border, self._border)
        k = matrix.createSubMatrix(self._free, self._free)
        k.setBlockSize(system.numbering.per_node)
        k.setNearNullSpace(rigid_motions(system))
        self._ksp = self._solver(k, multigrid)
        norms = self._columns_of_border()
        self.columns = np.flatnonzero(norms)
        self.iterations: list[int] = []
        self._s: np.ndarray | None = None

    def _solver(self, k: PETSc.Mat, multigrid: Multigrid) -> PETSc.KSP:
        prefix = f"schur_{multigrid.name.lower()}_"
        options = PETSc.Options(prefix)
        for name, value in multigrid.options.items():
            options[name] = value
        ksp = PETSc.KSP().create(k.comm)
        ksp.setOptionsPrefix(prefix)
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        ksp.setOperators(k)
        ksp.setFromOptions()
        return ksp

    def setup(self) -> None:
        """The hierarchy of grids."""
        self._ksp.setUp()

    def column(self, number: int, tolerance: float = EXACT) -> np.ndarray:
        """B K⁻¹ Bᵀ e, the costly part of a column of S, (border,) on all ranks."""
        unit = self._c.createVecRight()
        first, end = unit.getOwnershipRange()
        if first <= number < end:
            unit.setValue(number, 1.0)
        unit.assemble()
        right = self._b.createVecRight()
        self._b.multTranspose(unit, right)
        product = self._c.createVecLeft()
        self._b.mult(self.inverse(right, tolerance), product)
        return self._everywhere(product)

    def inverse(self, right: PETSc.Vec, tolerance: float = EXACT) -> PETSc.Vec:
        """K⁻¹ ``right``."""
        x = right.duplicate()
        self._ksp.setTolerances(rtol=tolerance, max_it=MOST)
        self._ksp.solve(right, x)
        self.iterations.append(self._ksp.getIterationNumber())
        return x

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """The solution, with S formed on the first call."""
        if self._s is None:
            self._s = self._dense(self._c)
            for number in self.columns:
                self._s[:, number] -= self.column(number)
        b_x, b_y = right.getSubVector(self._free), right.getSubVector(self._border)
        rest = self._c.createVecLeft()
        self._b.mult(self.inverse(b_x), rest)
        y = np.linalg.solve(self._s, self._everywhere(b_y) - self._everywhere(rest))
        first, end = rest.getOwnershipRange()
        rest.array_w[:] = y[first:end]
        lifted = b_x.duplicate()
        self._b.multTranspose(rest, lifted)
        lifted.aypx(-1.0, b_x)
        x = self.inverse(lifted)
        solution.array_w[: x.getLocalSize()] = x.array_r
        solution.array_w[x.getLocalSize() :] = rest.array_r
        right.restoreSubVector(self._free, b_x)
        right.restoreSubVector(self._border, b_y)

    def _columns_of_border(self) -> np.ndarray:
        """Largest entry of each row of B, (border,) on all ranks."""
        starts, _, values = self._b.getValuesCSR()
        norms = self._c.createVecLeft()
        norms.array_w[:] = [np.abs(values[a:b]).max(initial=0.0) for a, b in zip(starts, starts[1:], strict=False)]
        return self._everywhere(norms)

    def _dense(self, matrix: PETSc.Mat) -> np.ndarray:
        local = matrix.convert("dense", PETSc.Mat()).getDenseArray()
        return np.vstack(matrix.comm.tompi4py().allgather(np.array(local)))

    @staticmethod
    def _everywhere(vector: PETSc.Vec) -> np.ndarray:
        return np.concatenate(vector.comm.tompi4py().allgather(vector.array_r))


def rigid_motions(system: EquilibriumSystem) -> PETSc.NullSpace:
    """Translations and rotations of the free nodes where they are now."""
    numbering, u = system.numbering, system.elastic.u
    dim = numbering.per_node
    nodes = numbering.free[::dim] // dim
    drawn = u.function_space.tabulate_dof_coordinates()[nodes, :dim]
    moved = drawn + u.x.array.reshape(-1, dim)[nodes]
    positions = PETSc.Vec().createWithArray(moved.ravel(), bsize=dim, comm=system.comm)
    return PETSc.NullSpace().createRigidBody(positions)
