"""A deep circular arch, hinged at one end and clamped at the other, under a dead load at its crown.

The arch leans, sinks, and hangs through; its limit load is 897 EI/R² (DaDeppo & Schmidt, Instability of clamped-hinged
circular arches subjected to a point load, J. Appl. Mech. 42, 1975, doi:10.1115/1.3423734: inextensible elastica).
"""

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

RADIUS, THICKNESS, DEPTH, YOUNG = 100.0, 1.0, 1.0, 12.0e6
OPENING = np.radians(215.0)
BENDING = YOUNG * DEPTH * THICKNESS**3 / 12.0
LIMIT_LOAD = 897.0 * BENDING / 1e6  # R = 100


def deep_arch(comm: MPI.Comm = MPI.COMM_SELF) -> tuple[fm.Simulation, Force, float]:
    """The simulation, the force on the crown, and a displacement just beyond the limit point."""
    half, rim = 0.5 * OPENING, 0.5 * THICKNESS
    # links are elastic from the rims of their discs: that of the clamp is where the arch begins
    angles = [-half - rim / RADIUS, *np.linspace(-half, half, 41)]
    points = [(RADIUS * np.sin(a), RADIUS * np.cos(a)) for a in angles]
    mechanism = fm.Mechanism("deep arch")
    base = mechanism.rigid("base", fixed=True)
    bow = mechanism.flexible("bow", fm.strip(points, thickness=THICKNESS, depth=DEPTH), fm.Material("m", YOUNG, 0.3))
    mechanism.weld(base, bow, at=points[0], interface_radius=rim)
    mechanism.revolute(base, bow, at=points[-1], interface_radius=rim)
    push = mechanism.force(on=bow, at=(0.0, RADIUS), direction=(0, -1), name="push")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=2.0 * THICKNESS, comm=comm)
    return simulation, push, 1.16 * RADIUS
