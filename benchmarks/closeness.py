"""Closeness to the drawn shape and its cost; designs given by parameters without handle positions.

    python3 -m benchmarks.closeness [MECHANISM …] [--size MM]

Plane stress, Levenberg–Marquardt from the drawn design. The worst target error with R_init weighted as by default and
with the paper's weight 1, and the largest change of a target's displacement when the optimum of the default weight is
given by its parameters alone, so that handle positions are found anew.
"""

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

HEADERS = ("mechanism", "worst error, weight 1e-4 [%]", "weight 1 [%]", "parameters alone move targets by [%]")


def row(name, size):
    """One line of the table."""
    case = mechanism(name)
    sim = fm.Simulation(case.scene, space="plane-stress", size=size or case.size)
    problem = fm.DesignProblem(sim, case.designs, targets=case.targets)
    best = problem.optimise()
    close = fm.MeshQuality() + fm.ShapeBounds() + fm.StayClose()
    near = fm.DesignProblem(sim, case.designs, targets=case.targets, regulariser=close).optimise()
    parameters = [value for link in best.links for value in link.parameters]
    anew = sim.with_design(problem.rest_shape(parameters))
    changes = [
        anew.load_displacement(case.force, forces=[t.force], configuration=t.configuration).displacements[0] / found - 1
        for t, found in zip(case.targets, (target.corrected for target in best.targets), strict=True)
    ]
    return name, 100.0 * best.worst_error, 100.0 * near.worst_error, 100.0 * max(map(abs, changes))


def main():
    parser = command(__doc__)
    parser.add_argument("mechanisms", nargs="*", default=NAMES, help="truss, claw, klann (default: all)")
    parser.add_argument("--size", type=float, metavar="MM", help="element size (default: that of each demo)")
    options = parser.parse_args()
    rows = [row(name, options.size) for name in options.mechanisms]
    publish("closeness", format_table(HEADERS, rows), write=options.write)


if __name__ == "__main__":
    main()
