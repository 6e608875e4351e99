"""A mechanism, its motor and the pivots that are followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fenicsmech.mechanism import Configuration, Link, Mechanism, Motor, validate
from fenicsmech.multibody import Assembly, Freedom, Linkage, assemble, build_linkage, count_freedom


@dataclass
class Machine:
    """A mechanism, its motor, and the (link, drawn position) of every pivot that is followed."""

    mechanism: Mechanism
    motor: Motor | None
    pivots: dict[str, tuple[Link, tuple[float, ...]]] = field(default_factory=dict)

    def linkage(self, dim: int) -> Linkage:
        """Checked and built in ``dim`` dimensions."""
        validate(self.mechanism, dim)
        return build_linkage(self.mechanism, dim)

    def drive(self, linkage: Linkage, position: float) -> Assembly:
        """The assembly with the motor at ``position`` from where it was drawn."""
        return assemble(linkage, Configuration("driven", ((self.motor, position),)))

    def positions(self, linkage: Linkage, poses: np.ndarray) -> dict[str, np.ndarray]:
        """Places (dim,) of all pivots."""
        return {name: point_of(linkage, poses, link, at) for name, (link, at) in self.pivots.items()}


def point_of(linkage: Linkage, poses: np.ndarray, link: Link, at: Sequence[float]) -> np.ndarray:
    """Place of the point of ``link`` drawn at ``at``, (dim,)."""
    body = linkage.body_of(link)
    drawn = np.array([*at, 0.0])[: linkage.dim]
    offset = drawn - linkage.bodies[body].centre
    return drawn + linkage.joints.space.displace(poses[body], offset[None])[0]


def freedom_as_drawn(machine: Machine, dim: int) -> Freedom:
    """Mobility and redundancy where ``machine`` was drawn."""
    linkage = machine.linkage(dim)
    return count_freedom(linkage.rigid, linkage.rigid.drawn, np.zeros(len(linkage.rigid.connections)))
