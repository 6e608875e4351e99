"""Buckling loads and motor positions of an equilibrium, and its buckling modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import Step
from fenicsmech.model import MechanismModel


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A direction in which a mechanism moves.

    Attributes:
        link: name of the flexible link that moves most.
        out_of_plane: fraction of its squared displacements that is across the plane of the mechanism, 0 … 1.
        step: the direction itself, its largest displacement the mechanism's length (or one rad).
    """

    link: str
    out_of_plane: float
    step: Step

    def __repr__(self) -> str:
        return f"<ModeShape: {self.link!r} moves most, {self.out_of_plane:.0%} out of the plane>"


@dataclass(frozen=True)
class BucklingLoad:
    """A magnitude of the force that changes at which the tangent is singular, and the mode."""

    force: float
    mode: ModeShape


@dataclass(frozen=True)
class BucklingPosition:
    """A position of the motors that move at which the tangent is singular while they are held there, and the mode."""

    position: float
    mode: ModeShape


@dataclass(frozen=True)
class SoftMode:
    """A mode of the tangent; its stiffness is in units of the mean stiffness of the links, negative if unstable."""

    stiffness: float
    mode: ModeShape


def mode_shape(model: MechanismModel, step: Step) -> ModeShape:
    """The direction ``step`` and its characteristics."""
    comm, links = model.mesh.mesh.comm, model.mechanism.flexible_links
    # where half is meshed, nodes move in space and bodies in the plane; pressures come behind
    dim = model.interfaces.block
    squares = model.elastic.split(step.u)[0].reshape(-1, dim) ** 2
    owners = model.node_link[: len(squares)]
    sums = comm.allreduce(np.array([squares[owners == index].sum(axis=0) for index in range(len(links))]))
    whole = float(sums.sum())
    across = float(sums[:, 2].sum()) / whole if dim == 3 and whole > 0.0 else 0.0
    return ModeShape(links[int(np.argmax(sums.sum(axis=1)))].name, across, step)
