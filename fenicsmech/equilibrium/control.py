"""Controls: prescribed scalars of equilibria, one value v each.

The magnitude f of the controlled force is always an unknown. Its equation is

    constrained:  −(a · u_P − v) = 0, with f the multiplier,      otherwise:  f given.

The rate of the scaled unknowns x with v solves K x′ = r, K the KKT matrix. The work-conjugate of v is q:

    control         v                                  q
    load            force f                            displacement a · u_P of its point
    displacement    a · u_P                            f
    motors          φ, the motors standing at φ d      their torques, Σ d λ
    load factor     σ of the constant loads            their work

A path may turn back in v and in q. Its arc length s is a control as well, with the residual

    ⟨n, y − y₀⟩ − s,      y the state with the value v of the control that is followed,

without the turns of links that spin loosely (``spinning``), in place of the equation that prescribes v. It needs no row
of the matrix: that prescribes v, or q where it changes more (Rheinboldt & Burkardt, doi:10.1145/357456.357460), which
leaves K regular at limit points of the other, and the Newton step is moved into the plane by bordering, with r the
right-hand side of the control of v or q, the local parameter,

    K x₀ = −R,    K x₁ = r,    x = x₀ + τ x₁,    τ such that y + x lies in the plane (``PathPlane``).

Sources: Riks (doi:10.1016/0020-7683(79)90081-7), Crisfield (doi:10.1016/0045-7949(81)90108-5).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.state import State, Step


@dataclass(frozen=True)
class Stability:
    """Numbers of directions in which the energy has a maximum, all motors held.

    Attributes:
        under_load: while the force is held.
        under_displacement: while the displacement of the force's point is held.
    """

    under_load: int
    under_displacement: int

    def under(self, control: Control) -> int:
        """The number while what ``control`` prescribes is held; along a path, the displacement."""
        held = control.constrained or control.along_path
        return self.under_displacement if held else self.under_load


@dataclass(frozen=True, eq=False)
class Control(ABC):
    """A prescribed value.

    Those whose value a path can be followed by (``FollowedControl``) have ``opposite``, the control that prescribes
    their conjugate, ``displaces``, whether the value is a motion, ``change`` and ``moves``; ``LoadControl`` and
    ``MotorControl`` also have ``conjugate``.

    Attributes:
        prescribed: the value.
        along_path: whether a plane across a path is prescribed, where equilibria of any stability are wanted.
    """

    prescribed: float
    along_path = False

    @property
    def constrained(self) -> bool:
        """Whether f is the multiplier of a constraint on the displacement."""
        return False

    def at(self, value: float) -> Self:
        """The same control with another prescribed value."""
        return replace(self, prescribed=value)

    @abstractmethod
    def value(self, system, state: State) -> float:
        """v of a state that the ``EquilibriumSystem`` has loaded."""

    def prepare(self, state: State) -> State:
        """``state`` with the prescribed force, motors or load factor."""
        return state

    def gap(self, system, state: State) -> float:
        """Residual of the constraint on the displacement, at a loaded state."""
        return system.load_displacement(state) - self.prescribed

    @abstractmethod
    def rate(self, system, state: State) -> PETSc.Vec:
        """r: right-hand side whose solution is the rate of x with the prescribed value."""

    def tangent(self, step: Step) -> Step:
        """The rate of the whole state with the prescribed value, from the ``step`` that solves for its unknowns."""
        return step

    def conjugate_rate(self, system, right: PETSc.Vec, x: PETSc.Vec, tangent: Step) -> float:
        """Rate q′ of the conjugate with the prescribed value: r · x′ if q = −∂L/∂v."""
        return right.dot(x)

    def rates(self, system, right: PETSc.Vec, x: PETSc.Vec) -> tuple[Step, float]:
        """The tangent and q′ from the solution ``x`` of K x = r = ``right``."""
        tangent = self.tangent(system.unknowns.step(x))
        return tangent, self.conjugate_rate(system, right, x, tangent)

    def stability(self, excess: int, tangent: Step, conjugate_rate: float) -> Stability:
        """Stability from the number of negative eigenvalues in ``excess`` of a stable equilibrium's, and q′."""
        return Stability(max(excess, 0), max(excess, 0))


