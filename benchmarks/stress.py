"""Recovered peaks of stress against closed forms and fine elements, with their estimated errors; a design with a limit.

    python3 -m benchmarks.stress [--space plane-stress|3d-symmetric]

Elements as large as the link is wide, and half as large. Where no closed form holds, much finer elements of another
code are the reference (``stress_references``); what handbooks say stands beside it.

The claw's design in plane stress, or in the model asked for, without and with a limit of stress, a third below the peak
of the first: iterations, evaluations and processor time, the largest error of its displacements, and the largest stress
with its margin over the limit, on the mesh of the design and in the exported parts with elements a quarter as large.
"""

import time
from collections.abc import Iterator

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.report import format_table

from .mechanisms import mechanism
from .stress_cases import CASES, Case
from .table import command, publish

SPACES = ("plane-stress", "3d-symmetric")
HEADERS = (
    "case", "model", "element size", "peak − reference [%]", "estimated error [%]",
    "peak − that in finer elements [%]", "reference", "handbook − reference [%]",
)  # fmt: skip


def rows(case: Case, space: str) -> Iterator[tuple[object, ...]]:
    """Lines of the table."""
    for size in (case.size, 0.5 * case.size):
        simulation, curve = case.solved(space, size)
        peak, known = curve.frames[-1].peak, case.reference(space, simulation)
        found = peak.value - curve.in_finer_elements().peak.value
        value, name = case.handbook
        yield (
            case.name, space.split("-")[0].replace("plane", "plane stress").replace("3d", "3D"), size,
            100.0 * (peak.value / known - 1.0), 100.0 * peak.error / known, 100.0 * found / known,
            name if case.exact else "fine elements",
            "" if case.exact else f"{100.0 * (value / known - 1.0):.2f}, {name}",
        )  # fmt: skip


DESIGN_HEADERS = (
    "claw", "limit [MPa]", "iterations", "evaluations", "processor time [s]", "displacements − targets [%]",
    "stress − limit [%]", "in the parts [%]",
)  # fmt: skip


def designs(space):
    """Lines of the table of the claw's designs."""
    case = mechanism("claw")
    stress, sample = fm.LargestStress(), case.targets[-1].sample

    def line(name, limit):
        limits = [] if limit is None else [fm.Target(stress, sample, at_most=limit)]
        simulation = fm.Simulation(case.scene, space=space, size=case.size, comm=MPI.COMM_SELF)
        problem = fm.DesignProblem(simulation, case.designs, targets=[*case.targets, *limits])
        start = time.process_time()
        result = problem.optimise()
        seconds = time.process_time() - start
        off = 100.0 * max(abs(own.error) for own in result.targets[: len(case.targets)])
        over = ["", ""]
        if limit is not None:
            part = problem.verify(result, finer=4.0).targets[-1].part
            kept = result.targets[-1].corrected, part.value + part.finer_elements_add
            over = [100.0 * (value / limit - 1.0) for value in kept]
        shown = "" if limit is None else limit
        return result, (name, shown, result.iterations, result.evaluations, seconds, off, *over)

    free, first = line("without a limit", None)
    simulation = fm.Simulation(case.scene, space=space, size=case.size, comm=MPI.COMM_SELF).with_design(free)
    peak = simulation.load_displacement(case.force, forces=case.loads).frames[-1].peak
    return [first, line("a third below its peak", round(peak.value / 1.5, 1))[1]]


def main() -> None:
    parser = command(__doc__)
    parser.add_argument("--space", choices=SPACES, help="one model only")
    options = parser.parse_args()
    if MPI.COMM_WORLD.rank == 0:
        chosen = [options.space] if options.space else SPACES
        found = [row for space in chosen for case in CASES for row in rows(case, space)]
        publish("stress", format_table(HEADERS, found), write=options.write)
        publish("stress_design", format_table(DESIGN_HEADERS, designs(chosen[0])), write=options.write)


if __name__ == "__main__":
    main()
