"""Straight struts under an axial force, held at their ends in the ways of Euler's cases."""

from dataclasses import dataclass
from enum import Enum
from math import pi

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

LENGTH, THICKNESS, YOUNG = 100.0, 1.0, 1000.0
BENDING = YOUNG * THICKNESS**3 / 12.0  # EI for a depth of 1


class Hold(Enum):
    """Both ends of a strut; the value is its buckling load over EI (π / L)²."""

    CLAMPED_FREE = 0.25
    CLAMPED_CLAMPED = 4.0
    CLAMPED_GUIDED = 1.0


@dataclass(frozen=True)
class Strut:
    """A simulation, the force along the strut and the load of Euler."""

    simulation: fm.Simulation
    push: Force
    euler: float


def strut(hold: Hold, comm: MPI.Comm = MPI.COMM_SELF) -> Strut:
    """The strut from x = 0 to ``LENGTH``; what clamps it lies outside of that."""
    block = 2.0 * THICKNESS
    mechanism = fm.Mechanism("strut")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(-block, 0), (LENGTH + block, 0)], thickness=THICKNESS, depth=1.0)
    if hold is Hold.CLAMPED_FREE:
        shape = fm.strip([(-block, 0), (LENGTH, 0)], thickness=THICKNESS, depth=1.0)
    beam = mechanism.flexible("beam", shape, fm.Material("steel", YOUNG, 0.3))
    clamp, loaded = fm.Rectangle(block, 1.5 * THICKNESS), beam
    mechanism.weld(base, beam, at=(-0.5 * block, 0), region=clamp)
    if hold is not Hold.CLAMPED_FREE:
        loaded = mechanism.rigid("head")
        mechanism.weld(beam, loaded, at=(LENGTH + 0.5 * block, 0), region=clamp)
        guide = base
        if hold is Hold.CLAMPED_GUIDED:
            guide = mechanism.rigid("lift")
            mechanism.prismatic(base, guide, at=(LENGTH, 0), axis=(0, 1))
        mechanism.prismatic(guide, loaded, at=(LENGTH, 0), axis=(1, 0))
    push = mechanism.force(on=loaded, at=(LENGTH, 0), direction=(-1, 0), name="push")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=THICKNESS, comm=comm)
    return Strut(simulation, push, hold.value * BENDING * (pi / LENGTH) ** 2)
