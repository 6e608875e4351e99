"""Larger than one factor can hold: conjugate gradients over linear displacements beside the factor, on finer and finer
meshes of the claw.

    OPENBLAS_NUM_THREADS=1 python3 demos/large.py [--sizes MM …] [--factor-up-to UNKNOWNS] [--out DIR]
    mpirun -n 2 python3 demos/large.py

One row per mesh, at the equilibrium under 2 N: iterations of a Newton step's solve and of the stability verdict,
seconds and memory of either solver, taken in turns, and the difference between the two solutions. Leaves table.md.
"""

import argparse
from pathlib import Path
from time import perf_counter

import claw
from common import Demo
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import Direct, LoadControl, PrimalDualNewton, TwoLevel
from fenicsmech.report import format_table
from fenicsmech.report.atomic import atomic_write

SIZES = [1.73, 1.15, 0.68]  # mm: 16 000, 60 000 and 260 000 unknowns; 0.53 gives half a million
FORCE, STEP, EXACT, REPEATS = 2.0, 1e-6, 1e-10, 3
HEADERS = (
    "unknowns",
    "iterations",
    "verdict",
    "modes",
    "assembly [s]",
    "two levels [s]",
    "factor [s]",
    "two levels [GB]",
    "factor [GB]",
    "difference",
)


def parse() -> Demo:
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES, metavar="MM", help="element sizes")
    parser.add_argument(
        "--factor-up-to", type=int, default=300_000, metavar="UNKNOWNS", help="no factor of larger systems"
    )
    parser.add_argument("--out", type=Path, default=Path("results") / "large", metavar="DIR", help="folder for files")
    return Demo("large", parser.parse_args(), perf_counter())


def seconds(action) -> float:
    """Of one call, on the slowest rank."""
    MPI.COMM_WORLD.Barrier()
    start = perf_counter()
    action()
    return MPI.COMM_WORLD.allreduce(perf_counter() - start, op=MPI.MAX)


def measure(demo: Demo, size: float) -> tuple:
    """One row of the table."""
    scene, grasp = claw.describe()
    sim = fm.Simulation(scene, space="3d", size=size, solver=PrimalDualNewton(linear=TwoLevel()))
    frame = sim.load_displacement(grasp, forces=[FORCE]).frames[-1]
    system, control = sim.newton(grasp).system, LoadControl(FORCE)
    system.load(frame.state)
    balance = system.balance(frame.state, control)
    matrix = system.kkt(frame.state, control, balance)
    unknowns = matrix.getSize()[0]
    methods = {"two levels": TwoLevel().solver(system, matrix)}
    if unknowns <= demo.options.factor_up_to:
        methods["factor"] = Direct().solver(system, matrix)
    right = system.force_rate(frame.state)
    solutions = {name: right.duplicate() for name in methods}

    def solve(name, tolerance):
        matrix.stateIncrease()  # marks the values as new, as a Newton iteration does
        methods[name].refactor()
        methods[name].solve(right, solutions[name], tolerance)

    taken = {name: [] for name in methods}
    for repeat in range(REPEATS + 1):
        for name in methods:
            spent = seconds(lambda name=name: solve(name, STEP))
            if repeat:  # the first finds the pattern
                taken[name].append(spent)
    assembly = seconds(lambda: system.kkt(frame.state, control, balance))
    two = methods["two levels"]
    iterations, modes = two.iterations[-1], two.inertia().negative - system.joints.rows - 1
    difference = None
    if "factor" in methods:
        for name in methods:
            solve(name, EXACT)
        error = solutions["two levels"] - solutions["factor"]
        difference = error.norm() / solutions["factor"].norm()
        assert modes == methods["factor"].inertia().negative - system.joints.rows - 1
    best = {name: min(spent) for name, spent in taken.items()}
    memory = {name: 1e-9 * method.memory for name, method in methods.items()}
    return (
        unknowns,
        iterations,
        two.probes[-1],
        modes,
        assembly,
        best["two levels"],
        best.get("factor"),
        memory["two levels"],
        memory.get("factor"),
        difference,
    )


def main():
    demo = parse()
    rows = []
    for size in demo.options.sizes:
        rows.append(measure(demo, size))
        demo.say(format_table(HEADERS, rows, digits=3) + "\n")
    if demo.leads:
        with atomic_write(demo.folder / "table.md") as file:
            file.write(format_table(HEADERS, rows, digits=3) + "\n")


if __name__ == "__main__":
    main()
