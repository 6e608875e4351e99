"""The truss finger: a rigid parallelogram that a flexible diagonal holds."""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.mechanism import Force, Joint, Material, Mechanism, RigidLink, Strip

FOOT, HEAD = (0.0, 0.0), (40.0, 60.0)


@dataclass(frozen=True)
class TrussFinger:
    """The mechanism, and those of its parts that tests need; ``hinge`` joins base and left leg."""

    mechanism: Mechanism
    tip: RigidLink
    hinge: Joint

    def push(self) -> Force:
        """A new force on the tip; positive ones stretch the diagonal."""
        return self.mechanism.force(on=self.tip, at=(20.0, 70.0), direction=(1.0, 0.0), name="push")


def truss_finger(shape: Strip, material: Material, *, radius: float = 3.0) -> TrussFinger:
    """With a diagonal of ``shape`` from foot to head, whose ends are rigid within ``radius``."""
    mechanism = Mechanism("truss finger")
    base = mechanism.rigid("base", fixed=True)
    left, right, tip = (mechanism.rigid(name) for name in ("left", "right", "tip"))
    diagonal = mechanism.flexible("diagonal", shape, material)
    hinge = mechanism.revolute(base, left, at=FOOT)
    mechanism.revolute(base, right, at=(40.0, 0.0))
    mechanism.revolute(left, tip, at=(0.0, 60.0))
    mechanism.revolute(right, tip, at=HEAD)
    mechanism.revolute(base, diagonal, at=FOOT, interface_radius=radius)
    mechanism.revolute(diagonal, tip, at=HEAD, interface_radius=radius)
    return TrussFinger(mechanism, tip, hinge)
