"""Estimates of the errors of elements and of plane stress, and the fidelity chosen by them.

- ``estimates``: goal-oriented error estimates at equilibria
- ``element_error``: of elements, by ``recovery`` of gradients
- ``plane_stress_error``: of plane stress
- ``accuracy_control``: the cheapest fidelity whose estimated error is small enough
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
from fenicsmech.estimates.estimates import Calibration, Equilibrium, ErrorKind, Estimates, adjoint_at
from fenicsmech.estimates.recovery import PressureError, Recovery

__all__ = [
    "AccuracyControl",
    "AccuracyOptions",
    "Calibration",
    "Choice",
    "Equilibrium",
    "ErrorKind",
    "Estimates",
    "FidelityLevel",
    "LevelErrors",
    "PressureError",
    "Recovery",
    "Trial",
    "adjoint_at",
    "fidelity_levels",
]
