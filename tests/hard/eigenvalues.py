"""Buckling loads from the KKT matrix of the unloaded mechanism alone, without going there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from ..equilibrium import column, struts
from ..simulation.clamped import YOUNG, cantilever
from .case import PLANE, SPACE, Check, Fact, HardCase, deviation


def _columns(space: str, comm: MPI.Comm) -> Iterator[Check]:
    pinned = column.column(comm=comm)
    start = pinned.simulation.load_displacement(pinned.push, forces=[0.0])
    loads = np.array([load.value for load in start.buckling_points(count=3)])
    first = column.critical_load(0.5 * column.THICKNESS)
    yield deviation("pinned: first three", loads / first / [1.0, 4.0, 9.0], 1.0, 2e-3)
    for hold in struts.Hold:
        case = struts.strut(hold, comm)
        start = case.simulation.load_displacement(case.push, forces=[0.0])
        (load,) = start.buckling_points(count=1)
        yield deviation(hold.name.lower().replace("_", "-"), load.value, case.euler, 2e-3)
        at = case.simulation.load_displacement(case.push, forces=[0.99 * load.value, 1.01 * load.value]).frames
        yield Fact("stable 1 % below, unstable 1 % above", [frame.unstable_modes for frame in at] == [0, 1])


def _column_in_space(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """A hinge is a pin about its axis only: across it the ends are clamped, and the square column is stiffer."""
    case = column.column(space=space, poisson=0.0, size=2.0, comm=comm)
    start = case.simulation.load_displacement(case.push, forces=[0.0])
    (load,) = start.buckling_points(count=1)
    yield deviation("pinned, in space", load.value, column.critical_load(0.5 * column.THICKNESS), 5e-3)


def _blade(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Prandtl and Michell: P = 4.013 √(EI GJ)/L², with the corrections for the warping held and the bend before.

    With Γ = h³b³/144 it rises by 1/(1 − √(EΓ/GJ)/L)², and by 1/√((1 − EI/EI₁)(1 − GJ/EI₁)). Timoshenko & Gere, Theory
    of Elastic Stability, section 6.3.
    """
    length, height, width = 100.0, 8.0, 0.8
    case = cantilever(
        space, length=length, thickness=height, depth=width, poisson=0.0, size=2.5, rigid_tip=False, comm=comm
    )
    start = case.simulation.load_displacement(case.force, forces=[0.0])
    sideways, upright = (YOUNG * a * b**3 / 12.0 for a, b in ((height, width), (width, height)))
    torsion = 0.5 * YOUNG * height * width**3 / 3.0 * (1.0 - 0.63 * width / height)
    warping = YOUNG * (height * width) ** 3 / 144.0
    critical = 4.013 * np.sqrt(sideways * torsion) / length**2
    critical /= (1.0 - np.sqrt(warping / torsion) / length) ** 2
    critical /= np.sqrt((1.0 - sideways / upright) * (1.0 - torsion / upright))
    pair = start.buckling_points(count=2)
    yield deviation("up and down", sorted(load.value for load in pair), [-critical, critical], 3e-2)
    yield Fact("out of the plane", all(load.mode.out_of_plane > 0.9 for load in pair))


CASES = (
    HardCase("columns by eigenvalues", "buckling loads of pinned and clamped columns from rest", _columns, (PLANE,)),
    HardCase("column in space by eigenvalues", "the same with hinges of five equations", _column_in_space, (SPACE,)),
    HardCase("blade by eigenvalues", "a deep strip gives way across its load", _blade, (SPACE,)),
)
