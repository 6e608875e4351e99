"""The dial against brute force: is it right, and what does it cost?

    OPENBLAS_NUM_THREADS=1 python3 demos/dial.py [truss|claw|klann …] [--accuracy A …] [--repeats N]

For each mechanism and accuracy: the rung that Simulation(scene, accuracy=A) chose, what its corrected results may be
off by, what they are off by (against the finest rung with its estimate added), without the correction too; seconds
from description to curve (rungs that were tried in vain, and estimates, included; forms are compiled before), and the
same over those of the cheapest rung that brute force finds, whose results are not corrected.
"""

import argparse
import importlib
from time import perf_counter

from mpi4py import MPI
from task import scene_and_task

import fenicsmech as fm
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRESS
from fenicsmech.report import format_table
from fenicsmech.simulation import Dial, family

MECHANISMS = ("truss", "claw", "klann")
ACCURACIES = (0.05, 0.01, 0.002)


class Case:
    """A demo's mechanism, drawn, and a curve in five samples up to its largest load."""

    def __init__(self, name):
        module = importlib.import_module(name)
        self.scene, task = scene_and_task(module)
        self.force = task.force
        self.configuration = task.configurations[len(task.configurations) // 2]
        self.forces = [share * task.loads[-1] for share in (0.2, 0.4, 0.6, 0.8, 1.0)]

    def curve(self, simulation):
        return simulation.load_displacement(self.force, forces=self.forces, configuration=self.configuration)

    def at(self, rung):
        """A simulation on a rung of the dial."""
        fidelity = Dial(self.scene, 1.0, None, fm.MixedFormulation()).fidelity(rung)
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


def race(case, accuracy, rung, repeats):
    """The dial's simulation and curve, and the least seconds of the dial and of a rung.

    They take turns, so that what else the machine does slows both.
    """
    seconds = []
    for _ in range(repeats + 1):  # the first one compiles
        *found, by_choice = timed(by_dial, case, accuracy)
        seconds.append((by_choice, timed(on_rung, case, rung)[2]))
    return *found, *map(min, zip(*seconds[1:], strict=True))


def on_rung(case, rung):
    simulation = case.at(rung)
    return simulation, case.curve(simulation)


def by_dial(case, accuracy):
    simulation = fm.Simulation(case.scene, accuracy=accuracy)
    return simulation, case.curve(simulation)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mechanisms", nargs="*", default=MECHANISMS, help="truss, claw, klann (default: all)")
    parser.add_argument("--accuracy", type=float, nargs="+", default=ACCURACIES, help="default: 0.05 0.01 0.002")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the fastest count (default: 3)")
    options = parser.parse_args()
    if MPI.COMM_WORLD.size > 1:
        parser.error("it goes by the time of one process; run it without mpirun")
    rows, reports = [], []
    for name in options.mechanisms:
        case = Case(name)
        *rungs, finest_rung = [*family(PLANE_STRESS), *family(MID_PLANE_SYMMETRIC)]
        # the second run does not compile; the finest is too slow to count
        brute = [(rung, *[timed(on_rung, case, rung) for _ in range(2)][1]) for rung in rungs]
        brute.append((finest_rung, *timed(on_rung, case, finest_rung)))
        _, finest, curve, _ = brute[-1]
        reference = curve.displacements[-1] + finest.error_estimates(curve)[-1]
        for accuracy in options.accuracy:
            good = [row for row in brute if abs(row[2].displacements[-1] / reference - 1.0) <= accuracy]
            cheapest = min(good, key=lambda row: row[3])[0]
            simulation, curve, seconds, least = race(case, accuracy, cheapest, options.repeats)
            trial, error = simulation.choice.chosen, abs(curve.displacements[-1] / reference - 1.0)
            computed = curve.frames[-1].displacement
            rows.append(
                (
                    name,
                    f"{accuracy:.1%}",
                    trial.rung.name,
                    f"{trial.error:.2%}",
                    f"{error:.2%}",
                    f"{abs(computed / reference - 1.0):.2%}",
                    seconds,
                    cheapest.name,
                    seconds / least,
                )
            )
            reports.append(f"{name}: {simulation.choice}")
    print("\n".join(reports))
    headers = ("mechanism", "asked", "chosen", "at most", "true error", "uncorrected", "seconds")
    headers += ("cheapest that would do", "ratio")
    print(format_table(headers, rows))


if __name__ == "__main__":
    main()
