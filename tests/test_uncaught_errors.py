"""Errors that nobody catches end a program on all ranks: none waits for one that is gone."""

import pytest

RANKS = 2
FAILING = """
import fenicsmech
from mpi4py import MPI
print("rank", MPI.COMM_WORLD.rank)
if MPI.COMM_WORLD.rank in {ranks}:
    raise ValueError("broken")
MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.parametrize("ranks", [[0], [1], [0, 1]], ids=["the first", "the second", "all"])
def test_a_program_ends_when_an_error_is_not_caught_on(ranks, mpirun, tmp_path):
    script = tmp_path / "failing.py"
    script.write_text(FAILING.format(ranks=ranks))
    done = mpirun(RANKS, script)
    assert done.returncode == 1
    assert done.stderr.count("ValueError: broken") == len(ranks)
