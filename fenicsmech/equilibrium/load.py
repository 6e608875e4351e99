"""Loads and what is controlled: a force's magnitude or a point's displacement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from fenicsmech.bodies import MaterialPoint


@dataclass(frozen=True)
class PointLoad:
    """A dead force along ``direction`` (dim,) at a material point: work f · direction · u(point)."""

    name: str
    point: MaterialPoint
    direction: np.ndarray


class Control(ABC):
    """Fixes the magnitude f of the controlled force: its row of the equilibrium equations is

        constrained:  −(direction · u(point) − target) = 0,   f its multiplier,
        otherwise:    f = target.
    """

    target: float
    constrained: bool

    @abstractmethod
    def at(self, target: float) -> Control:
        """The same control with another target."""


@dataclass(frozen=True)
class LoadControl(Control):
    """The force has magnitude ``target``."""

    target: float
    constrained = False

    def at(self, target):
        return LoadControl(target)


@dataclass(frozen=True)
class DisplacementControl(Control):
    """The force makes its point move by ``target`` along its direction."""

    target: float
    constrained = True

    def at(self, target):
        return DisplacementControl(target)
