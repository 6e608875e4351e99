"""Levenberg–Marquardt beside BFGS with backtracking, from the drawn design, on all three mechanisms.

    python3 demos/optimisers.py [--size MM] [--limit ITERATIONS]

Plane stress, one table: iterations, objective evaluations, seconds, worst target error, final objective.
"""

import argparse

import claw
import klann
import truss
from task import scene_and_task

import fenicsmech as fm
from fenicsmech.report import format_table

MECHANISMS = {"claw": claw, "truss": truss, "Klann": klann}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    parser.add_argument("--limit", type=int, default=300, help="most iterations (default 300)")
    options = parser.parse_args()
    rows = []
    for name, demo in MECHANISMS.items():
        for optimiser in (fm.LevenbergMarquardt(iterations=options.limit), fm.BFGS(iterations=options.limit)):
            scene, task = scene_and_task(demo)
            sim = fm.Simulation(scene, space="plane-stress", size=options.size or demo.SIZE)
            result = fm.DesignProblem(sim, task.designs, targets=task.targets).optimise(optimiser=optimiser)
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
    print(format_table(HEADERS, rows))


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

if __name__ == "__main__":
    main()
