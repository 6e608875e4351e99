"""A shallow arch between two pins, pushed down at its crown: it snaps through without leaving its symmetry."""

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..oracles import beam, centreline

SPAN, RISE, THICKNESS, DEPTH = 60.0, 0.9, 1.0, 2.0
SIZE = {"plane-stress": 0.5 * THICKNESS, "3d": THICKNESS}
STEEL = fm.Material("steel", 1000.0, 0.3)
POINTS = [(x, 4.0 * RISE * x / SPAN * (1.0 - x / SPAN)) for x in np.linspace(0.0, SPAN, 9)]
DISPLACEMENTS = np.linspace(0.0, 2.4 * RISE, 25)


def arch(comm: MPI.Comm = MPI.COMM_SELF, *, space: str = "plane-stress") -> tuple[fm.Simulation, Force]:
    """The simulation and the force on a point of the flexible link."""
    mechanism = fm.Mechanism("arch")
    base = mechanism.rigid("base", fixed=True)
    bow = mechanism.flexible("bow", fm.strip(POINTS, thickness=THICKNESS, depth=DEPTH), STEEL)
    mechanism.revolute(base, bow, at=POINTS[0], interface_radius=0.5 * THICKNESS)
    mechanism.revolute(base, bow, at=POINTS[-1], interface_radius=0.5 * THICKNESS)
    push = mechanism.force(on=bow, at=(0.5 * SPAN, RISE), direction=(0, -1), name="push")
    return fm.Simulation(fm.Scene(mechanism), space=space, size=SIZE[space], comm=comm), push


def lowered(model, by: float) -> None:
    """Makes the arch of ``model`` lower by a fraction of its rise."""
    positions = model.elastic.shape.function_space.tabulate_dof_coordinates()
    fall = np.zeros((len(positions), 2))
    fall[:, 1] = -by * RISE * np.sin(np.pi * positions[:, 0] / SPAN)
    model.reshape(fall.ravel())


def beam_forces(displacements: np.ndarray) -> np.ndarray:
    """Forces of the symmetric beam, elastic from the rim of the pin's disc to the crown."""
    whole = centreline.through(POINTS)
    half = whole.trimmed(0.5 * THICKNESS, 0.5 * whole.length)
    section = beam.Section.rectangle(young=STEEL.law.E, poisson=STEEL.law.nu, thickness=THICKNESS, depth=DEPTH)
    line, forces, solution = beam.Beam(half, section, start_pin=POINTS[0]), [], None
    for displacement in displacements:
        solution = beam.solve(line, beam.PINNED, beam.End(x=0.0, y=-displacement, rotation=0.0), initial=solution)
        forces.append(-2.0 * solution.end.force[1])
    return np.array(forces)
