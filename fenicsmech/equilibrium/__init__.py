"""Equilibria of a mechanism: finite elements coupled with rigid bodies and joints.

- ``state``: displacements, poses, multipliers, controlled force
- ``control``: the prescribed force, displacement, motors or arc length
- ``blocks``, ``unknowns``: numbering of the unknowns, and the change of state they stand for
- ``border``: loads, potentials of poses and joints
- ``kkt``: the distributed KKT matrix
- ``system``: energy, residual and KKT matrix at a state
- ``linear``: its factor LDLᵀ with inertia, or conjugate gradients on two levels for large systems
- ``solver``: the interface of equilibrium solvers, and the tangent at an equilibrium
- ``newton``: the default solver, a primal–dual Newton iteration
- ``adjoint``: of displacements and forces
- ``reactions``: forces and moments of joints, torques of motors
"""

from fenicsmech.equilibrium.adjoint import Adjoint, Quantity
from fenicsmech.equilibrium.blocks import Block, Blocks, Border
from fenicsmech.equilibrium.border import REGULARISATION, PointLoad
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
from fenicsmech.equilibrium.kkt import EntryCopy, KktMatrix
from fenicsmech.equilibrium.linear import BySize, Direct, Factor, LinearMethod, LinearSolver, TwoLevel, TwoLevelSolver
from fenicsmech.equilibrium.newton import Newton, PrimalDualNewton
from fenicsmech.equilibrium.reactions import Reaction, joint_reactions, motor_torques
from fenicsmech.equilibrium.solver import EquilibriumPoint, EquilibriumSolver, Iteration, Linearisation, NotConverged
from fenicsmech.equilibrium.state import State, Step, load_fields
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual

__all__ = [
    "Adjoint",
    "ArcLengthControl",
    "ArcMetric",
    "Block",
    "Blocks",
    "Border",
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
    "Quantity",
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
