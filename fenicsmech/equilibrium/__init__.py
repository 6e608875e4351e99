"""Equilibria of a mechanism: elements and joints meet here.

- ``state``: displacements, poses, multipliers
- ``load``: point loads
- ``control``: what is led along a path: a force, a displacement, motors
- ``layout``, ``matrices``, ``extras``, ``system``: the distributed KKT system
- ``factor``: LDLᵀ with inertia
- ``solver``: what every equilibrium solver is
- ``newton``: the default one, the primal–dual iteration
- ``solvers``: others to choose and to compare
- ``predictor``, ``path``: first guesses and load steps
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl, ShareControl
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.newton import Newton, PrimalDualNewton
from fenicsmech.equilibrium.path import IDLE_STIFFNESS, Path, PathFailed
from fenicsmech.equilibrium.predictor import Constant, Hermite, Predictor, Tangent
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.solver import EquilibriumSolver, Iteration, NotConverged, Solution
from fenicsmech.equilibrium.solvers import AugmentedLagrangian, Globalisation, KktNewton, Snes
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

__all__ = [
    "IDLE_STIFFNESS",
    "AugmentedLagrangian",
    "Constant",
    "Control",
    "DisplacementControl",
    "EquilibriumSolver",
    "EquilibriumSystem",
    "Globalisation",
    "Hermite",
    "Iteration",
    "KktNewton",
    "LoadControl",
    "MotorControl",
    "Newton",
    "NotConverged",
    "Path",
    "PathFailed",
    "PointLoad",
    "Predictor",
    "PrimalDualNewton",
    "Reaction",
    "ShareControl",
    "Snes",
    "Solution",
    "State",
    "Step",
    "Tangent",
    "joint_reactions",
    "motor_torques",
]
