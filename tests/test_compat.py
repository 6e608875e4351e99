"""PETSc objects that processes drop at different times."""

import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.compat import destroy_garbage

COMM = MPI.COMM_WORLD.Dup()
ONE_SIDED = """
from mpi4py import MPI
from petsc4py import PETSc
from fenicsmech.compat import destroy_garbage
destroy_garbage(MPI.COMM_WORLD)
vector = PETSc.Vec().createMPI((1, None), comm=MPI.COMM_WORLD)
if MPI.COMM_WORLD.rank == 1:
    vector.destroy()
"""


def vector() -> PETSc.Vec:
    return PETSc.Vec().createMPI((1, None), comm=COMM)


@pytest.mark.parallel
def test_new_objects_can_be_made_when_only_one_process_has_dropped_the_old():
    destroy_garbage(COMM)
    old = vector()
    if COMM.rank == 0:
        old.destroy()
    assert vector().getSize() == COMM.size


def test_a_program_ends_when_only_one_process_has_dropped_its_objects(mpirun, tmp_path):
    script = tmp_path / "one_sided.py"
    script.write_text(ONE_SIDED)
    assert mpirun(2, script).returncode == 0
