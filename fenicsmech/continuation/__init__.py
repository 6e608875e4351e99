"""Continuation of paths of equilibria: prediction, correction by an equilibrium solver, step control.

- ``stepper``: a step along a path: prediction, correction, acceptance
- ``load_steps``: natural continuation
- ``dead_centre``: likewise past dead centres, of motors and constant loads
- ``arc_length``: arc-length continuation, past limit points and folds
- ``critical``: limit points, turning points and bifurcations, and the paths that cross there
- ``eigen``: the softest modes of a KKT matrix, and buckling loads
"""

from fenicsmech.continuation.arc_length import (
    ArcLengthStepper,
    ArcSteps,
    Finish,
    equilibrium_at,
    follow_to,
    linear_reach,
)
from fenicsmech.continuation.critical import Critical, CriticalPoint, Sense, crossing, locate, null_space
from fenicsmech.continuation.dead_centre import DeadCentreStepper
from fenicsmech.continuation.eigen import Mode, critical_changes, softest_modes
from fenicsmech.continuation.load_steps import LeastShifts, LoadStepper, LoadSteps, LoadStepsFailed
from fenicsmech.continuation.stepper import ConstantPredictor, HermitePredictor, Predictor, TangentPredictor
