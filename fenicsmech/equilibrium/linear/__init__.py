"""Linear solvers of the KKT matrix: a factor with inertia (``direct``), conjugate gradients on it (``two_level``)."""

from fenicsmech.equilibrium.linear.direct import Direct, Factor, Inertia, LinearMethod, LinearSolver
from fenicsmech.equilibrium.linear.two_level import BySize, TwoLevel, TwoLevelSolver

__all__ = ["BySize", "Direct", "Factor", "Inertia", "LinearMethod", "LinearSolver", "TwoLevel", "TwoLevelSolver"]
