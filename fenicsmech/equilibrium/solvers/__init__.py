"""Solvers beside the default one, to choose and to compare.

- ``augmented_lagrangian``: minimisation of augmented Lagrangians, multipliers updated between
- ``kkt_newton``: Newton's method on the KKT equations, nothing else
- ``snes``: PETSc's nonlinear solvers on the same equations
"""

from fenicsmech.equilibrium.solvers.augmented_lagrangian import AugmentedLagrangian
from fenicsmech.equilibrium.solvers.kkt_newton import KktNewton
from fenicsmech.equilibrium.solvers.snes import Globalisation, Snes

__all__ = ["AugmentedLagrangian", "Globalisation", "KktNewton", "Snes"]
