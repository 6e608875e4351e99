"""Equilibria of a mechanism: elements and joints meet here.

- ``state``: displacements, poses, multipliers
- ``load``: point loads
- ``control``: what is led along a path: a force, a displacement, motors
- ``layout``, ``matrices``, ``extras``, ``system``: the distributed KKT system
- ``factor``: LDLᵀ with inertia
- ``coarse``, ``smoother``, ``two_level``: conjugate gradients where the factor is too large
- ``linear``: which of the two solves, and by what rule
- ``newton``: the primal–dual iteration
- ``predictor``, ``path``: first guesses and load steps
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl, ShareControl
from fenicsmech.equilibrium.linear import BySize, Direct, LinearMethod, LinearSolver, TwoLevel
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.newton import Newton, NewtonOptions, NotConverged, Solution
from fenicsmech.equilibrium.path import IDLE_STIFFNESS, Path, PathFailed
from fenicsmech.equilibrium.predictor import Constant, Hermite, Predictor, Tangent
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

__all__ = [
    "IDLE_STIFFNESS",
    "BySize",
    "Constant",
    "Control",
    "Direct",
    "DisplacementControl",
    "EquilibriumSystem",
    "Hermite",
    "LinearMethod",
    "LinearSolver",
    "LoadControl",
    "MotorControl",
    "Newton",
    "NewtonOptions",
    "NotConverged",
    "Path",
    "PathFailed",
    "PointLoad",
    "Predictor",
    "Reaction",
    "ShareControl",
    "Solution",
    "State",
    "Step",
    "Tangent",
    "TwoLevel",
    "joint_reactions",
    "motor_torques",
]
