"""What stopping early saves: in the corrections of equilibria, and in the last iterations of an optimisation.

    OPENBLAS_NUM_THREADS=1 python3 demos/stopping.py [--space SPACE] [--size MM] [--mechanisms NAME …] [--repeats N]

Two tables. Equilibria: the curves of each mechanism by ways to end Newton's iteration, taking turns; factors counted,
processor time over that of the strictest way (median over the turns), and how far displacements move over the
estimated error of the elements (the largest of all frames). Designs: to an explicit tolerance, and to what the elements
can tell; in space both start from the optimum in plane stress.
"""

import argparse
from statistics import median
from time import process_time

import claw
import klann
import numpy as np
import truss
from task import curves, scene_and_task

import fenicsmech as fm
from fenicsmech.report import format_table

MECHANISMS = {"claw": claw, "truss": truss, "klann": klann}
STRICT = "1e-10, a factor for each correction"
WAYS = {
    STRICT: {"tolerance": 1e-10, "stale": 0.0},
    "1e-10, last corrections with the factor at hand": {"tolerance": 1e-10},
    "1e-9, the same (default)": {},
    "1e-6, the same": {"tolerance": 1e-6},
    "1e-4, the same": {"tolerance": 1e-4},
}
TOLERANCE = 5e-3  # of an optimisation
OF_EQUILIBRIA = ("mechanism", "residual over forces", "factors", "time", "moves, over the error of elements")
OF_DESIGNS = (
    "mechanism",
    "tolerance",
    "iterations",
    "evaluations",
    "time",
    "worst target [%]",
    "error of elements [%]",
    "moves, over that",
)


def equilibria(name, space, size, repeats):
    """Rows of the first table."""
    demo = MECHANISMS[name]
    scene, task = scene_and_task(demo)
    sims = {
        way: fm.Simulation(scene, space=space, size=size or demo.SIZE, solver=fm.PrimalDualNewton(**options))
        for way, options in WAYS.items()
    }
    seconds = {way: [] for way in WAYS}
    for turn in range(repeats + 1):  # the first one compiles
        found, spent = {}, {}
        for way, sim in sims.items():
            start = process_time()
            found[way] = curves(sim, task)
            spent[way] = process_time() - start
        if turn:
            for way in WAYS:
                seconds[way].append(spent[way] / spent[STRICT])
    estimates = np.concatenate([sims[STRICT].error_estimates(curve) for curve in found[STRICT]])
    exact = displacements(found[STRICT])
    loaded = exact != 0.0
    for way in WAYS:
        moved = np.abs(displacements(found[way]) - exact)[loaded] / np.abs(estimates[loaded])
        factors = sum(frame.iterations for curve in found[way] for frame in curve.frames)
        yield name, way, factors, median(seconds[way]), f"{moved.max():.0e}"


def displacements(found):
    """Of all frames of curves."""
    return np.concatenate([curve.displacements for curve in found])


def designs(name, space, size):
    """Rows of the second table."""
    demo = MECHANISMS[name]
    scene, task = scene_and_task(demo)

    def optimum(space, start, optimiser):
        sim = fm.Simulation(scene, space=space, size=size or demo.SIZE)
        return sim, fm.DesignProblem(sim, task.designs, targets=task.targets).optimise(start=start, optimiser=optimiser)

    start = None if space == "plane-stress" else optimum("plane-stress", None, None)[1]
    exact = optimum(space, start, fm.LevenbergMarquardt(tolerance=TOLERANCE))[1]
    sim, early = optimum(space, start, fm.LevenbergMarquardt())
    errors = [
        abs(sim.error_estimates(curve)[-1] / target.displacement)
        for target in task.targets
        for curve in [sim.load_displacement(task.force, forces=[target.force], configuration=target.configuration)]
    ]
    moved = [abs(a.error - b.error) for a, b in zip(early.targets, exact.targets, strict=True)]
    for way, result in ((f"{TOLERANCE:g}", exact), ("what elements can tell (default)", early)):
        yield (
            name,
            way,
            result.iterations,
            result.evaluations,
            result.seconds / exact.seconds,
            100.0 * result.worst_error,
            100.0 * max(errors),
            "" if result is exact else f"{max(np.divide(moved, errors)):.1g}",
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress"), default="plane-stress")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    parser.add_argument("--mechanisms", nargs="+", choices=list(MECHANISMS), default=list(MECHANISMS))
    parser.add_argument("--repeats", type=int, default=3, help="turns that each way takes (default 3)")
    options = parser.parse_args()
    rows = [r for name in options.mechanisms for r in equilibria(name, options.space, options.size, options.repeats)]
    print(format_table(OF_EQUILIBRIA, rows), flush=True)
    rows = [row for name in options.mechanisms for row in designs(name, options.space, options.size)]
    print(format_table(OF_DESIGNS, rows))


if __name__ == "__main__":
    main()
