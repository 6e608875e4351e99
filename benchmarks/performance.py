"""The worth of each choice in the solver, measured on the claw: quadrature, predictor, factor, BLAS, ranks.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.performance [--space SPACE] [--size MM]

Prints a table of variants, each compared with the default: seconds per frame, Newton iterations, and how far the last
displacement moves. Medians over the frames of one curve.
"""

import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.continuation import ConstantPredictor, HermitePredictor, TangentPredictor
from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import Factor, LoadControl
from fenicsmech.report import format_table

from .mechanisms import mechanism
from .table import ROOT, command, publish

REFERENCE_BLAS = [Path("/usr/lib/x86_64-linux-gnu/blas"), Path("/usr/lib/x86_64-linux-gnu/lapack")]


def curve_of(options, **choices):
    """The claw's curve with some choices changed."""
    claw = mechanism("claw")
    sim = fm.Simulation(claw.scene, space=options.space, size=options.size or claw.size, **choices)
    return sim, *claw.curves(sim)


def row(name, curve, reference):
    """One line of the table: the first frame carries no load and is left out."""
    frames = curve.frames[1:]
    shift = curve.frames[-1].displacement / reference - 1.0
    return (
        name,
        median(f.seconds for f in frames),
        sum(f.iterations for f in frames),
        median(f.phases["assemble"] / f.iterations for f in frames),
        median(f.phases["factor"] / f.iterations for f in frames),
        f"{shift:+.1e}",
    )


def timed(action, repeats=5):
    """Median seconds of ``action``."""
    seconds = []
    for _ in range(repeats):
        start = perf_counter()
        action()
        seconds.append(perf_counter() - start)
    return median(seconds)


def factors(sim, curve):
    """Seconds to factor the KKT matrix of the last frame: symmetric or not, with and without the analysis."""
    system, frame = sim.solver(curve.part).system, curve.frames[-1]
    control = LoadControl(frame.force)
    system.load(frame.state)
    system.linearise(frame.state, control, system.residual(frame.state, control))
    matrix = system.kkt.matrix()
    kept = Factor(matrix)
    kept.refactor()

    def again():
        matrix.stateIncrease()  # marks the values as new, as a Newton iteration does
        kept.refactor()

    def unsymmetric():
        solver = PETSc.KSP().create(matrix.comm)
        solver.setOperators(matrix)
        solver.getPC().setType(PETSc.PC.Type.LU)
        solver.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        solver.getPC().setUp()

    return [
        ("LDLT, analysis kept (default)", timed(again)),
        ("LDLT, analysed anew", timed(lambda: Factor(matrix).refactor())),
        ("LU, analysed anew", timed(unsymmetric)),
    ]


def blas(options):
    """Seconds per load step with the optimised BLAS and with the reference one, where that is installed."""
    if not all(folder.is_dir() for folder in REFERENCE_BLAS):
        return
    reference = dict(os.environ, LD_LIBRARY_PATH=":".join(map(str, REFERENCE_BLAS)))
    program = [sys.executable, "-m", "benchmarks.frames", "claw", "--space", options.space]
    program += ["--size", str(options.size)] if options.size else []
    for name, environment in (("optimised", dict(os.environ)), ("reference", reference)):
        done = subprocess.run(program, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        row = next(line for line in done.stdout.splitlines() if line.startswith("| claw"))
        yield name, float(row.split("|")[-3])


def main():
    parser = command(__doc__)
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress"), default="3d")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of the demo)")
    options = parser.parse_args()
    sim, default = curve_of(options)
    reference = default.frames[-1].displacement
    rows = [row("default", default, reference)]
    for predictor in (ConstantPredictor(), TangentPredictor(), HermitePredictor()):
        rows.append(row(f"predictor: {type(predictor).__name__}", curve_of(options, predictor=predictor)[1], reference))
    for degree in (2, 3, 4, 5):
        rows.append(row(f"quadrature degree {degree}", curve_of(options, quadrature=Quadrature(degree))[1], reference))
    headers = ("variant", "s per frame", "iterations", "assemble [s/iteration]", "factor [s/iteration]", "displacement")
    tables = [
        format_table(headers, rows),
        format_table(("factor of the KKT matrix", "seconds"), factors(sim, default)),
        format_table(("BLAS", "s per frame"), list(blas(options))),
    ]
    publish("performance", "\n\n".join(tables), write=options.write)


if __name__ == "__main__":
    main()
