"""Loads that are asked for all at once, or far too large."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

import fenicsmech as fm

from ..mechanism.truss_finger import truss_finger
from .case import PLANE, Check, Deviation, Fact, HardCase, deviation

SOFT = fm.Material("silicone", 1.9, 0.45)


def truss(space: str, comm: MPI.Comm) -> tuple[fm.Simulation, fm.mechanism.Force]:
    """Silicone diagonal in a rigid parallelogram: soft while it unbends, stiff once it is straight."""
    made = truss_finger(fm.strip([(0, 0), (18, 34), (40, 60)], thickness=6.0, depth=20.0), SOFT)
    push = made.push()
    size = 5.0 if space == PLANE else 10.0
    return fm.Simulation(fm.Scene(made.mechanism), space=space, order=1, size=size, comm=comm), push


def _at_once(space: str, comm: MPI.Comm) -> Iterator[Check]:
    simulation, push = truss(space, comm)
    steps = simulation.load_displacement(push, forces=np.linspace(0.05, 1.0, 20))
    once = simulation.load_displacement(push, forces=[1.0])
    yield deviation("as in twenty steps", once.displacements[-1], steps.displacements[-1], 1e-9)
    held = simulation.load_displacement(push, displacements=once.displacements)
    yield deviation("force when held there", held.forces, 1.0, 1e-7)


def _too_large(space: str, comm: MPI.Comm) -> Iterator[Check]:
    simulation, push = truss(space, comm)
    for load in (100.0, -100.0):
        try:
            frames = simulation.load_displacement(push, forces=[0.5, load]).frames
            said = ""
        except fm.EquilibriumError as error:
            frames, said = (*error.frames, error.last), str(error)
        yield Fact(
            "reached, or an error that says how far it got", frames[-1].force == load or "the last one is at" in said
        )
        yield Fact("the frames before are kept", frames[0].force == 0.5)
        numbers = [number for frame in frames for number in (frame.force, frame.displacement, frame.strain_energy)]
        yield Fact("all numbers finite", bool(np.all(np.isfinite(numbers))))
        residuals = [frame.residuals[-1] for frame in frames]
        yield Deviation("residual of every frame", max(residuals), 1e-9)


CASES = (
    HardCase("whole load at once", "a stiffening finger, its first sample the last one", _at_once),
    HardCase("load a hundred times too large", "100 N on a finger made for 1 N, pushed and pulled", _too_large),
)
