"""What leads a path that may turn back on itself: a force, or motors.

The parameter p of the path is one more unknown beside the state; its conjugate q does work with it. A heading is a
direction (ẏ, ṗ).

    lead        p                          q
    force       its magnitude f            the displacement a · u_P of its point along it
    motors      their position φ = p d     what they exert, Σ d λ
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

_NO_COMPLIANCE = 1e-6  # of the mean: ideal joints have 1e-8, which keeps redundant ones regular


@dataclass(frozen=True)
class Heading:
    """A direction along a path: change of the state and of the parameter."""

    step: Step
    parameter: float

    def scaled(self, factor: float) -> Heading:
        """``factor`` times this heading."""
        return Heading(self.step.scaled(factor), factor * self.parameter)

    def __add__(self, other: Heading) -> Heading:
        return Heading(self.step + other.step, self.parameter + other.parameter)


@dataclass(frozen=True)
class Verdict:
    """How stable an equilibrium is.

    Attributes:
        unstable_modes: directions in which the energy has a maximum while p is held.
        unstable_under_control: the same while q is held, where something can hold it; else while p is.
    """

    unstable_modes: int
    unstable_under_control: int


class Lead(ABC):
    """The parameter p of a path.

    Attributes:
        displaces: whether p is a displacement and q a force, or the reverse.
    """

    displaces: bool

    @abstractmethod
    def value(self, state: State) -> float:
        """p."""

    @abstractmethod
    def conjugate(self, system: EquilibriumSystem, state: State) -> float:
        """q of the loaded state (collective)."""

    @abstractmethod
    def conjugate_rate(self, system: EquilibriumSystem, state: State, control: Control, x: PETSc.Vec) -> float:
        """Rate of q with a control's target, x solving the equations of the rate (collective)."""

    @abstractmethod
    def holding(self, state: State) -> Control:
        """The control that keeps p as it is."""

    @abstractmethod
    def holding_conjugate(self, system: EquilibriumSystem, state: State) -> Control | None:
        """The control that keeps q and frees p; None if there is none (collective)."""

    @abstractmethod
    def heading(self, step: Step, control: Control) -> Heading:
        """The heading of a ``step`` that solves the equations of the rate with a control's target."""

    @abstractmethod
    def moves(self, system: EquilibriumSystem, rate: Heading) -> bool:
        """Whether anything moves at a ``rate`` of the state with p (collective)."""

    @abstractmethod
    def moved(self, system: EquilibriumSystem, state: State, heading: Heading) -> State:
        """``state`` after ``heading`` (collective)."""

    @abstractmethod
    def verdict(self, system: EquilibriumSystem, state: State, control: Control, x: PETSc.Vec, excess: int) -> Verdict:
        """Stability of an equilibrium (collective).

        Args:
            system, state: the equilibrium.
            control: under which the KKT matrix stands.
            x: solution of the equations of the rate with its target.
            excess: negative eigenvalues of the matrix beyond those of a stable equilibrium.
        """


@dataclass(frozen=True)
class ForceLead(Lead):
    """p is the magnitude of the controlled force."""

    displaces = False

    def value(self, state):
        return state.force

    def conjugate(self, system, state):
        return system.load_displacement(state)

    def conjugate_rate(self, system, state, control, x):
        return 1.0 if control.constrained else system.force_rate(state).dot(x)

    def holding(self, state):
        return LoadControl(state.force)

    def holding_conjugate(self, system, state):
        system.load(state)
        return DisplacementControl(system.load_displacement(state))

    def heading(self, step, control):
        whole = step if control.constrained else replace(step, force=1.0)
        return Heading(whole, whole.force)

    def moves(self, system, rate):
        return system.size(rate.step) > _NO_COMPLIANCE * system.joints.length / system.unknowns.unit**2

    def moved(self, system, state, heading):
        return system.moved(state, heading.step)

    def verdict(self, system, state, control, x, excess):
        if control.constrained:
            # x = −K⁻¹ e, and e · K⁻¹ e < 0 exactly if removing the control's row e leaves stability as it is
            return Verdict(max(excess + int(x.dot(system.unknowns.control_row()) <= 0.0), 0), max(excess, 0))
        # a force that falls as its point moves on: holding the point takes one mode away
        return Verdict(max(excess, 0), max(excess - int(system.force_rate(state).dot(x) < 0.0), 0))


@dataclass(frozen=True, eq=False)
class MotorLead(Lead):
    """p is the position of motors; the others stand, and the force keeps its magnitude.

    Attributes:
        direction: motor values per unit of p, d: one for the motor's connection and else zero, or those of several
            motors that move together, (connections,).
    """

    direction: np.ndarray
    displaces = True

    def value(self, state):
        return float(self.direction @ state.motors / (self.direction @ self.direction))

    def conjugate(self, system, state):
        return self._exerted(system, state.multipliers)

    def conjugate_rate(self, system, state, control, x):
        return self._exerted(system, system.unknowns.step(x).multipliers)

    def holding(self, state):
        return MotorControl(self.value(state), self.direction)

    def holding_conjugate(self, system, state):
        return None

    def heading(self, step, control):
        return Heading(step, 1.0)

    def moves(self, system, rate):
        return system.size(rate.step) > 0.0

    def moved(self, system, state, heading):
        return system.moved(replace(state, motors=state.motors + heading.parameter * self.direction), heading.step)

    def verdict(self, system, state, control, x, excess):
        return Verdict(max(excess, 0), max(excess, 0))

    def _exerted(self, system: EquilibriumSystem, multipliers: np.ndarray) -> float:
        """Σ d λ of the motors' equations."""
        joints = system.joints
        driven = [(k, joints.motor_rows[c.motor]) for k, c in enumerate(joints.connections) if c.motor is not None]
        return float(sum(self.direction[k] * multipliers[row] for k, row in driven))
