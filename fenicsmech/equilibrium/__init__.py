"""Equilibria of a mechanism: elements and joints meet here.

- ``state``: displacements, poses, multipliers
- ``load``: point loads and what is controlled
- ``layout``, ``matrices``, ``system``: the distributed KKT system
- ``factor``: LDLᵀ with inertia
- ``newton``: the primal–dual iteration
- ``path``: predictor and load steps
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.load import Control, DisplacementControl, LoadControl, PointLoad
from fenicsmech.equilibrium.newton import Newton, NewtonOptions, NotConverged, Solution
from fenicsmech.equilibrium.path import Path, PathFailed
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

__all__ = [
    "Control",
    "DisplacementControl",
    "EquilibriumSystem",
    "LoadControl",
    "Newton",
    "NewtonOptions",
    "NotConverged",
    "Path",
    "PathFailed",
    "PointLoad",
    "Reaction",
    "Solution",
    "State",
    "Step",
    "joint_reactions",
    "motor_torques",
]
