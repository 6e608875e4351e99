"""Loads and motor positions at which an equilibrium stops being the only one near, and the modes it gives way in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fenicsmech.continuation import Mode, critical_changes, softest_modes
from fenicsmech.equilibrium import Iteration, LoadControl, MotorControl, NotConverged
from fenicsmech.errors import EquilibriumError
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.mode_shape import ModeShape, mode_shape
from fenicsmech.simulation.request import followed_control, quantities


@dataclass(frozen=True)
class BucklingLoad:
    """A magnitude of the controlled force at which the tangent is singular, and the mode."""

    force: float
    mode: ModeShape


@dataclass(frozen=True)
class BucklingPosition:
    """A position of the motors that lead at which the tangent is singular while they are held there, and the mode."""

    position: float
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
    modes = _at(model, newton, curve, frame, count, LoadControl(), critical_changes)
    return tuple(BucklingLoad(frame.force + mode.value, mode_shape(model, mode.step)) for mode in modes)


def buckling_positions(
    model: MechanismModel, newton: Iteration, curve: Curve, frame: Frame, count: int
) -> tuple[BucklingPosition, ...]:
    """The ``count`` nearest buckling positions of ``frame``, which motors led to (collective)."""
    held = followed_control(curve.part, model.linkage.joints)
    modes = _at(model, newton, curve, frame, count, held, critical_changes)
    return tuple(BucklingPosition(frame.displacement + mode.value, mode_shape(model, mode.step)) for mode in modes)


def soft_modes(
    model: MechanismModel, newton: Iteration, curve: Curve, frame: Frame, count: int
) -> tuple[SoftMode, ...]:
    """The ``count`` softest modes of ``frame`` under dead loads (collective)."""
    modes = _at(model, newton, curve, frame, count, LoadControl(), softest_modes)
    return tuple(SoftMode(mode.value, mode_shape(model, mode.step)) for mode in modes)


def _at(
    model: MechanismModel,
    newton: Iteration,
    curve: Curve,
    frame: Frame,
    count: int,
    held: LoadControl | MotorControl,
    modes: Callable[..., list[Mode]],
) -> list[Mode]:
    with model.shaped(frame.design):
        try:
            return modes(newton, held, frame.state, count=count)
        except NotConverged as failure:
            raise EquilibriumError(
                f"modes of {curve.part.name!r} in configuration {curve.configuration.name!r}",
                f"they cannot be told at {quantities(curve.part)[1]} {frame.force:g} ({failure.reason})",
                "Choose another frame, or another part to lead",
                last=frame,
            ) from failure
