"""A bowed strip between two clamps that motors turn: it snaps through when both have turned far enough."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force, Motor

SPAN, RISE, THICKNESS, BLOCK = 60.0, 6.0, 1.0, 2.0
POINTS = [
    *((-BLOCK, 0.0), (-0.5 * BLOCK, 0.0)),
    *((x, 0.5 * RISE * (1.0 - np.cos(2.0 * np.pi * x / SPAN))) for x in np.linspace(0.0, SPAN, 25)),
    *((SPAN + 0.5 * BLOCK, 0.0), (SPAN + BLOCK, 0.0)),
]


def bow(comm: MPI.Comm = MPI.COMM_SELF) -> tuple[fm.Simulation, Force, tuple[Motor, Motor]]:
    """The simulation in plane stress, a force on the crown, and the motors of both clamps."""
    mechanism = fm.Mechanism("bow")
    base, left, right = mechanism.rigid("base", fixed=True), mechanism.rigid("left"), mechanism.rigid("right")
    shape = fm.strip(POINTS, thickness=THICKNESS, depth=2.0)
    strip = mechanism.flexible("bow", shape, fm.Material("plastic", 1000.0, 0.3))
    clamp = fm.Rectangle(BLOCK, 2.0 * THICKNESS)
    mechanism.weld(left, strip, at=(-0.5 * BLOCK, 0), region=clamp)
    mechanism.weld(strip, right, at=(SPAN + 0.5 * BLOCK, 0), region=clamp)
    motors = [mechanism.motor(mechanism.revolute(base, end, at=(x, 0))) for end, x in ((left, 0), (right, SPAN))]
    crown = mechanism.force(on=strip, at=(0.5 * SPAN, RISE), direction=(0, -1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=THICKNESS, comm=comm)
    return simulation, crown, tuple(motors)
