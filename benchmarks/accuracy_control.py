"""Accuracy control against an exhaustive search: errors that remain, and seconds spent.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.accuracy_control [truss|claw|klann …] [--accuracy A …] [--repeats N]
                                                                  [--levels N]

For each mechanism and accuracy: the fidelity level that Simulation(scene, accuracy=A) chose, the bound on the error of
its corrected results, their true error (against the finest level with its estimate added), with and without the
correction; seconds from description to curve (levels that were tried and left, and estimates, included; forms are
compiled before), and the same over those of the cheapest level that an exhaustive search finds, whose results are not
corrected.
"""

from time import perf_counter

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRESS
from fenicsmech.estimates import AccuracyControl, fidelity_levels
from fenicsmech.report import format_table

from .mechanisms import NAMES, mechanism
from .table import command, publish

ACCURACIES = (0.05, 0.01, 0.002)


class Case:
    """A demo's mechanism, drawn, and a curve in five samples up to its largest load."""

    def __init__(self, name):
        case = mechanism(name)
        self.scene, self.force, self.configuration = case.scene, case.force, case.middle
        self.forces = [factor * case.loads[-1] for factor in (0.2, 0.4, 0.6, 0.8, 1.0)]

    def curve(self, simulation):
        return simulation.load_displacement(self.force, forces=self.forces, configuration=self.configuration)

    def at(self, level):
        """A simulation at a fidelity level."""
        fidelity = AccuracyControl(self.scene, 1.0, None, fm.MixedFormulation()).fidelity(level)
        return fm.Simulation(
            self.scene,
            space=fidelity.model.name,
            order=fidelity.order,
            size=fidelity.sizes,
            layers=fidelity.layers,
            segments=fidelity.segments,
        )


def timed(make, case, choice):
    """The simulation and curve that ``make`` gives, and its seconds."""
    start = perf_counter()
    simulation, curve = make(case, choice)
    return simulation, curve, perf_counter() - start


def race(case, accuracy, level, repeats):
    """The simulation and curve by accuracy control, and the least seconds of these and of a level.

    They take turns, so that other work of the machine slows both.
    """
    seconds = []
    for _ in range(repeats + 1):  # the first one compiles
        *found, by_choice = timed(by_accuracy, case, accuracy)
        seconds.append((by_choice, timed(at_level, case, level)[2]))
    return *found, *map(min, zip(*seconds[1:], strict=True))


def at_level(case, level):
    simulation = case.at(level)
    return simulation, case.curve(simulation)


def by_accuracy(case, accuracy):
    simulation = fm.Simulation(case.scene, accuracy=accuracy)
    return simulation, case.curve(simulation)


def main():
    parser = command(__doc__)
    parser.add_argument("mechanisms", nargs="*", default=NAMES, help="truss, claw, klann (default: all)")
    parser.add_argument("--accuracy", type=float, nargs="+", default=ACCURACIES, help="default: 0.05 0.01 0.002")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the fastest count (default: 3)")
    parser.add_argument("--levels", type=int, help="of half the depth, from coarse to fine (default: all)")
    options = parser.parse_args()
    if MPI.COMM_WORLD.size > 1:
        parser.error("it goes by the time of one process; run it without mpirun")
    rows, reports = [], []
    for name in options.mechanisms:
        case = Case(name)
        spatial = fidelity_levels(MID_PLANE_SYMMETRIC)[: options.levels]
        *levels, finest_level = [*fidelity_levels(PLANE_STRESS), *spatial]
        # the second run does not compile; the finest is too slow to count
        brute = [(level, *[timed(at_level, case, level) for _ in range(2)][1]) for level in levels]
        brute.append((finest_level, *timed(at_level, case, finest_level)))
        _, finest, curve, _ = brute[-1]
        reference = curve.displacements[-1] + curve.error_estimates()[-1]
        for accuracy in options.accuracy:
            good = [row for row in brute if abs(row[2].displacements[-1] / reference - 1.0) <= accuracy]
            cheapest = min(good, key=lambda row: row[3])[0]
            simulation, curve, seconds, least = race(case, accuracy, cheapest, options.repeats)
            trial, error = simulation.choice.chosen, abs(curve.corrected[-1] / reference - 1.0)
            computed = curve.displacements[-1]
            rows.append(
                (
                    name,
                    f"{accuracy:.1%}",
                    trial.level.name,
                    f"{trial.error:.2%}",
                    f"{error:.2%}",
                    f"{abs(computed / reference - 1.0):.2%}",
                    seconds,
                    cheapest.name,
                    seconds / least,
                )
            )
            reports.append(f"{name}: {simulation.choice}")
    headers = ("mechanism", "asked", "chosen", "at most", "true error", "uncorrected", "seconds")
    headers += ("cheapest that suffices", "ratio")
    print("\n".join(reports))
    publish("accuracy_control", format_table(headers, rows), write=options.write)


if __name__ == "__main__":
    main()
