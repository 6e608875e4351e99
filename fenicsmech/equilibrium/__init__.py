"""Equilibria of a mechanism: finite elements coupled with rigid bodies and joints.

- ``state``: displacements, poses, multipliers, controlled force; reactions of joints and torques of motors
- ``control``: the prescribed force, displacement, motors or arc length
- ``unknowns``: blocks, numbers and scales of the unknowns, and the change of state they stand for
- ``border``: loads, potentials of poses and joints
- ``turning``: steps that turn flexible links instead of straining them, and close joints
- ``kkt``: the distributed KKT matrix
- ``system``: energy, residual and KKT matrix at a state
- ``linearisation``: its factor LDLᵀ with inertia; rates, stability and adjoints at an equilibrium
- ``two_level``: conjugate gradients on two levels for large systems
- ``active_set``: one-sided constraints within a Newton step
- ``solver``: the interface of equilibrium solvers
- ``newton``: the default method, a primal–dual Newton iteration
"""

from fenicsmech.equilibrium.active_set import ActiveSet
from fenicsmech.equilibrium.border import REGULARISATION, PointLoad
from fenicsmech.equilibrium.control import (
    ArcLengthControl,
    ArcMetric,
    Control,
    DisplacementControl,
    FollowedControl,
    LoadControl,
    LoadFactorControl,
    MotorControl,
    PathPlane,
    Stability,
)
from fenicsmech.equilibrium.kkt import EntryCopy, KktMatrix
from fenicsmech.equilibrium.linearisation import (
    Adjoint,
    Direct,
    EquilibriumPoint,
    Factor,
    InvertedGuess,
    Linearisation,
    LinearMethod,
    LinearSolver,
    NotConverged,
    Unknown,
)
from fenicsmech.equilibrium.newton import NewtonSolver, PrimalDualNewton
from fenicsmech.equilibrium.solver import EquilibriumMethod, EquilibriumSolver
from fenicsmech.equilibrium.state import (
    Reaction,
    State,
    Step,
    joint_reaction,
    joint_reaction_rate,
    joint_reaction_slopes,
    joint_reactions,
    load_fields,
    motor_torques,
)
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.equilibrium.turning import TurningLink
from fenicsmech.equilibrium.two_level import BySize, TwoLevel, TwoLevelSolver
from fenicsmech.equilibrium.unknowns import Border
