"""Runs all hard cases and prints their table.

python3 -m tests.hard [PART OF A NAME …] [--write]
mpirun -n 2 python3 -m tests.hard
"""

from __future__ import annotations

import sys
from time import perf_counter

from mpi4py import MPI

from benchmarks.table import command, publish
from fenicsmech.report import format_table

from .case import Check, Deviation, Fact, HardCase
from .cases import CASES

HEADERS = ("case", "what is hard", "in", "what happened", "s")
COMM = MPI.COMM_WORLD


def main() -> int:
    """The number of cases in which something known was not found."""
    parser = command(__doc__)
    parser.add_argument("parts", nargs="*", help="parts of the names of cases (default: all cases)")
    options = parser.parse_args()
    rows, failed = [], 0
    for case in CASES:
        if all(part in case.name for part in options.parts):
            start = perf_counter()
            checks = [check for space in case.spaces for check in _run(case, space)]
            seconds = perf_counter() - start
            failed += not all(check.holds for check in checks)
            rows.append((case.name, case.hard, ", ".join(case.spaces), _found(checks), round(seconds, 1)))
            if COMM.rank == 0:
                print(f"{case.name}: {seconds:.1f} s", file=sys.stderr, flush=True)
    if COMM.rank == 0:
        publish("hard_cases", format_table(HEADERS, rows), write=options.write)
    return failed


def _run(case: HardCase, space: str) -> list[Check]:
    """The findings; an error that the case does not expect is one too."""
    try:
        return list(case.run(space, COMM))
    except Exception as failure:
        return [Fact(f"{space}: no {type(failure).__name__}: {failure}", False)]


def _found(checks: list[Check]) -> str:
    """The findings as text: of the same finding in several spaces the worst."""
    worst: dict[str, Check] = {}
    for check in checks:
        known = worst.get(check.what)
        if known is None or not check.holds or isinstance(check, Deviation) and known.holds and _nearer(check, known):
            worst[check.what] = check
    return "; ".join(map(str, worst.values()))


def _nearer(check: Deviation, known: Deviation) -> bool:
    return check.value / check.bound > known.value / known.bound


if __name__ == "__main__":
    sys.exit(main())
