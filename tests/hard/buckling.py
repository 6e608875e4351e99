"""Links that leave their plane or their straight line."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt

import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from ..oracles import beam, centreline
from .case import PLANE, SPACE, Check, Fact, HardCase, deviation
from .slender import section

LENGTH, THICKNESS, YOUNG = 60.0, 1.0, 2000.0
DEPTH = {PLANE: 4.0, SPACE: 2.0}


def column(space: str, comm: MPI.Comm, points, *, poisson: float, size: float | None = None):
    """A link through ``points`` between a pin on the ground and one on a slide, which the force pushes together."""
    mechanism = fm.Mechanism("column")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    shape = fm.strip(points, thickness=THICKNESS, depth=DEPTH[space])
    strut = mechanism.flexible("strut", shape, fm.Material("plastic", YOUNG, poisson))
    mechanism.revolute(base, strut, at=points[0], interface_radius=0.5 * THICKNESS)
    mechanism.revolute(strut, head, at=points[-1], interface_radius=0.5 * THICKNESS)
    mechanism.prismatic(base, head, at=points[-1], axis=(1, 0))
    push = mechanism.force(on=head, at=points[-1], direction=(-1, 0))
    size = size or (THICKNESS if space == PLANE else 2.0 * THICKNESS)
    return fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=comm), push


def euler(space: str) -> float:
    """Buckling load of the straight column, π² EI / L²."""
    return pi**2 * section(THICKNESS, depth=DEPTH[space], young=YOUNG).bending / LENGTH**2


def _straight_column(space: str, comm: MPI.Comm) -> Iterator[Check]:
    simulation, push = column(space, comm, [(0, 0), (LENGTH, 0)], poisson=0.3)
    loads = np.array([0.98, 1.02, 3.9, 4.1]) * euler(space)
    modes = [frame.unstable_modes for frame in simulation.load_displacement(push, forces=loads).frames]
    yield Fact("0, 1, 1, 2 unstable modes at 0.98, 1.02, 3.9, 4.1 Euler loads", modes == [0, 1, 1, 2])
    shortening = euler(space) * LENGTH / (YOUNG * THICKNESS * DEPTH[space])
    held = simulation.load_displacement(push, displacements=[0.9 * shortening, 1.2 * shortening]).frames
    stable = [frame.stable_under_control for frame in held]
    yield Fact("held displacement: stable before, unstable after", stable == [True, False])


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


def _deep_cantilever(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Michell and Prandtl: a narrow cantilever leaves its plane at P = 4.0126 √(EI GJ) / L² under a load at its end.

    EI is the bending stiffness out of the plane, GJ that of torsion, G b³h/3 (1 − 0.63 b/h); the bend in the plane
    before raises P by 1/√((1 − EI/EI₁)(1 − GJ/EI₁)). Timoshenko & Gere, Theory of Elastic Stability, section 6.3.
    """
    length, height, width, poisson = 160.0, 8.0, 1.0, 0.0
    mechanism = fm.Mechanism("blade")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(-4, 0), (length, 0)], thickness=height, depth=width)
    blade = mechanism.flexible("blade", shape, fm.Material("plastic", YOUNG, poisson))
    mechanism.weld(base, blade, at=(-2, 0), region=fm.Rectangle(4.0, 1.5 * height))
    push = mechanism.force(on=blade, at=(length, 0), direction=(0, -1))
    scene = fm.Scene(mechanism)
    bending = YOUNG * height * width**3 / 12.0
    torsion = YOUNG / (2.0 * (1.0 + poisson)) * height * width**3 / 3.0 * (1.0 - 0.63 * width / height)
    in_plane = YOUNG * width * height**3 / 12.0
    critical = 4.0126 * sqrt(bending * torsion) / length**2
    critical /= sqrt((1.0 - bending / in_plane) * (1.0 - torsion / in_plane))
    simulation = fm.Simulation(scene, space=space, size=2.0 if space == SPACE else 4.0, comm=comm)
    if space == PLANE:
        frames = simulation.load_displacement(push, forces=[0.97 * critical, 2.0 * critical]).frames
        yield Fact("plane stress does not see it", all(frame.stable for frame in frames))
        return
    # Southwell: the mesh is an imperfection; w = w₀ P / (P₁ − P), so that P against P / w is a line through P₁
    aside = mechanism.output(on=blade, at=(length, 0), direction=(0, 0, 1))
    loads = np.array([0.9, 0.95, 0.98]) * critical
    curve = simulation.load_displacement(push, forces=loads)
    ways = np.array([frame.outputs[aside] for frame in curve.frames])
    found = np.polyfit(loads / ways, loads, 1)[1]
    yield deviation("buckling load in space, from a Southwell plot,", found, critical, 4e-2)


CASES = (
    HardCase("straight column", "beyond its bifurcation the straight state is an equilibrium still", _straight_column),
    HardCase(
        "column with a sag of L/500", "load all but constant, displacement grows a thousandfold", _imperfect_column
    ),
    HardCase("deep thin link", "leaves its plane under a load within the plane", _deep_cantilever),
)
