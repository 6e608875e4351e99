"""What each choice in the solver is worth, measured on the claw: quadrature, predictor, factor, BLAS, ranks.

    OPENBLAS_NUM_THREADS=1 python3 demos/performance.py [--space SPACE] [--size MM] [--out DIR]

Prints a table of variants, each beside the default: seconds per frame, Newton iterations, and how far the last
displacement moves. Medians over the frames of one curve.
"""

import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

import claw
from common import parse
from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.elasticity import Quadrature
from fenicsmech.equilibrium import Constant, Factor, Hermite, LoadControl, Tangent
from fenicsmech.report import format_table

REFERENCE_BLAS = [Path("/usr/lib/x86_64-linux-gnu/blas"), Path("/usr/lib/x86_64-linux-gnu/lapack")]


def curve_of(demo, **choices):
    """The claw's curve with some choices changed."""
    scene, grasp = claw.describe()
    sim = fm.Simulation(scene, space=demo.options.space, order=demo.options.order, size=demo.options.size, **choices)
    return sim, sim.load_displacement(grasp, forces=claw.FORCES)


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
    newton = sim.newton(curve.force_part)
    system, frame = newton.system, curve.frames[-1]
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


def main():
    demo = parse("performance", __doc__.splitlines()[0], size=1.73, quick_size=3.0)
    sim, default = curve_of(demo)
    reference = default.frames[-1].displacement
    rows = [row("default", default, reference)]
    for predictor in (Constant(), Tangent(), Hermite()):
        rows.append(row(f"predictor: {type(predictor).__name__}", curve_of(demo, predictor=predictor)[1], reference))
    for degree in (2, 3, 4, 5):
        rows.append(row(f"quadrature degree {degree}", curve_of(demo, quadrature=Quadrature(degree))[1], reference))
    headers = ("variant", "s per frame", "iterations", "assemble [s/iteration]", "factor [s/iteration]", "displacement")
    demo.say(format_table(headers, rows))
    demo.say(format_table(("factor of the KKT matrix", "seconds"), factors(sim, default)))
    if all(folder.is_dir() for folder in REFERENCE_BLAS):
        reference_blas = dict(os.environ, LD_LIBRARY_PATH=":".join(map(str, REFERENCE_BLAS)))
        command = [sys.executable, "demos/claw.py", "--space", demo.options.space, "--size", str(demo.options.size)]
        for name, environment in (("optimised", dict(os.environ)), ("reference", reference_blas)):
            done = subprocess.run(
                [*command, "--out", str(demo.folder / name)],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            line = next(line for line in done.stdout.splitlines() if line.startswith("frame_median"))
            demo.say(f"{name} BLAS: {line.split(',')[0]}")


if __name__ == "__main__":
    main()
