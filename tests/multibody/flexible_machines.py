"""Mechanisms with links that bend, which the assembly moves as rigid bodies where it can."""

from __future__ import annotations

from collections.abc import Sequence

from fenicsmech.mechanism import ONYX, SMOOTH_SIL_950, Link, Mechanism, Strip, strip

from ..mechanism.truss_finger import FOOT, HEAD, truss_finger
from .machine import Machine
from .planar_machines import CRANK_ROCKER


def bent_strip(start: Sequence[float], end: Sequence[float]) -> Strip:
    """A strip between two points (2,), bent to one side."""
    middle = (0.5 * (start[0] + end[0]) + 2.0, 0.5 * (start[1] + end[1]) + 1.0)
    return strip([tuple(start), middle, tuple(end)], thickness=2.0, depth=10.0)


def finger(*, driven: bool = True) -> Machine:
    """A flexible diagonal in a rigid parallelogram, whose motor can only turn while the diagonal stretches."""
    made = truss_finger(bent_strip(FOOT, HEAD), SMOOTH_SIL_950)
    return Machine(made.mechanism, made.mechanism.motor(made.hinge) if driven else None, {})


def flexible_four_bar(angle: float, *, driven: bool = True) -> Machine:
    """The crank-rocker with a flexible coupler and a flexible rocker, drawn at the crank ``angle``."""
    pin, joint = (tuple(point) for point in CRANK_ROCKER.positions(angle))
    m = Mechanism("flexible four-bar")
    ground, crank = m.rigid("ground", fixed=True), m.rigid("crank")
    coupler = m.flexible("coupler", bent_strip(pin, joint), ONYX)
    rocker = m.flexible("rocker", bent_strip(CRANK_ROCKER.axle, joint), ONYX)
    shaft = m.revolute(ground, crank, at=CRANK_ROCKER.shaft)
    m.revolute(crank, coupler, at=pin, interface_radius=2.0)
    m.revolute(coupler, rocker, at=joint, interface_radius=2.0)
    m.revolute(rocker, ground, at=CRANK_ROCKER.axle, interface_radius=2.0)
    return Machine(m, m.motor(shaft) if driven else None, {"pin": (crank, pin)})


def links_by_name(machine: Machine) -> dict[str, Link]:
    """The links of ``machine``."""
    return {link.name: link for link in machine.mechanism.links}
