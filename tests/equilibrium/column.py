"""A straight column between two pins, one of them on a slide, pushed along its axis."""

from dataclasses import dataclass
from math import cos, pi, sin

from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.mechanism import Force

LENGTH, THICKNESS, DEPTH, YOUNG = 100.0, 1.0, 1.0, 1000.0
EULER = pi**2 * YOUNG * DEPTH * THICKNESS**3 / 12.0 / LENGTH**2


@dataclass(frozen=True)
class Column:
    """A simulation of the column and the force that pushes on its slide."""

    simulation: fm.Simulation
    push: Force


def column(
    *,
    slides: int = 1,
    poisson: float = 0.3,
    space: str = "plane-stress",
    size: float = THICKNESS,
    comm: MPI.Comm = MPI.COMM_SELF,
    **options,
) -> Column:
    """The column, by default in plane stress; every slide beyond the first is redundant."""
    mechanism = fm.Mechanism("column")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    shape = fm.strip([(0, 0), (LENGTH, 0)], thickness=THICKNESS, depth=DEPTH)
    strut = mechanism.flexible("strut", shape, fm.Material("steel", YOUNG, poisson))
    mechanism.revolute(base, strut, at=(0, 0), interface_radius=0.5 * THICKNESS)
    mechanism.revolute(strut, head, at=(LENGTH, 0), interface_radius=0.5 * THICKNESS)
    for k in range(slides):
        mechanism.prismatic(base, head, at=(LENGTH + 5.0 * k, 3.0 * k), axis=(1, 0))
    push = mechanism.force(on=head, at=(LENGTH, 0), direction=(-1, 0))
    return Column(fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=comm, **options), push)


def critical_load(arm: float) -> float:
    """Buckling load of the column if its last ``arm`` at either end, up to the pin, is rigid.

    The middle is w = cos kx; the arms carry on along its end tangents and meet the line of the pins:
    cos(k l / 2) = k a sin(k l / 2), with the elastic length l = L − 2 a.
    """
    elastic = LENGTH - 2.0 * arm
    half = brentq(lambda h: 2.0 * h * arm / elastic * sin(h) - cos(h), 0.1, 0.5 * pi)
    return EULER * (2.0 * half / elastic) ** 2 / (pi / LENGTH) ** 2
