"""What is led along a path of equilibria: a force, the displacement of its point, motors, or constant loads.

The magnitude f of the controlled force is always an unknown. Its equation is

    constrained:  −(a · u_P − target) = 0, with f the multiplier,      otherwise:  f given.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.state import State


class Rates(Protocol):
    """Right-hand sides whose KKT solutions are rates of the scaled unknowns x (collective)."""

    def force_rate(self, state: State) -> PETSc.Vec:
        """With the controlled force."""

    def target_rate(self) -> PETSc.Vec:
        """With the displacement of its point."""

    def share_rate(self, state: State) -> PETSc.Vec:
        """With the share of the constant loads that acts."""

    def motor_rate(self, state: State, direction: np.ndarray) -> PETSc.Vec:
        """With motor values along ``direction`` (per connection)."""


class Control(ABC):
    """One value, ``target``, that equilibria are asked for.

    Attributes:
        target: the value.
        constrained: whether f is the multiplier of a constraint on the displacement.
    """

    target: float
    constrained: bool

    @abstractmethod
    def at(self, target: float) -> Control:
        """The same control with another target."""

    @abstractmethod
    def prepare(self, state: State) -> State:
        """``state`` with the quantities the control prescribes."""

    @abstractmethod
    def rate(self, system: Rates, state: State) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the target (collective)."""


@dataclass(frozen=True)
class LoadControl(Control):
    """The force has magnitude ``target``."""

    target: float
    constrained = False

    def at(self, target):
        return LoadControl(target)

    def prepare(self, state):
        return replace(state, force=self.target)

    def rate(self, system, state):
        return system.force_rate(state)


@dataclass(frozen=True)
class DisplacementControl(Control):
    """The force makes its point move by ``target`` along its direction."""

    target: float
    constrained = True

    def at(self, target):
        return DisplacementControl(target)

    def prepare(self, state):
        return state

    def rate(self, system, state):
        return system.target_rate()


@dataclass(frozen=True, eq=False)
class MotorControl(Control):
    """Motors stand at ``target`` · ``motors`` (values per connection) while the force keeps its magnitude."""

    target: float
    motors: np.ndarray
    constrained = False

    def at(self, target):
        return MotorControl(target, self.motors)

    def prepare(self, state):
        return replace(state, motors=self.target * self.motors)

    def rate(self, system, state):
        return system.motor_rate(state, self.motors)


@dataclass(frozen=True)
class ShareControl(Control):
    """The share ``target`` of the constant loads acts."""

    target: float
    constrained = False

    def at(self, target):
        return ShareControl(target)

    def prepare(self, state):
        return replace(state, share=self.target)

    def rate(self, system, state):
        return system.share_rate(state)
