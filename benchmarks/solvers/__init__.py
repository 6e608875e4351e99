"""Other methods for equilibria, to compare the default one with: they implement ``EquilibriumMethod`` from outside.

- ``augmented_lagrangian``: the method of the paper, by Nocedal and Wright
- ``kkt_newton``: Newton's method on the KKT equations, nothing else
- ``snes``: the same with PETSc's line searches and trust region
"""

from .augmented_lagrangian import AugmentedLagrangian
from .kkt_newton import KKTNewton
from .snes import SNES, Globalisation
