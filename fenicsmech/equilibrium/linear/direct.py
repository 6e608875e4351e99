"""Symmetric indefinite factorisation LDLᵀ of the KKT matrix, with its inertia, and the interface of linear solvers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from petsc4py import PETSc

from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.system import EquilibriumSystem


@dataclass(frozen=True)
class Inertia:
    """Numbers of negative and zero pivots: Sylvester's law makes them those of the eigenvalues."""

    negative: int
    zero: int


class LinearSolver(ABC):
    """Solves with a matrix whose values change and whose pattern does not."""

    @abstractmethod
    def refactor(self) -> bool:
        """Factors the matrix's current values; whether this succeeded."""

    @abstractmethod
    def inertia(self) -> Inertia:
        """Inertia of the matrix last refactored."""

    @abstractmethod
    def known_inertia(self) -> Inertia:
        """Lower bound of the inertia, known from the last ``solve``."""

    @abstractmethod
    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> bool:
        """Solves with the matrix last refactored, to a relative error of ``tolerance``; whether this succeeded."""

    @abstractmethod
    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> Inertia | None:
        """``solve`` and ``inertia`` at hardly more than the cost of one; None if the solve failed."""


class LinearMethod(ABC):
    """A method for linear systems."""

    @abstractmethod
    def solver(self, system: EquilibriumSystem) -> LinearSolver:
        """The solver for the KKT matrix of ``system``, linearised once at least, shifted and softened."""


@dataclass(frozen=True)
class Direct(LinearMethod):
    """The factor LDLᵀ of the whole matrix: fastest up to some 80,000 unknowns on slender links."""

    def solver(self, system):
        return _KktFactor(system.kkt)


_MUMPS = {
    7: 2,  # ordering AMF: fewest operations on slender links (Debian's MUMPS has neither METIS nor SCOTCH)
    12: 2,  # order the graph compressed by likely 2 × 2 pivots
    13: 1,  # root front factored by one process: exact inertia in parallel
    14: 60,  # per cent of workspace beyond the estimate, for delayed pivots
    24: 1,  # detect null pivots instead of failing on them
}
"""Controls ICNTL of MUMPS that differ from its own defaults."""


class Factor(LinearSolver):
    """MUMPS LDLᵀ of a matrix whose pattern does not change: the symbolic analysis is reused.

    Args:
        matrix: the matrix; refactor after changing its values.
    """

    def __init__(self, matrix: PETSc.Mat) -> None:
        self._matrix, self._fresh = matrix, True
        self._analyse()

    def refactor(self) -> bool:
        """Factors the matrix's current values; whether this succeeded."""
        done = self._numeric()
        if not self._fresh and not (done and self.inertia().zero == 0):
            # the analysis pairs unknowns by their present values: in later ones a pair may be zero, the matrix regular
            self._solver.destroy()
            self._analyse()
            done = self._numeric()
        self._fresh = False
        return done

    def _analyse(self) -> None:
        """A new solver, which orders and pairs the unknowns by the first values it factors."""
        # the only way that reaches all of MUMPS's controls, the ordering among them
        prefix = "fenicsmech_kkt_"
        options = PETSc.Options(prefix)
        for number, value in _MUMPS.items():
            options[f"mat_mumps_icntl_{number}"] = value
        self._solver = PETSc.KSP().create(self._matrix.comm)
        self._solver.setOptionsPrefix(prefix)
        self._solver.setType(PETSc.KSP.Type.PREONLY)
        self._solver.setOperators(self._matrix)
        pc = self._solver.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        self._solver.setFromOptions()
        self._fresh = True

    def _numeric(self) -> bool:
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        for _ in range(4):
            self._solver.setOperators(self._matrix)
            self._solver.getPC().setUp()
            mumps = self._solver.getPC().getFactorMatrix()
            status = mumps.getMumpsInfog(1)
            if status >= 0:
                return True
            if status not in (-8, -9):  # the integer or real workspace is too small
                return False
            mumps.setMumpsIcntl(14, 2 * mumps.getMumpsIcntl(14))
            self._matrix.stateIncrease()  # marks the values as new
        return False

    def inertia(self) -> Inertia:
        """Inertia of the matrix last factored."""
        mumps = self._solver.getPC().getFactorMatrix()
        return Inertia(mumps.getMumpsInfog(12), mumps.getMumpsInfog(28))

    def known_inertia(self) -> Inertia:
        """The same: a factor gives the exact inertia."""
        return self.inertia()

    @property
    def memory(self) -> float:
        """Bytes the factorisation took, on all ranks."""
        return 1e6 * self._solver.getPC().getFactorMatrix().getMumpsInfog(22)

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float = 0.0) -> bool:
        """Solves with the last factor, always to roundoff."""
        self._solver.solve(right, solution)
        return True

    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float = 0.0) -> Inertia:
        """``solve``, and the ``inertia`` of the factor."""
        self.solve(right, solution, tolerance)
        return self.inertia()


class _KktFactor(Factor):
    """The factor of the whole KKT matrix, formed on demand."""

    def __init__(self, kkt: KktMatrix) -> None:
        self._kkt = kkt
        super().__init__(kkt.matrix())

    def refactor(self):
        self._kkt.matrix()
        return super().refactor()
