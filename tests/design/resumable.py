"""A small optimisation as a program that can be killed and resumed.

    python3 -m tests.design.resumable FOLDER [--resume]

FOLDER gets a checkpoint after each iteration, which takes a while, and the result; iterations are printed.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Quadratic, Regulariser

from .mechanisms import truss


@dataclass(frozen=True)
class Slow(Regulariser):
    """Nothing, but it takes its time."""

    seconds: float = 0.1

    def around(self, rest, placement):
        time.sleep(self.seconds)
        return lambda p: Quadratic.zero(len(p))


class Logged(fm.LevenbergMarquardt):
    """Prints the number of each iterate after it has been seen."""

    def minimise(self, problem, start, *, watch):
        def tell(iterate):
            watch(iterate)
            print(iterate.number, flush=True)

        return super().minimise(problem, start, watch=tell)


def main(folder: Path, *, resume: bool) -> None:
    comm = MPI.COMM_WORLD
    (folder / f"process-{comm.rank}").write_text(str(os.getpid()))
    case = truss((0.1, 2.0), (0.4, 3.2))
    problem = fm.DesignProblem(
        case.simulate(comm=comm),
        case.designs,
        targets=case.targets,
        regulariser=Slow() + fm.ShapeBounds() + 1e-4 * fm.StayClose(),
    )
    result = problem.optimise(optimiser=Logged(), checkpoint=folder / "checkpoint.json", resume=resume)
    result.save(folder / "result.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]), resume="--resume" in sys.argv[2:])
