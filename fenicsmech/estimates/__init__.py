"""Estimates of the errors of elements and of plane stress, and the fidelity chosen by them.

- ``estimates``: goal-oriented error estimates at equilibria, of elements and of plane stress
- ``accuracy_control``: the cheapest fidelity whose estimated error is small enough
- ``doubts``: reasons why an estimate may be off by more than a factor of two
- ``point_forces``: forces at points, whose displacement has no limit as elements shrink
"""

from fenicsmech.estimates.accuracy_control import (
    AccuracyControl,
    AccuracyOptions,
    Choice,
    FidelityLevel,
    LevelErrors,
    Trial,
    fidelity_levels,
)
from fenicsmech.estimates.doubts import ROUNDED, DoubtOptions, Origin, examined
from fenicsmech.estimates.estimates import (
    Calibration,
    Equilibrium,
    ErrorKind,
    Estimates,
    PressureError,
    Recovery,
    adjoint_at,
    check_plane_stress,
)
from fenicsmech.estimates.point_forces import cause_of_growth, growth_by_halving