@dataclass(frozen=True)
class LoadControl(Control):
    """The force has magnitude ``prescribed``."""

    prescribed: float = 0.0

    def value(self, system, state):
        return state.force

    def prepare(self, state):
        return replace(state, force=self.prescribed)

    def rate(self, system, state):
        return system.travel_gradient(system.controlled, state)

    def tangent(self, step):
        return replace(step, force=1.0)

    def stability(self, excess, tangent, conjugate_rate):
        # a point that moves back as the force grows: holding it takes one unstable mode away
        return Stability(max(excess, 0), max(excess - int(conjugate_rate < 0.0), 0))

    # -- of a path that is followed by its force ----------------------------------------------------------------------

    displaces = False

    @property
    def opposite(self) -> DisplacementControl:
        """Displacement control of the force's point: its value is the conjugate q, its conjugate the force."""
        return DisplacementControl()

    def change(self, step: Step) -> float:
        """The change of the value in a change of state."""
        return step.force

    def conjugate(self, system, state: State) -> float:
        """The conjugate q of a loaded state."""
        return system.load_displacement(state)

    def moves(self, system, tangent: Step) -> bool:
        """Whether the force moves its point."""
        return system.size(tangent) > system.ideal_compliance


@dataclass(frozen=True)
class DisplacementControl(Control):
    """The force makes its point move by ``prescribed`` along its direction."""

    prescribed: float = 0.0

    @property
    def constrained(self):
        return True

    def value(self, system, state):
        return system.load_displacement(state)

    def rate(self, system, state):
        return system.border_rate(load=-1.0)

    def conjugate_rate(self, system, right, x, tangent):
        return tangent.force

    def stability(self, excess, tangent, conjugate_rate):
        # x′ = −K⁻¹ e, and e · K⁻¹ e < 0 exactly if removing the control's row e leaves stability as it is
        return Stability(max(excess + int(conjugate_rate <= 0.0), 0), max(excess, 0))


@dataclass(frozen=True, eq=False)
class MotorControl(Control):
    """Motors are at ``origin`` + ``prescribed`` · ``direction``, the others where they were; the force keeps its
    magnitude.

    Attributes:
        direction: d, motor values per unit of the prescribed value, (connections,).
        origin: motor values at a prescribed value of zero, (connections,).
    """

    prescribed: float
    direction: np.ndarray
    origin: np.ndarray | float = 0.0

    def value(self, system, state):
        return self._along(state.motors - self.origin)

    def prepare(self, state):
        moved = self.origin + self.prescribed * self.direction
        return replace(state, motors=np.where(self.direction, moved, state.motors))

    def rate(self, system, state):
        constraints, poses = system.joints.motor_rate(state.poses, state.motors, state.multipliers, self.direction)
        return system.border_rate(poses=poses, multipliers=constraints)

    def tangent(self, step):
        return replace(step, motors=self.direction)

    def conjugate_rate(self, system, right, x, tangent):
        return self.conjugate(system, tangent)

    # -- of a path that is followed by its motors ---------------------------------------------------------------------

    displaces = True
    opposite = None

    def change(self, step: Step) -> float:
        """The change of the value in a change of state."""
        return self._along(step.motors)

    def conjugate(self, system, state: State | Step) -> float:
        """The conjugate q of a state, Σ d λ of the motors' equations."""
        joints = system.joints
        driven = [(k, joints.motor_rows[c.motor]) for k, c in enumerate(joints.connections) if c.motor is not None]
        return float(sum(self.direction[k] * state.multipliers[row] for k, row in driven))

    def moves(self, system, tangent: Step) -> bool:
        """Whether the motors move any node or body."""
        return system.size(tangent) > 0.0

    def _along(self, motors: np.ndarray | float) -> float:
        return float(np.sum(self.direction * motors) / np.sum(self.direction**2))


