"""A copy by entries equals the matrix by blocks, whatever is written into that, on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.equilibrium import EntryCopy

BLOCKS = 12


def blocked(size: int) -> PETSc.Mat:
    """A matrix of blocks of random values: each row of blocks meets some near ones, and the last of all."""
    comm = MPI.COMM_WORLD
    matrix = PETSc.Mat().createBAIJ((size * BLOCKS, size * BLOCKS), size, comm=comm)
    matrix.setPreallocationNNZ((4, 4))
    first, last = (row // size for row in matrix.getOwnershipRange())
    random = np.random.default_rng(comm.rank)
    for row in range(first, last):
        columns = {row, (row + 1) % BLOCKS, row // 2, BLOCKS - 1}
        for column in columns:
            matrix.setValuesBlocked([row], [column], random.standard_normal((size, size)))
    matrix.assemble()
    return matrix


def difference(matrix: PETSc.Mat, copy: PETSc.Mat) -> float:
    """The largest one of any entries, by PETSc's own conversion."""
    assert copy.getType().endswith("aij") and not copy.getType().endswith("baij")
    change = matrix.convert(PETSc.Mat.Type.AIJ, PETSc.Mat())
    change.axpy(-1.0, copy)
    return change.norm(PETSc.NormType.NORM_INFINITY)


@pytest.mark.parallel
@pytest.mark.parametrize("size", [1, 2, 3])
def test_copy_equals_the_matrix_after_each_update(size):
    matrix = blocked(size)
    before = matrix.norm()
    copy = EntryCopy(matrix)
    assert matrix.norm() == before > 0.0
    copy.update()
    assert difference(matrix, copy.matrix) == 0.0
    matrix.scale(2.0)
    matrix.shift(1.0)
    assert difference(matrix, copy.matrix) > 0.5
    copy.update()
    assert difference(matrix, copy.matrix) == 0.0


@pytest.mark.parallel
def test_products_see_new_values():
    matrix = blocked(3)
    copy = EntryCopy(matrix)
    copy.update()
    product = copy.matrix.matMult(copy.matrix)
    matrix.scale(2.0)
    copy.update()
    again = copy.matrix.matMult(copy.matrix, result=product)
    x, expected = matrix.createVecs()
    x.setRandom()
    matrix.mult(matrix * x, expected)
    assert (again * x - expected).norm() <= 1e-12 * expected.norm()
