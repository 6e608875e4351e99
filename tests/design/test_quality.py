"""Aspect ratios and their sum: known values, derivatives, inverted cells, ranks."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import create_mesh, original_cells, vector_space
from fenicsmech.design import QualitySum
from fenicsmech.meshing import radius_ratios

from ..elasticity.single_link import distorted, interpolate, nodes, wave
from ..oracles.dense import taylor_rates
from ..ranks import EACH_COMM

each_dim = pytest.mark.parametrize("dim", [2, 3])
TRIANGLE = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, np.sqrt(0.75))])
TETRAHEDRON = np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)])


def design_field(points: np.ndarray, cells: np.ndarray, comm: MPI.Comm = MPI.COMM_SELF) -> fem.Function:
    """The design field on a mesh."""
    first = comm.rank == 0
    mesh = create_mesh(comm, cells if first else cells[:0], points if first else points[:0])
    return fem.Function(vector_space(mesh, 1))


@pytest.mark.parametrize(("corners", "ratio"), [(TRIANGLE, 2.0), (TETRAHEDRON, 3.0)])
def test_equilateral_cells_have_the_least_ratio(corners, ratio):
    field = design_field(corners, np.arange(len(corners))[None])
    quality = QualitySum(field)
    assert quality.value() == pytest.approx(ratio)
    assert quality.gradient() == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.eigvalsh(quality.hessian()[:, :]).min() > -1e-12


@each_dim
def test_ratios_of_cells_are_those_of_the_moved_mesh(dim):
    points, cells = distorted(dim)
    field = design_field(points, cells)
    change = wave(dim, 0.1, seed=2)
    interpolate(field, change)
    expected = dim / radius_ratios(points + change(points), cells)
    quality = QualitySum(field)
    assert quality.cell_values() == pytest.approx(expected[original_cells(field.function_space.mesh)])
    assert quality.value() == pytest.approx(expected.sum())


def cube(rho):
    return (rho - 1.0) ** 3


@pytest.mark.parametrize("comm", EACH_COMM)
@pytest.mark.parametrize(("dim", "penalty"), [(2, None), (3, None), (2, cube)])
def test_gradient_and_hessian_pass_taylor_tests(dim, penalty, comm):
    field = design_field(*distorted(dim), comm)
    interpolate(field, wave(dim, 0.1, seed=2))
    start, direction = field.x.array.copy(), wave(dim, 1.0, seed=3)(nodes(field)).ravel()
    quality = QualitySum(field, penalty) if penalty else QualitySum(field)
    owned = quality.gradient().size
    gradient, hessian = quality.gradient().ravel(), quality.hessian()
    along = hessian.createVecRight()
    along.array[:] = direction[:owned]
    turned = (hessian * along).array.copy()
    steps = [2e-3, 1e-3, 5e-4]

    def at(function, h):
        field.x.array[:] = start + h[0] * direction
        return function()

    def whole(values):
        """Of all ranks, one after the other."""
        return np.concatenate(comm.allgather(values.ravel()))

    slope = comm.allreduce(float(gradient @ direction[:owned]))
    first = taylor_rates(lambda h: at(quality.value, h), [0.0], [1.0], [slope], steps)
    second = taylor_rates(lambda h: whole(at(quality.gradient, h)), [0.0], [1.0], whole(turned)[:, None], steps)
    for rates in (first, second):
        assert rates.with_gradient.min() >= 1.95
        assert rates.without.min() >= 0.95


@each_dim
def test_inverted_cells_make_the_sum_infinite(dim):
    points, cells = distorted(dim)
    field = design_field(points, cells)
    quality = QualitySum(field)
    assert np.isfinite(quality.value())
    field.x.array[:dim] += 10.0
    assert quality.value() == np.inf
    assert np.isnan(quality.cell_values()).any()


@pytest.mark.parallel
@each_dim
def test_sum_gradient_and_hessian_do_not_depend_on_the_number_of_ranks(dim):
    seen = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        field = design_field(*distorted(dim), comm)
        interpolate(field, wave(dim, 0.1, seed=2))
        quality = QualitySum(field)
        gradient = quality.gradient()
        norms = (np.sum(gradient**2), np.sum(quality.cell_values()[: owned_cells(field)]))
        seen.append((quality.value(), quality.hessian().norm(), *(comm.allreduce(norm) for norm in norms)))
    assert seen[1] == pytest.approx(seen[0], rel=1e-12)


def owned_cells(field: fem.Function) -> int:
    topology = field.function_space.mesh.topology
    return topology.index_map(topology.dim).size_local
