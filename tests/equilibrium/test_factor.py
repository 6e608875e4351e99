"""The inertia that the factorisation reports is that of the eigenvalues, on any number of ranks; limits of memory."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.equilibrium import Factor

from .finger import finger

SIZE = 60


def with_eigenvalues(values: np.ndarray, *, seed: int = 0) -> np.ndarray:
    """A symmetric matrix with given eigenvalues."""
    basis, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((len(values),) * 2))
    return basis @ np.diag(values) @ basis.T


def distributed(dense: np.ndarray, comm: MPI.Comm) -> PETSc.Mat:
    """``dense`` as a distributed sparse matrix."""
    matrix = PETSc.Mat().createAIJ(dense.shape, comm=comm)
    matrix.setUp()
    first, last = matrix.getOwnershipRange()
    matrix.setValues(range(first, last), range(len(dense)), dense[first:last])
    matrix.assemble()
    return matrix


@pytest.mark.parallel
@pytest.mark.parametrize("negative", [0, 1, 23])
def test_negative_pivots_are_counted(negative):
    values = np.linspace(0.5, 2.0, SIZE)
    values[:negative] *= -1.0
    factor = Factor(distributed(with_eigenvalues(values), MPI.COMM_WORLD))
    assert factor.refactor()
    inertia = factor.inertia()
    assert (inertia.negative, inertia.zero) == (negative, 0)


@pytest.mark.parallel
def test_new_values_of_the_same_matrix_are_factored_again():
    values = np.linspace(0.5, 2.0, SIZE)
    matrix = distributed(with_eigenvalues(values), MPI.COMM_WORLD)
    factor = Factor(matrix)
    assert factor.refactor() and factor.inertia().negative == 0
    matrix.shift(-1.0)
    assert factor.refactor() and factor.inertia().negative == np.sum(values < 1.0)
    right, solution = matrix.createVecs()
    right.set(1.0)
    factor.solve(right, solution)
    assert (matrix * solution - right).norm() <= 1e-12 * right.norm()


@pytest.mark.parallel
def test_factor_that_is_not_that_of_the_matrix_is_made_again():
    matrix = distributed(with_eigenvalues(np.linspace(0.5, 2.0, SIZE)), MPI.COMM_WORLD)
    factor = Factor(matrix)
    for _ in range(2):
        matrix.scale(1.1)
        assert factor.refactor()
    matrix.shift(-3.0)
    right, solution = matrix.createVecs()
    right.set(1.0)
    inertia = factor.solve_and_count(right, solution, 0.0)
    assert (inertia.negative, inertia.zero) == (SIZE, 0)
    assert (matrix * solution - right).norm() <= 1e-12 * right.norm()


@pytest.mark.parallel
def test_zero_pivots_are_found_instead_of_failing():
    # two rows of zeros, as an unused multiplier or a freedom without stiffness leaves them
    dense = np.zeros((SIZE + 2, SIZE + 2))
    dense[:SIZE, :SIZE] = with_eigenvalues(np.concatenate([[-1.0], np.linspace(0.5, 2.0, SIZE - 1)]))
    factor = Factor(distributed(dense, MPI.COMM_WORLD))
    assert factor.refactor()
    inertia = factor.inertia()
    assert (inertia.negative, inertia.zero) == (1, 2)


@pytest.mark.parallel
def test_workspace_that_is_too_small_grows():
    values = np.linspace(-0.5, 2.0, SIZE)
    factor = Factor(distributed(with_eigenvalues(values), MPI.COMM_WORLD), workspace=-60)
    assert factor.refactor()
    assert factor.inertia().negative == np.sum(values < 0.0)


@pytest.fixture
def one_megabyte():
    """MUMPS may take no more memory."""
    options = PETSc.Options("fenicsmech_kkt_")
    options["mat_mumps_icntl_23"] = 1
    yield
    options.delValue("mat_mumps_icntl_23")


@pytest.mark.parallel
def test_factor_that_does_not_fit_into_memory_is_an_error_on_all_ranks(one_megabyte):
    size = 450  # 1.6 MB of a front
    factor = Factor(distributed(with_eigenvalues(np.linspace(0.5, 2.0, size)), MPI.COMM_WORLD))
    with pytest.raises(fm.OutOfMemoryError, match="450 unknowns") as caught:
        factor.refactor()
    assert "larger elements" in caught.value.remedy


def test_curve_whose_matrix_does_not_fit_into_memory_says_so_instead_of_searching_for_descent(one_megabyte):
    simulation, push = finger("plane-stress", size=1.0)
    with pytest.raises(MemoryError, match="larger elements.*TwoLevel"):
        simulation.load_displacement(push, forces=[1.0])
