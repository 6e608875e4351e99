"""Loads at which an equilibrium stops being the only one near, and the modes in which it then gives way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import IDLE_STIFFNESS, ForceLead, Mode, Newton, Step, critical_changes, softest_modes
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.model import MechanismModel


@dataclass(frozen=True)
class ModeShape:
    """A direction in which a mechanism moves.

    Attributes:
        link: name of the flexible link that moves most.
        out_of_plane: share of its squared displacements that is across the plane of the mechanism, 0 … 1.
        step: the direction itself, its largest displacement the mechanism's length (or one rad).
    """

    link: str
    out_of_plane: float
    step: Step


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
    model: MechanismModel, newton: Newton, curve: Curve, frame: Frame, count: int
) -> tuple[BucklingLoad, ...]:
    """The ``count`` nearest buckling loads of ``frame`` (collective)."""
    modes = _at(model, newton, curve, frame, count, critical_changes)
    return tuple(BucklingLoad(frame.force + mode.value, mode_shape(model, mode.step)) for mode in modes)


def soft_modes(model: MechanismModel, newton: Newton, curve: Curve, frame: Frame, count: int) -> tuple[SoftMode, ...]:
    """The ``count`` softest modes of ``frame`` under dead loads (collective)."""
    modes = _at(model, newton, curve, frame, count, softest_modes)
    return tuple(SoftMode(mode.value, mode_shape(model, mode.step)) for mode in modes)


def _at(model: MechanismModel, newton: Newton, curve: Curve, frame: Frame, count: int, modes) -> Iterable[Mode]:
    floor = IDLE_STIFFNESS if curve.freedom.mobility else 0.0
    with model.shaped(frame.design):
        return modes(newton, ForceLead(), frame.state, floor=floor, count=count)


def mode_shape(model: MechanismModel, step: Step) -> ModeShape:
    """What stands out in the direction ``step`` (collective)."""
    comm, dim, links = model.mesh.mesh.comm, model.linkage.dim, model.mechanism.flexible_links
    squares = step.u.reshape(-1, dim) ** 2
    owners = model.node_link[: len(squares)]
    sums = comm.allreduce(np.array([squares[owners == index].sum(axis=0) for index in range(len(links))]))
    whole = float(sums.sum())
    across = float(sums[:, 2].sum()) / whole if dim == 3 and whole > 0.0 else 0.0
    return ModeShape(links[int(np.argmax(sums.sum(axis=1)))].name, across, step)
