"""Seconds per load step of the demos' mechanisms as drawn, and whole designs in load steps.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.frames [truss|claw|klann …] [--space SPACE] [--size MM] [--designs]
    mpirun -n 2 python3 -m benchmarks.frames

The median over the loaded steps of all curves of a demo, after a first solve that compiles the forms. With --designs a
second table: the seconds of each optimisation over that median, its surrogate included, and its phases alike.
"""

import resource
from statistics import median

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

DESIGNS = (
    *("mechanism", "frames", "iterations", "evaluations", "rounds", "worst target [%]"),
    *("weights", "handles", "equilibria", "gradients", "estimates", "verification"),
)
HEADERS = ("mechanism", "unknowns", "last displacement [mm]", "iterations", "s per frame", "peak memory [MB]")


def rows(name, space, size, designs):
    """One line of each table."""
    case = mechanism(name)
    sim = fm.Simulation(case.scene, space=space, size=size or case.size)
    sim.load_displacement(case.force, forces=case.loads[:2])  # compiles
    curves = case.curves(sim)
    frames = [frame for curve in curves for frame in curve.frames if frame.force != 0.0]
    peak = sim.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.MAX) / 1024.0
    unknowns = sim.model.rigid_dofs + sim.model.flexible_dofs
    iterations = sum(frame.iterations for frame in frames)
    frame = median(f.seconds for f in frames)
    line = name, unknowns, curves[-1].displacements[-1], iterations, frame, round(peak)
    if not designs:
        return line, None
    result = case.optimise(sim)
    return line, (
        *(name, result.seconds / frame, result.iterations, result.evaluations, len(result.corrections)),
        *(100.0 * result.worst_error, *(result.phases.get(phase, 0.0) / frame for phase in DESIGNS[6:])),
    )


def main():
    parser = command(__doc__)
    parser.add_argument("mechanisms", nargs="*", default=NAMES, help="truss, claw, klann (default: all)")
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress", "plane-strain"), default="3d")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    parser.add_argument("--designs", action="store_true", help="optimise each as its demo does, too")
    options = parser.parse_args()
    found = [rows(name, options.space, options.size, options.designs) for name in options.mechanisms]
    if MPI.COMM_WORLD.rank == 0:
        tables = [format_table(HEADERS, [line for line, _ in found])]
        if options.designs:
            tables.append(format_table(DESIGNS, [design for _, design in found]))
        publish(f"frames_{options.space}_{MPI.COMM_WORLD.size}", "\n\n".join(tables), write=options.write)


if __name__ == "__main__":
    main()
