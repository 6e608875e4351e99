"""Links that leave their plane or their straight line."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

from mpi4py import MPI

import fenicsmech as fm

from ..oracles import beam, centreline
from .case import PLANE, SPACE, Check, Fact, HardCase, deviation
from .slender import section

LENGTH, THICKNESS, YOUNG = 60.0, 1.0, 2000.0
DEPTH = {PLANE: 4.0, SPACE: 2.0}


def column(space: str, comm: MPI.Comm, points, *, poisson: float):
    """A link through ``points`` between a pin on the ground and one on a slide, which the force pushes together."""
    mechanism = fm.Mechanism("column")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    shape = fm.strip(points, thickness=THICKNESS, depth=DEPTH[space])
    strut = mechanism.flexible("strut", shape, fm.Material("plastic", YOUNG, poisson))
    mechanism.revolute(base, strut, at=points[0], radius=0.5 * THICKNESS)
    mechanism.revolute(strut, head, at=points[-1], radius=0.5 * THICKNESS)
    mechanism.prismatic(base, head, at=points[-1], axis=(1, 0))
    push = mechanism.force(on=head, at=points[-1], direction=(-1, 0))
    size = THICKNESS if space == PLANE else 2.0 * THICKNESS
    return fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=comm), push


def euler(space: str) -> float:
    """Buckling load of the straight column, π² EI / L²."""
    return pi**2 * section(THICKNESS, depth=DEPTH[space], young=YOUNG).bending / LENGTH**2


def _imperfect_column(space: str, comm: MPI.Comm) -> Iterator[Check]:
    sag = LENGTH / 500.0
    points = [(0.0, 0.0), (0.25 * LENGTH, 0.75 * sag), (0.5 * LENGTH, sag), (0.75 * LENGTH, 0.75 * sag), (LENGTH, 0.0)]
    poisson = 0.3 if space == PLANE else 0.0
    simulation, push = column(space, comm, points, poisson=poisson)
    stiffness = section(THICKNESS, depth=DEPTH[space], young=YOUNG, poisson=poisson)
    line = beam.between_pins(centreline.through(points), stiffness, rigid=(0.5 * THICKNESS, 0.5 * THICKNESS))
    pushes = [0.005, 0.02, 1.0, 10.0, 30.0]
    held = simulation.load_displacement(push, displacements=pushes)
    wanted, solved = [], None
    for travelled in pushes:
        solved = beam.pinned_pinned(line, extension=-travelled, initial=None if solved is None else solved.solution)
        wanted.append(-solved.force)
    yield deviation("forces up to half its length", held.forces / wanted, 1.0, 1e-2)
    yield Fact("stable all along", all(frame.stable for frame in held.frames))
    dead = simulation.load_displacement(push, forces=held.forces[:3])
    yield deviation("the same under dead loads", dead.displacements / pushes[:3], 1.0, 1e-6)


CASES = (
    HardCase(
        "column with a sag of L/500", "load all but constant, displacement grows a thousandfold", _imperfect_column
    ),
)
