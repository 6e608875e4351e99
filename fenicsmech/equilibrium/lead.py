"""What leads a path that may turn back on itself: a force, or a motor.

The parameter p of the path is one more unknown beside the state. A heading is a direction (ẏ, ṗ) in both.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl, MotorControl
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem


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


class Lead(ABC):
    """The parameter p of a path."""

    @abstractmethod
    def value(self, state: State) -> float:
        """p."""

    @abstractmethod
    def holding(self, state: State) -> Control:
        """The control that keeps p as it is."""

    @abstractmethod
    def holding_travel(self, system: EquilibriumSystem, state: State) -> Control | None:
        """The control that keeps the point's displacement and frees p; None if p cannot be freed (collective)."""

    @abstractmethod
    def heading(self, step: Step, control: Control) -> Heading:
        """The heading of a ``step`` that solves the equations of the rate with a control's target."""

    @abstractmethod
    def moved(self, system: EquilibriumSystem, state: State, heading: Heading) -> State:
        """``state`` after ``heading`` (collective)."""


@dataclass(frozen=True)
class ForceLead(Lead):
    """p is the magnitude of the controlled force."""

    def value(self, state):
        return state.force

    def holding(self, state):
        return LoadControl(state.force)

    def holding_travel(self, system, state):
        system.load(state)
        return DisplacementControl(system.load_displacement(state))

    def heading(self, step, control):
        whole = step if control.constrained else replace(step, force=1.0)
        return Heading(whole, whole.force)

    def moved(self, system, state, heading):
        return system.moved(state, heading.step)


@dataclass(frozen=True, eq=False)
class MotorLead(Lead):
    """p is the position of a motor; the others stand, and the force keeps its magnitude.

    Attributes:
        direction: motor values per unit of p, one for the motor's connection and else zero, (connections,).
    """

    direction: np.ndarray

    def value(self, state):
        return float(self.direction @ state.motors)

    def holding(self, state):
        return MotorControl(self.value(state), self.direction)

    def holding_travel(self, system, state):
        return None

    def heading(self, step, control):
        return Heading(step, 1.0)

    def moved(self, system, state, heading):
        return system.moved(replace(state, motors=state.motors + heading.parameter * self.direction), heading.step)
