"""Linear systems with the KKT matrix: its factor with inertia (``direct``), or conjugate gradients on two levels where
that is too large (``two_level``)."""

from fenicsmech.equilibrium.linear.direct import Direct, Factor, Inertia, LinearMethod, LinearSolver
from fenicsmech.equilibrium.linear.two_level import BySize, TwoLevel, TwoLevelSolver

__all__ = ["BySize", "Direct", "Factor", "Inertia", "LinearMethod", "LinearSolver", "TwoLevel", "TwoLevelSolver"]
