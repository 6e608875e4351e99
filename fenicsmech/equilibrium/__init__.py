"""Equilibria of a mechanism: elements and joints meet here.

- ``state``: displacements, poses, multipliers, controlled force
- ``control``: what is led along a path: a force, a displacement, motors
- ``blocks``, ``unknowns``: where each unknown stands, and the change of state it stands for
- ``border``: loads, potentials of poses and joints
- ``kkt``: the distributed KKT matrix
- ``system``: energy, residual and KKT matrix at a state
- ``linear``: its factor LDLᵀ with inertia, or conjugate gradients on two levels where that is too large
- ``solver``: what every equilibrium solver is
- ``newton``: the default one, the primal–dual iteration
- ``predictor``, ``path``: first guesses and load steps
- ``dead_centre``: those of motors past the end of their slack
- ``lead``: what leads a path that may turn back: a force, or motors
- ``arc_metric``, ``path_points``: the equilibria of such a path
- ``arc_length``, ``continuation``: steps along it, and where it ends
- ``critical``, ``soft_mode``, ``branching``: their limit points and bifurcations, and the paths that cross there
- ``adjoint``: of displacements and forces
- ``eigen``: the softest modes of a tangent, and buckling loads
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.adjoint import Adjoint, Quantity
from fenicsmech.equilibrium.arc_length import ArcLength, ArcSteps
from fenicsmech.equilibrium.arc_metric import ArcMetric, metric_at
from fenicsmech.equilibrium.blocks import Block, Blocks, Border
from fenicsmech.equilibrium.border import REGULARISATION, PointLoad
from fenicsmech.equilibrium.branching import Sense, crossing, null_space
from fenicsmech.equilibrium.continuation import Finish, Stretch, follow
from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl, ShareControl
from fenicsmech.equilibrium.critical import Critical, CriticalPoint
from fenicsmech.equilibrium.dead_centre import MotorPath
from fenicsmech.equilibrium.eigen import Mode, critical_changes, softest_modes
from fenicsmech.equilibrium.kkt import EntryCopy, KktMatrix
from fenicsmech.equilibrium.lead import ForceLead, Heading, Lead, MotorLead
from fenicsmech.equilibrium.linear import BySize, Direct, Factor, LinearMethod, LinearSolver, TwoLevel, TwoLevelSolver
from fenicsmech.equilibrium.newton import Newton, PrimalDualNewton
from fenicsmech.equilibrium.path import ZERO_ENERGY_SHIFT, Path, PathFailed
from fenicsmech.equilibrium.path_points import PathPoint, PathPoints
from fenicsmech.equilibrium.predictor import Constant, Hermite, Predictor, Tangent
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.solver import EquilibriumSolver, Iteration, Linearisation, NotConverged, Solution
from fenicsmech.equilibrium.state import State, Step, load_fields
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual

__all__ = [
    "Adjoint",
    "ArcLength",
    "ArcMetric",
    "ArcSteps",
    "Block",
    "Blocks",
    "Border",
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
    "Quantity",
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