@dataclass(frozen=True)
class LoadFactorControl(Control):
    """Constant loads and effects act with the factor ``prescribed``."""

    prescribed: float = 0.0

    def value(self, system, state):
        return state.load_factor

    def prepare(self, state):
        return replace(state, load_factor=self.prescribed)

    def rate(self, system, state):
        return system.load_factor_rate(state)

    def tangent(self, step):
        return replace(step, load_factor=1.0)

    # -- of a path that is followed by its load factor ----------------------------------------------------------------

    displaces = False
    opposite = None

    def change(self, step: Step) -> float:
        """The change of the value in a change of state."""
        return step.load_factor

    def moves(self, system, tangent: Step) -> bool:
        """Whether constant loads move any node or body."""
        return system.size(tangent) > 0.0


FollowedControl = LoadControl | MotorControl | LoadFactorControl
"""A control whose value a path can be followed by."""


@dataclass(frozen=True)
class ArcMetric:
    """Inner product ⟨a, b⟩ of changes of state: mean motion, and value of the followed control, over their references.

    Attributes:
        motion: reference of displacement over the mechanism's length, and of rotation.
        value, conjugate: references of v and q; that of q is infinite where it does not change with v.
    """

    system: Any
    followed: FollowedControl
    motion: float
    value: float
    conjugate: float

    def dot(self, a: Step, b: Step) -> float:
        """⟨a, b⟩."""
        values = self.followed.change(a) * self.followed.change(b)
        return self.system.mean_product(a, b) / self.motion**2 + values / self.value**2

    def norm(self, a: Step) -> float:
        """√⟨a, a⟩."""
        return math.sqrt(self.dot(a, a))

    def unit(self, a: Step) -> Step:
        """``a`` scaled to norm one."""
        return a.scaled(1.0 / self.norm(a))


@dataclass(frozen=True, eq=False)
class ArcLengthControl(Control):
    """The state lies in a plane normal to a path: ⟨n, y − y₀⟩ = ``prescribed``.

    Attributes:
        metric: ⟨·, ·⟩.
        origin: y₀.
        normal: n; the path's tangent, of norm one, is oriented along it.
        local: the control of the local parameter, the followed value or its conjugate, which K prescribes in place of
            the plane.
    """

    prescribed: float
    metric: ArcMetric
    origin: State
    normal: Step
    local: FollowedControl | DisplacementControl
    along_path = True

    @property
    def constrained(self) -> bool:
        return self.local.constrained

    def value(self, system, state):
        return self.metric.dot(self.normal, system.settled_difference(state, self.origin))

    def gap(self, system, state):
        return 0.0  # the local parameter stays where it is

    def rate(self, system, state):
        return self.local.rate(system, state)

    def rates(self, system, right, x):
        tangent, rate = self.local.rates(system, right, x)
        if not isinstance(self.local, type(self.metric.followed)):
            rate = 1.0  # of the conjugate, which is the local parameter itself
        scale = 1.0 / self.metric.norm(tangent)
        if not self.metric.dot(tangent, self.normal) > 0.0:
            scale = -scale
        return tangent.scaled(scale), scale * rate

    def stability(self, excess, tangent, conjugate_rate):
        local_rate = tangent.force * conjugate_rate  # of the same sign
        return self.local.stability(excess, tangent, local_rate)


class PathPlane:
    """The plane of an ``ArcLengthControl``, into which steps from one state are moved along x₁.

    Args:
        control: of the plane.
        system: of the state.
        state: from which steps lead.
        x: x₁, which solves K x = r.
    """

    def __init__(self, control: ArcLengthControl, system, state: State, x: PETSc.Vec) -> None:
        self._control, self._system, self._state, self.x = control, system, state, x
        self._rate = control.local.tangent(system.unknowns.step(x))
        self._slope = control.metric.dot(control.normal, system.settled(self._rate, state))
        self._gap = control.value(system, state) - control.prescribed

    @property
    def missing(self) -> float:
        """τ of no step: the state itself need not lie in the plane."""
        return -self._gap / self._slope

    def along(self, x: PETSc.Vec) -> float:
        """τ that keeps a change of state by ``x`` parallel to the plane."""
        # the value that it changes itself is left to the next iteration
        step = replace(self._system.settled(self._system.unknowns.step(x), self._state), force=0.0)
        return -self._control.metric.dot(self._control.normal, step) / self._slope

    def reached(self, x: PETSc.Vec) -> Step:
        """The step by ``x`` + τ x₁ into the plane."""
        return self._system.unknowns.step(x) + self._rate.scaled(self.missing + self.along(x))
