"""The curved beam of Qiu, Lang and Slocum, half of it: from a clamp to a shuttle, which slides across without turning.

    w(x) = ½ h (1 − cos πx/l),    and with an imperfection ε t of the next mode ½ ε t (1 − cos 2πx/l).

Perfect, it is pushed along its first mode until it bifurcates, and follows that mode on the unstable path. With an
imperfection it turns into the next mode, through one limit point and back through another.

Source: Qiu, Lang & Slocum (doi:10.1109/JMEMS.2004.825308).
"""

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..oracles import beam, centreline

SPAN, RISE, DEPTH = 50.0, 3.0, 5.0
CLAMP = 1.0  # length of each clamp, half of which is within the span
NYLON = fm.Material("nylon", 1770.0, 0.42)


def points(ratio: float, imperfection: float) -> np.ndarray:
    """Points of the centreline of a beam of thickness h / ``ratio``, (n, 2)."""
    x = np.linspace(0.0, SPAN, 33)
    second = 0.5 * imperfection * RISE / ratio * (1.0 - np.cos(2.0 * np.pi * x / SPAN))
    return np.column_stack([x, 0.5 * RISE * (1.0 - np.cos(np.pi * x / SPAN)) + second])


def curved_beam(
    ratio: float, imperfection: float = 0.0, *, cells: float = 2.0, comm: MPI.Comm = MPI.COMM_SELF
) -> tuple[fm.Simulation, Force]:
    """The simulation and the force that pushes the shuttle; ``cells`` elements lie across the beam."""
    line, thickness = points(ratio, imperfection), RISE / ratio
    mechanism = fm.Mechanism("curved beam")
    base, shuttle = mechanism.rigid("base", fixed=True), mechanism.rigid("shuttle")
    bow = mechanism.flexible("bow", fm.strip(line, thickness=thickness, depth=DEPTH), NYLON)
    clamp = fm.Rectangle(CLAMP, 1.5 * thickness)
    mechanism.weld(base, bow, at=tuple(line[0]), region=clamp)
    mechanism.weld(bow, shuttle, at=tuple(line[-1]), region=clamp)
    mechanism.prismatic(base, shuttle, at=tuple(line[-1]), axis=(0, 1))
    push = mechanism.force(on=shuttle, at=tuple(line[-1]), direction=(0, -1), name="push")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=thickness / cells, comm=comm)
    return simulation, push


def beam_forces(ratio: float, imperfection: float, displacements: np.ndarray) -> np.ndarray:
    """Forces of the geometrically exact beam between the clamps, one displacement after the other."""
    whole = centreline.through(points(ratio, imperfection).tolist())
    section = beam.Section.rectangle(young=NYLON.law.E, poisson=NYLON.law.nu, thickness=RISE / ratio, depth=DEPTH)
    line = beam.Beam(whole.trimmed(0.5 * CLAMP, 0.5 * CLAMP), section)
    forces, solution = [], None
    for displacement in displacements:
        end = beam.End(x=0.0, y=-displacement, rotation=0.0)
        solution = beam.solve(line, beam.CLAMPED, end, initial=solution)
        forces.append(-solution.end.force[1])
    return np.array(forces)
