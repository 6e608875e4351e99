"""Seconds per load step of the demos' mechanisms as drawn.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.frames [truss|claw|klann …] [--space SPACE] [--size MM]
    mpirun -n 2 python3 -m benchmarks.frames

The median over the loaded steps of all curves of a demo, after a first solve that compiles the forms.
"""

import resource
from statistics import median

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

HEADERS = ("mechanism", "unknowns", "last displacement [mm]", "iterations", "s per frame", "peak memory [MB]")


def row(name, space, size):
    """One line of the table."""
    case = mechanism(name)
    sim = fm.Simulation(case.scene, space=space, size=size or case.size)
    sim.load_displacement(case.force, forces=case.loads[:2])  # compiles
    curves = case.curves(sim)
    frames = [frame for curve in curves for frame in curve.frames if frame.force != 0.0]
    peak = sim.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.MAX) / 1024.0
    unknowns = sim.model.rigid_dofs + sim.model.flexible_dofs
    iterations = sum(frame.iterations for frame in frames)
    return name, unknowns, curves[-1].displacements[-1], iterations, median(f.seconds for f in frames), round(peak)


def main():
    parser = command(__doc__)
    parser.add_argument("mechanisms", nargs="*", default=NAMES, help="truss, claw, klann (default: all)")
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress", "plane-strain"), default="3d")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    options = parser.parse_args()
    rows = [row(name, options.space, options.size) for name in options.mechanisms]
    if MPI.COMM_WORLD.rank == 0:
        name = f"frames_{options.space}_{MPI.COMM_WORLD.size}"
        publish(name, format_table(HEADERS, rows), write=options.write)


if __name__ == "__main__":
    main()
