"""An uncaught error on one rank ends the program on all."""

import subprocess
import sys

import pytest

RANKS = 2
FAILING = """
import fenicsmech as fm
from mpi4py import MPI
fm.mpi_abort_on_error()
print("rank", MPI.COMM_WORLD.rank)
if MPI.COMM_WORLD.rank in {ranks}:
    raise ValueError("broken")
MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.parametrize(
    "ranks",
    [pytest.param([0], marks=pytest.mark.thorough), [1], pytest.param([0, 1], marks=pytest.mark.thorough)],
    ids=["the first", "the second", "all"],
)
def test_a_program_ends_when_an_error_is_not_caught_on(ranks, mpirun, tmp_path):
    script = tmp_path / "failing.py"
    script.write_text(FAILING.format(ranks=ranks))
    done = mpirun(RANKS, script)
    assert done.returncode == 1
    assert done.stderr.count("ValueError: broken") == len(ranks)


@pytest.mark.thorough
def test_importing_the_package_changes_nothing_outside_it():
    script = """
import logging, sys
import dolfinx
hook, root = sys.excepthook, logging.getLogger()
handlers, level = list(root.handlers), root.level
import fenicsmech
assert sys.excepthook is hook
assert root.handlers == handlers and root.level == level
for name, logger in logging.Logger.manager.loggerDict.items():
    if name.startswith("fenicsmech") and isinstance(logger, logging.Logger):
        assert not logger.filters and not logger.handlers and logger.propagate and logger.level == logging.NOTSET
"""
    subprocess.run([sys.executable, "-c", script], check=True)
