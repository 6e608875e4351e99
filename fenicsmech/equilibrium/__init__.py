"""Equilibria of a mechanism: elements and joints meet here.

- ``state``, ``fields``: displacements, poses, multipliers; the finite-element fields that hold them
- ``load``, ``loads``, ``potentials``: point loads, and what depends on poses of bodies
- ``control``: what is led along a path: a force, a displacement, motors
- ``layout``, ``unknowns``: where each unknown stands, and the change of state it stands for
- ``extras``, ``matrices``, ``entry_copy``, ``kkt``: the distributed KKT matrix
- ``system``: energy, residual and KKT matrix at a state
- ``factor``: LDLᵀ with inertia
- ``coarse``, ``smoother``, ``two_level``: conjugate gradients where the factor is too large
- ``linear``: which of the two solves, and by what rule
- ``solver``: what every equilibrium solver is
- ``newton``: the default one, the primal–dual iteration
- ``predictor``, ``path``: first guesses and load steps
- ``dead_centre``: those of motors past the end of their slack
- ``lead``: what leads a path that may turn back: a force, or motors
- ``arc_metric``, ``path_points``: the equilibria of such a path
- ``arc_length``, ``continuation``: steps along it, and where it ends
- ``critical``, ``soft_mode``, ``branching``: their limit points and bifurcations, and the paths that cross there
- ``eigen``: the softest modes of a tangent, and buckling loads
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.arc_length import ArcLength, ArcSteps
from fenicsmech.equilibrium.arc_metric import ArcMetric, metric_at
from fenicsmech.equilibrium.branching import Sense, crossing, null_space
from fenicsmech.equilibrium.continuation import Finish, Stretch, follow
from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl, ShareControl
from fenicsmech.equilibrium.critical import Critical, CriticalPoint
from fenicsmech.equilibrium.dead_centre import MotorPath
from fenicsmech.equilibrium.eigen import Mode, critical_changes, softest_modes
from fenicsmech.equilibrium.entry_copy import EntryCopy
from fenicsmech.equilibrium.extras import REGULARISATION
from fenicsmech.equilibrium.factor import Factor
from fenicsmech.equilibrium.fields import load_fields
from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.lead import ForceLead, Heading, Lead, MotorLead
from fenicsmech.equilibrium.linear import BySize, Direct, LinearMethod, LinearSolver, TwoLevel
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.newton import Newton, PrimalDualNewton
from fenicsmech.equilibrium.path import ZERO_ENERGY_SHIFT, Path, PathFailed
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.predictor import Constant, Hermite, Predictor, Tangent
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.solver import EquilibriumSolver, Iteration, Linearisation, NotConverged, Solution
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.equilibrium.two_level import TwoLevelSolver

__all__ = [
    "ArcLength",
    "ArcMetric",
    "ArcSteps",
    "BySize",
    "Constant",
    "Control",
    "Critical",
    "CriticalPoint",
    "Direct",
    "DisplacementControl",
    "EntryCopy",
    "EquilibriumSolver",
    "EquilibriumSystem",
    "Factor",
    "Finish",
    "ForceLead",
    "Heading",
    "Hermite",
    "Iteration",
    "KktMatrix",
    "Lead",
    "LinearMethod",
    "Linearisation",
    "LinearSolver",
    "LoadControl",
    "Mode",
    "MotorControl",
    "MotorLead",
    "MotorPath",
    "Newton",
    "NotConverged",
    "Path",
    "PathFailed",
    "PathPoint",
    "PathPoints",
    "PointLoad",
    "Predictor",
    "PrimalDualNewton",
    "REGULARISATION",
    "Reaction",
    "Residual",
    "Sense",
    "ShareControl",
    "Solution",
    "State",
    "Step",
    "Stretch",
    "Tangent",
    "TwoLevel",
    "TwoLevelSolver",
    "ZERO_ENERGY_SHIFT",
    "critical_changes",
    "crossing",
    "follow",
    "joint_reactions",
    "load_fields",
    "metric_at",
    "motor_torques",
    "null_space",
    "softest_modes",
]
