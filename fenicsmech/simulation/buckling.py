"""Loads at which an equilibrium stops being the only one near, and the modes in which it then gives way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fenicsmech.equilibrium import IDLE_STIFFNESS, ForceLead, Iteration, Mode, critical_changes, softest_modes
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.mode_shape import ModeShape, mode_shape
from fenicsmech.simulation.model import MechanismModel


@dataclass(frozen=True)
class BucklingLoad:
    """A magnitude of the controlled force at which the tangent is singular, and the mode."""

    force: float
    mode: ModeShape


@dataclass(frozen=True)
class SoftMode:
    """A mode of the tangent; its stiffness is in units of the mean stiffness of the links, negative if unstable."""

    stiffness: float
    mode: ModeShape


def buckling_loads(
    model: MechanismModel, newton: Iteration, curve: Curve, frame: Frame, count: int
) -> tuple[BucklingLoad, ...]:
    """The ``count`` nearest buckling loads of ``frame`` (collective)."""
    modes = _at(model, newton, curve, frame, count, critical_changes)
    return tuple(BucklingLoad(frame.force + mode.value, mode_shape(model, mode.step)) for mode in modes)


def soft_modes(
    model: MechanismModel, newton: Iteration, curve: Curve, frame: Frame, count: int
) -> tuple[SoftMode, ...]:
    """The ``count`` softest modes of ``frame`` under dead loads (collective)."""
    modes = _at(model, newton, curve, frame, count, softest_modes)
    return tuple(SoftMode(mode.value, mode_shape(model, mode.step)) for mode in modes)


def _at(model: MechanismModel, newton: Iteration, curve: Curve, frame: Frame, count: int, modes) -> Iterable[Mode]:
    floor = IDLE_STIFFNESS if curve.freedom.idle else 0.0
    with model.shaped(frame.design):
        return modes(newton, ForceLead(), frame.state, floor=floor, count=count)
