"""Every hard case finds what is known about it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mpi4py import MPI

from .case import HardCase
from .cases import CASES

TABLE = Path(__file__).parents[2] / "docs" / "tables" / "hard-cases.md"


def _parameter(case: HardCase, space: str):
    return pytest.param(case, space, id=f"{case.name}, {space}", marks=[pytest.mark.slow] * case.slow)


@pytest.mark.thorough
@pytest.mark.parametrize("case, space", [_parameter(case, space) for case in CASES for space in case.spaces])
def test_hard_case(case, space):
    checks = list(case.run(space, MPI.COMM_WORLD))
    assert checks
    assert [str(check) for check in checks if not check.holds] == []


def test_documentation_lists_every_case():
    listed = re.findall(r"^\| ([^|]+?) +\|", TABLE.read_text(), flags=re.M)
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    assert [name for name in listed if name in names] == names
