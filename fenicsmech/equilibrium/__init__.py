"""Equilibria of a mechanism: elements and joints meet here.

- ``state``, ``fields``: displacements, poses, multipliers; the finite-element fields that hold them
- ``load``, ``loads``, ``potentials``: point loads, and what depends on poses of bodies
- ``control``: what is prescribed: a force, a displacement, motors, an arc length
- ``layout``, ``unknowns``: where each unknown stands, and the change of state it stands for
- ``extras``, ``matrices``, ``entry_copy``, ``kkt``: the distributed KKT matrix
- ``system``: energy, residual and KKT matrix at a state
- ``factor``: LDLᵀ with inertia
- ``coarse``, ``smoother``, ``two_level``: conjugate gradients where the factor is too large
- ``linear``: which of the two solves, and by what rule
- ``solver``: the interface of equilibrium solvers, and the tangent at an equilibrium
- ``newton``: the default one, the primal–dual iteration
- ``reactions``: what joints and motors exert
"""

from fenicsmech.equilibrium.control import (
    ArcLengthControl,
    ArcMetric,
    Control,
    DisplacementControl,
    LoadControl,
    LoadFactorControl,
    MotorControl,
    Stability,
    mean_product,
)
from fenicsmech.equilibrium.entry_copy import EntryCopy
from fenicsmech.equilibrium.extras import REGULARISATION
from fenicsmech.equilibrium.factor import Factor
from fenicsmech.equilibrium.fields import load_fields
from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.linear import BySize, Direct, LinearMethod, LinearSolver, TwoLevel
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.newton import Newton, PrimalDualNewton
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.solver import EquilibriumPoint, EquilibriumSolver, Iteration, Linearisation, NotConverged
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.equilibrium.two_level import TwoLevelSolver

__all__ = [
    "ArcLengthControl",
    "ArcMetric",
    "BySize",
    "Control",
    "Direct",
    "DisplacementControl",
    "EntryCopy",
    "EquilibriumPoint",
    "EquilibriumSolver",
    "EquilibriumSystem",
    "Factor",
    "Iteration",
    "KktMatrix",
    "LinearMethod",
    "LinearSolver",
    "Linearisation",
    "LoadControl",
    "LoadFactorControl",
    "MotorControl",
    "Newton",
    "NotConverged",
    "PointLoad",
    "PrimalDualNewton",
    "REGULARISATION",
    "Reaction",
    "Residual",
    "Stability",
    "State",
    "Step",
    "TwoLevel",
    "TwoLevelSolver",
    "joint_reactions",
    "load_fields",
    "mean_product",
    "motor_torques",
]
