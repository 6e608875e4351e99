"""Tables in Markdown that read well on a console, and the generated pages of the documentation."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
from collections.abc import Sequence
from numbers import Integral, Real
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write

ROOT = Path(__file__).parents[1]


def command(description: str) -> argparse.ArgumentParser:
    """The options that every benchmark has; an error on one process ends all.

    Args:
        description: the docstring of the benchmark; its first line is the help text.
    """
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write the table to docs/tables/ as well")
    return parser


def publish(name: str, text: str, *, write: bool, folder: Path = ROOT / "docs" / "tables") -> None:
    """Prints a benchmark's tables, with machine and commit below them (call on one rank).

    Args:
        name: of the benchmark.
        text: its tables, in Markdown.
        write: whether they become the page NAME.md of ``folder``, for other pages to include.
        folder: of the generated tables.
    """
    text = f"{text}\n\n{provenance()}\n"
    print(text, flush=True)
    if write:
        with atomic_write(folder / f"{name}.md") as file:
            file.write(text)


def provenance() -> str:
    """The commit, the versions and the machine that a measurement belongs to."""

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    changed = ", changed since" if git("status", "--porcelain", "--untracked-files=no") else ""
    return (
        f"Commit {git('rev-parse', '--short', 'HEAD') or 'unknown'}{changed}; dolfinx {dolfinx.__version__}; "
        f"{_processor()}, {os.cpu_count()} cores; {MPI.COMM_WORLD.size} process(es)."
    )


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def format_table(headers: Sequence[str], rows: Sequence[Sequence[object]], *, digits: int = 4) -> str:
    """Lay out ``rows`` under ``headers``; numbers stand right, words left.

    Args:
        headers: (k,) column names.
        rows: each of k cells: numbers, words, flags, or None for "not known".
        digits: significant digits of floats.

    Returns:
        the lines, joined, without a newline at the end.

    Raises:
        DescriptionError: a row has another number of cells.
    """
    for index, row in enumerate(rows):
        if len(row) != len(headers):
            raise DescriptionError(
                f"row {index} of the table", f"{len(row)} cells for {len(headers)} columns", "Give one cell per column"
            )
    cells = [[_text(cell, digits) for cell in line] for line in (headers, *rows)]
    widths = [max(3, *(len(line[k]) for line in cells)) for k in range(len(headers))]
    right = [bool(rows) and all(_stands_right(row[k]) for row in rows) for k in range(len(headers))]
    rule = ["-" * (w - 1) + ":" if r else "-" * w for w, r in zip(widths, right, strict=True)]
    return "\n".join(_line(line, widths, right) for line in (cells[0], rule, *cells[1:]))


def _line(cells: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    padded = [c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True)]
    return "| " + " | ".join(padded) + " |"


def _stands_right(cell: object) -> bool:
    return cell is None or (isinstance(cell, Real) and not isinstance(cell, bool))


def _text(cell: object, digits: int) -> str:
    if cell is None:
        return "–"
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if isinstance(cell, Integral):
        return str(int(cell))
    if isinstance(cell, Real):
        return f"{float(cell):.{digits}g}"
    return str(cell).replace("|", "\\|").replace("\n", " ")
