"""Adjoints of displacements and forces at an equilibrium.

The equilibrium y solves F(y, p) = Gᵀ ∇L = 0. With the KKT matrix K = ∂F/∂y, the adjoint x of a quantity Q solves

    K x = ∂Q/∂y,     dQ/dp = −xᵀ ∂F/∂p

for any parameter p. Q is the travel a · u_P of a material point, or the controlled force f, which is one of the
unknowns y; the control stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.border import PointLoad
from fenicsmech.equilibrium.solver import Linearisation


class Quantity(Enum):
    """The unknown of a load–displacement curve: a displacement under a prescribed force, or the other way round."""

    DISPLACEMENT = "displacement"
    FORCE = "force"


@dataclass(frozen=True, eq=False)
class Adjoint:
    """The adjoint of one quantity.

    Attributes:
        x: in the scaled unknowns of the system.
        nodal: ∂u/∂y x, so that forces δF on the links change Q by nodal · δF: this rank's owned values at the nodes of
            u, and of pressures behind them, flat.
        poses: ∂z/∂y x of the bodies' poses z, (size,).
    """

    x: PETSc.Vec
    nodal: np.ndarray
    poses: np.ndarray

    @staticmethod
    def of_travel(at: Linearisation, load: PointLoad) -> Adjoint:
        """The adjoint of the travel of a load's point."""
        return Adjoint._of(at, at.solve(at.travel_gradient(load)))

    @staticmethod
    def of_force(at: Linearisation) -> Adjoint:
        """The adjoint of the controlled force under displacement control."""
        # ∂f/∂y is the right-hand side of the rate with the prescribed displacement, but for its sign
        x = at.rate()
        x.scale(-1.0)
        return Adjoint._of(at, x)

    @staticmethod
    def _of(at: Linearisation, x: PETSc.Vec) -> Adjoint:
        return Adjoint(x, at.displacements(x), at.step(x).z)
