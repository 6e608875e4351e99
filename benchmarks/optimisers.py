"""Levenberg–Marquardt against BFGS, from the drawn design, on all three mechanisms.

    python3 -m benchmarks.optimisers [MECHANISM …] [--size MM] [--limit ITERATIONS]

Plane stress, one table: iterations, objective evaluations, seconds, worst target error, final objective.
"""

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

HEADERS = (
    "mechanism",
    "parameters",
    "optimiser",
    "iterations",
    "evaluations",
    "seconds",
    "worst error [%]",
    "objective",
    "converged",
)


def main():
    parser = command(__doc__)
    parser.add_argument("mechanisms", nargs="*", default=NAMES, help="truss, claw, klann (default: all)")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    parser.add_argument("--limit", type=int, default=300, help="most iterations (default 300)")
    options = parser.parse_args()
    rows = []
    for name in options.mechanisms:
        for optimiser in (fm.LevenbergMarquardt(iterations=options.limit), fm.BFGS(iterations=options.limit)):
            case = mechanism(name)
            sim = fm.Simulation(case.scene, space="plane-stress", size=options.size or case.size)
            result = case.optimise(sim, optimiser=optimiser)
            rows.append(
                (
                    name,
                    result.parameters,
                    type(optimiser).__name__,
                    result.iterations,
                    result.evaluations,
                    round(result.seconds, 1),
                    100.0 * result.worst_error,
                    result.objective[1],
                    "yes" if result.converged else "no",
                )
            )
    publish("optimisers", format_table(HEADERS, rows), write=options.write)


if __name__ == "__main__":
    main()
