"""Time saved by stopping early: in the corrections of equilibria, and in the last iterations of an optimisation.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.stopping [--space SPACE] [--size MM] [--mechanisms NAME …]

Two tables. Equilibria: the curves of each mechanism by ways to end Newton's iteration, taking turns; factors counted,
processor time over that of the strictest way (median over the turns), and how far displacements move over the
estimated error of the elements (the largest of all frames). Designs: to an explicit tolerance, and to what the
elements resolve; in space both start from the optimum in plane stress.
"""

from statistics import median
from time import process_time

import numpy as np

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

STRICT = "1e-10, a factor for each correction"
WAYS = {
    STRICT: {"tolerance": 1e-10, "reuse_factor": 0.0},
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
    case = mechanism(name)
    sims = {
        way: fm.Simulation(case.scene, space=space, size=size or case.size, solver=fm.PrimalDualNewton(**options))
        for way, options in WAYS.items()
    }
    seconds = {way: [] for way in WAYS}
    for turn in range(repeats + 1):  # the first one compiles
        found, spent = {}, {}
        for way, sim in sims.items():
            start = process_time()
            found[way] = case.curves(sim)
            spent[way] = process_time() - start
        if turn:
            for way in WAYS:
                seconds[way].append(spent[way] / spent[STRICT])
    estimates = np.concatenate([curve.error_estimates() for curve in found[STRICT]])
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
    case = mechanism(name)

    def optimum(space, start, optimiser):
        sim = fm.Simulation(case.scene, space=space, size=size or case.size)
        on_mesh = {"surrogate": None, "correction": fm.Correction(estimates=False)}
        return sim, case.optimise(sim, start=start, optimiser=optimiser, **on_mesh)

    start = None if space == "plane-stress" else optimum("plane-stress", None, None)[1]
    exact = optimum(space, start, fm.LevenbergMarquardt(tolerance=TOLERANCE))[1]
    sim, early = optimum(space, start, fm.LevenbergMarquardt())
    sim = sim.with_design(early)
    errors = [
        abs(curve.error_estimates()[-1] / target.wanted[0])
        for target in case.targets
        for curve in [
            sim.load_displacement(
                case.force, forces=[target.sample.magnitude], configuration=target.sample.configuration
            )
        ]
    ]
    moved = [abs(a.error - b.error) for a, b in zip(early.targets, exact.targets, strict=True)]
    for way, result in ((f"{TOLERANCE:g}", exact), ("the error of the elements (default)", early)):
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
    parser = command(__doc__)
    parser.add_argument("--space", choices=("3d", "3d-symmetric", "plane-stress"), default="plane-stress")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    parser.add_argument("--mechanisms", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--repeats", type=int, default=3, help="turns that each way takes (default 3)")
    options = parser.parse_args()
    rows = [r for name in options.mechanisms for r in equilibria(name, options.space, options.size, options.repeats)]
    tables = [format_table(OF_EQUILIBRIA, rows)]
    rows = [row for name in options.mechanisms for row in designs(name, options.space, options.size)]
    tables.append(format_table(OF_DESIGNS, rows))
    publish("stopping", "\n\n".join(tables), write=options.write)


if __name__ == "__main__":
    main()
