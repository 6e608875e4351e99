"""PETSc objects that processes drop at different times."""

import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.compat import destroy_garbage

COMM = MPI.COMM_WORLD.Dup()


def vector() -> PETSc.Vec:
    return PETSc.Vec().createMPI((1, None), comm=COMM)


@pytest.mark.parallel
def test_new_objects_can_be_made_when_only_one_process_has_dropped_the_old():
    destroy_garbage(COMM)
    old = vector()
    if COMM.rank == 0:
        old.destroy()
    assert vector().getSize() == COMM.size
