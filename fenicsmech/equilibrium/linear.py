"""How linear systems with the KKT matrix are solved: by its factor, or on two levels where the factor is too large."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

from petsc4py import PETSc

from fenicsmech.equilibrium.factor import Factor, Inertia
from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.system import EquilibriumSystem
from fenicsmech.equilibrium.two_level import TwoLevelSolver
from fenicsmech.errors import DescriptionError


class LinearSolver(Protocol):
    """Solves with a system's KKT matrix, whose values change and whose pattern does not; all methods are collective."""

    def refactor(self) -> bool:
        """Takes the matrix as last linearised, shifted and softened; whether that could be done."""

    def inertia(self) -> Inertia:
        """Of the matrix last refactored."""

    def known_inertia(self) -> Inertia:
        """What the last ``solve`` has seen of it: no more than there is."""

    def solve(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> bool:
        """Solves with the matrix last refactored, to a relative error of ``tolerance``; whether that could be done."""

    def solve_and_count(self, right: PETSc.Vec, solution: PETSc.Vec, tolerance: float) -> Inertia | None:
        """``solve`` and ``inertia``, hardly dearer than one of them; None if it could not be solved."""


class LinearMethod(ABC):
    """A way to solve linear systems."""

    @abstractmethod
    def solver(self, system: EquilibriumSystem) -> LinearSolver:
        """The solver for the KKT matrix of ``system``, linearised once at least (collective)."""


class WholeFactor(Factor):
    """The factor of the whole KKT matrix."""

    def __init__(self, kkt: KktMatrix) -> None:
        self._kkt = kkt
        super().__init__(kkt.matrix())

    def refactor(self):
        self._kkt.matrix()  # formed only where it is asked for
        return super().refactor()


@dataclass(frozen=True)
class Direct(LinearMethod):
    """The factor LDLᵀ of the whole matrix: fastest up to some 80,000 unknowns on slender links."""

    def solver(self, system):
        return WholeFactor(system.kkt)


@dataclass(frozen=True)
class TwoLevel(LinearMethod):
    """Conjugate gradients over a factor for linear displacements, see ``two_level``."""

    @staticmethod
    def suits(system: EquilibriumSystem) -> bool:
        """Whether displacements have a level below them, all components of free nodes are unknown, pressures none."""
        return system.elastic.order > 1 and system.layout.whole_nodes

    def solver(self, system):
        if not self.suits(system):
            raise DescriptionError(
                "linear solver TwoLevel",
                "it needs displacements of order 2 or 3, all components of a node unknown, and no pressures",
                "Use order=2, or Direct()",
            )
        return TwoLevelSolver(system)


@dataclass(frozen=True)
class BySize(LinearMethod):
    """Two levels beyond so many unknowns, in space and where they suit; the factor otherwise.

    In the plane a factor costs little at any size. Where two levels do not suit (order 1, pressures of their own, the
    nodes of a mid-plane) the factor is all there is. In space, whole curves of a claw with their verdicts cost as much
    either way at 64,000 unknowns of order 2 and 110,000 of order 3; two levels take a third of the memory
    (demos/large.py).

    Attributes:
        limit: unknowns.
    """

    limit: int = 80_000

    def solver(self, system):
        large = system.layout.unknowns > self.limit and system.joints.space.dim == 3 and TwoLevel.suits(system)
        return (TwoLevel() if large else Direct()).solver(system)
