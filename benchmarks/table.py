"""Tables with machine and commit, on the console and as generated pages of the documentation."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
from pathlib import Path

import dolfinx
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.errors import counted
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


def publish(
    name: str, text: str, *, write: bool, folder: Path = ROOT / "docs" / "tables", commit: str | None = None
) -> None:
    """Prints a benchmark's tables, with machine and commit below them (call on one rank).

    Args:
        name: of the benchmark.
        text: its tables, in Markdown.
        write: whether they become a page of ``folder``, NAME.md with hyphens, for other pages to include.
        folder: of the generated tables.
        commit: that they are of; the present one by default.
    """
    text = f"{text}\n\n{provenance(commit)}\n"
    print(text, flush=True)
    if write:
        with atomic_write(folder / f"{name.replace('_', '-')}.md") as file:
            file.write(text)


def revision(*folders: str) -> str:
    """The present commit, and whether files were changed since, in these folders or anywhere."""

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    changed = ", changed since" if git("status", "--porcelain", "--untracked-files=no", "--", *folders) else ""
    return f"{git('rev-parse', '--short', 'HEAD') or 'unknown'}{changed}"


def provenance(commit: str | None = None) -> str:
    """The commit, by default the present one, the versions and the machine that a measurement belongs to."""
    return (
        f"Commit {commit or revision()}; dolfinx {dolfinx.__version__}; "
        f"{_processor()}, {os.cpu_count()} cores; {counted(MPI.COMM_WORLD.size, 'process', 'processes')}."
    )


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
