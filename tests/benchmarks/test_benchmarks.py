"""Demos that compare solvers: what does not end is stopped, and what ends agrees."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

DEMOS = Path(__file__).parents[2] / "demos"


def printed(name: str, folder: Path, *options: str) -> list[list[str]]:
    """The cells of the tables that a demo prints, run as a user does."""
    command = [sys.executable, str(DEMOS / f"{name}.py"), *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in done.stdout.splitlines() if "|" in line]


def test_what_takes_too_long_is_stopped_and_said_so(tmp_path):
    *_, row = printed("solvers", tmp_path, "truss, whole load at once", "--limit", "0")
    assert row[1:] and set(row[1:]) == {"stopped after 0 s"}


@pytest.mark.slow
def test_two_levels_the_factor_and_algebraic_multigrid_agree(tmp_path):
    table = printed("large", tmp_path, "--sizes", "6", "--compare", "--out", str(tmp_path))
    curves = next(row for row in table if len(row) == 8 and row[0].isdigit())
    assert float(curves[-1]) <= 1e-8
    systems = {row[1]: row for row in table if row[1:] and not row[1][:1].isdigit()}
    for multigrid in ("GAMG", "BoomerAMG"):
        # the Schur complement is a difference of much larger terms
        assert float(systems[multigrid][-1]) <= 1e-5
