"""Larger than one factor can hold: conjugate gradients over linear displacements against the factor, on ever finer
meshes of the claw.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.large [--sizes MM …] [--factor-up-to UNKNOWNS] [--compare]
    mpirun -n 2 python3 -m benchmarks.large

One row per mesh, of a whole curve with its stability: conjugate gradients in the last solve, Newton iterations,
processor seconds for each of them (assembly and everything else included) and gigabytes with either solver, and the
largest relative difference between the two curves; then the exponents of time by unknowns. With --compare another
table, at the last equilibrium: one system on two levels against algebraic multigrid (PETSc's GAMG, hypre's BoomerAMG)
on the finite elements and the Schur complement on all else, see ``schur``.
"""

import gc
from dataclasses import dataclass, field
from math import log
from time import process_time

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import Direct, LinearMethod, LinearSolver, LoadControl, PrimalDualNewton, TwoLevel
from fenicsmech.mechanism import Force
from fenicsmech.report import format_table
from fenicsmech.simulation import Curve

from .mechanisms import mechanism
from .schur import Multigrid, SchurSolver
from .table import command, publish

SIZES = [1.73, 1.15, 0.9, 0.68]  # mm: 16 000 to 240 000 unknowns; 0.53 gives half a million
FORCES, STEP, EXACT, REPEATS = [1.0, 2.0], 1e-6, 1e-12, 2
SMALL = 20_000  # unknowns up to which the Schur complement is formed in whole
HEADERS = (
    "unknowns",
    "iterations",
    "Newton",
    "two levels [s]",
    "factor [s]",
    "two levels [GB]",
    "factor [GB]",
    "difference",
)
COMPARED = (
    "unknowns",
    "solver",
    "iterations",
    "setup [s]",
    "solve [s]",
    "solves per system",
    "system [s]",
    "difference",
)


@dataclass(frozen=True)
class Kept(LinearMethod):
    """Another linear method whose solvers can be asked afterwards."""

    method: LinearMethod
    solvers: list = field(default_factory=list)

    def solver(self, system):
        self.solvers.append(self.method.solver(system))
        return self.solvers[-1]


@dataclass
class Run:
    """A curve: seconds per Newton iteration, the number of these, displacements, and the linear solver."""

    simulation: fm.Simulation
    force: Force
    curve: Curve
    seconds: float
    iterations: int
    linear: LinearSolver

    @classmethod
    def of(cls, size: float, method: LinearMethod) -> "Run":
        """With elements of ``size``."""
        claw = mechanism("claw")
        scene, grasp = claw.scene, claw.force
        kept = Kept(method)
        sim = fm.Simulation(scene, space="3d", size=size, solver=PrimalDualNewton(linear=kept))
        sim.load_displacement(grasp, forces=[0.0])  # compiles, finds patterns
        start = process_time()
        curve = sim.load_displacement(grasp, forces=FORCES)
        spent = MPI.COMM_WORLD.allreduce(process_time() - start, op=MPI.MAX)
        iterations = sum(frame.iterations for frame in curve.frames)
        return cls(sim, grasp, curve, spent / iterations, iterations, kept.solvers[-1])

    @property
    def memory(self) -> float:
        return 1e-9 * self.linear.memory

    @property
    def system(self):
        """The equations at the last equilibrium, and their KKT matrix."""
        system, state = self.simulation.solver(self.force).system, self.curve.frames[-1].state
        control = LoadControl(FORCES[-1])
        system.load(state)
        system.linearise(state, control, system.residual(state, control))
        return system, system.kkt.matrix(), system.travel_gradient(system.controlled, state)


def seconds(action) -> float:
    """Of the processor, for one call."""
    start = process_time()
    action()
    return process_time() - start


def measure(options, size: float) -> tuple[tuple, list[tuple]]:
    """A row of the first table, and those of the second."""
    run = Run.of(size, TwoLevel())
    system, matrix, _ = run.system
    unknowns = matrix.getSize()[0]
    known = unknowns, run.linear.iterations[-1], run.iterations, run.seconds, run.memory
    found = np.array(run.curve.displacements)
    compared = compare(run) if options.compare else []
    del run, system, matrix
    gc.collect()
    factor = Run.of(size, Direct()) if unknowns <= options.factor_up_to else None
    difference = None if factor is None else float(np.max(np.abs(found / factor.curve.displacements - 1.0)))
    return (*known[:4], factor and factor.seconds, known[4], factor and factor.memory, difference), compared


def compare(run: Run) -> list[tuple]:
    """The rows of one mesh: two levels, and either multigrid."""
    system, matrix, right = run.system
    unknowns, two = matrix.getSize()[0], TwoLevel().solver(system)
    two.refactor()
    expected = right.duplicate()
    two.solve(right, expected, EXACT)
    setup = min(seconds(two.refactor) for _ in range(REPEATS))
    solve = min(seconds(lambda: two.solve(right, right.duplicate(), STEP)) for _ in range(REPEATS))
    rows = [(unknowns, "two levels", two.iterations[-1], setup, solve, 1, setup + solve, None)]
    for multigrid in Multigrid:
        schur = SchurSolver(system, matrix, multigrid)
        setup = seconds(schur.setup)
        solve = seconds(lambda schur=schur: schur.column(schur.columns[0], STEP))
        iterations, difference = schur.iterations[-1], None
        if unknowns <= SMALL:
            x = right.duplicate()
            schur.solve(right, x)
            difference = (x - expected).norm() / expected.norm()
        count = len(schur.columns) + 2
        rows.append((unknowns, multigrid.title, iterations, setup, solve, count, setup + count * solve, difference))
    return rows


def exponents(rows: list[tuple]) -> str:
    """Of time by unknowns, from the first mesh to the last that both solvers did."""
    both = [row for row in rows if row[4] is not None]
    if len(both) < 2:
        return ""
    first, *_, last = both

    def exponent(of):
        return log(of(last) / of(first)) / log(last[0] / first[0])

    found = {
        "two levels": exponent(lambda row: row[3]),
        "factor": exponent(lambda row: row[4]),
        "the faster of both": exponent(lambda row: min(row[3], row[4])),
    }
    return "exponents of time by unknowns: " + ", ".join(f"{name} {e:.2f}" for name, e in found.items())


def main():
    parser = command(__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES, metavar="MM", help="element sizes")
    parser.add_argument("--factor-up-to", type=int, default=300_000, metavar="UNKNOWNS", help="most for the factor")
    parser.add_argument("--compare", action="store_true", help="algebraic multigrid too (one process)")
    options = parser.parse_args()
    rows, compared = [], []
    for size in options.sizes:
        row, others = measure(options, size)
        rows.append(row)
        compared += others
    text = "\n".join([format_table(HEADERS, rows, digits=3), "", exponents(rows)])
    if compared:
        text += "\n\n" + format_table(COMPARED, compared, digits=3)
    if MPI.COMM_WORLD.rank == 0:
        publish("large", text, write=options.write)


if __name__ == "__main__":
    main()
