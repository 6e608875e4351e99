"""The rest shape as a function of the parameters alone: lengths, quality, and derivatives of displacements by them."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.compat import original_cells
from fenicsmech.design import Barrier
from fenicsmech.meshing import radius_ratios
from fenicsmech.simulation import rest_vertices

from ..oracles.dense import taylor_rates
from .mechanisms import bench, bow, pinned_links, strained, truss, turned_beam

CASES = {
    "truss": lambda: truss((0.1, 1.0), (0.4, 2.0)),
    "force on a link": lambda: bow(60.0),
    "strained by motors": lambda: strained(3.0),
    "turned by 135°": lambda: turned_beam(3.0),
}


def test_links_own_consecutive_parameters_that_count_in_thicknesses():
    case = pinned_links()
    both = bench(case, case.simulate())
    assert [link.name for link in both.rest.links] == ["arch", "rod"]
    assert [link.thickness for link in both.rest.links] == [3.0, 3.0]
    for link in both.rest.links:
        assert both.rest.initial[link.parameters.place] == pytest.approx(link.spline.initial)
        assert both.rest.lengths[link.parameters.place] == pytest.approx(np.where(link.spline.is_thickness, 1.0, 3.0))
    assert both.rest.links[0].parameters.place.stop == both.rest.links[1].parameters.place.start
    assert both.rest.links[1].parameters.place.stop == len(both.rest.initial)


def test_worst_ratio_is_that_of_the_simulation():
    case = pinned_links()
    both = bench(case, case.simulate())
    for change in (0.0, 0.3):
        both.rest.place(both.design(change), None)
        assert both.rest.worst_ratio() == pytest.approx(both.simulation.mesh_ratio_max, rel=1e-10)


def test_penalty_sums_its_barrier_over_the_cells_that_can_deform():
    case = pinned_links()
    both = bench(case, case.simulate())
    placed, barrier = both.rest.place(both.design(0.3), None), Barrier(2.2, 1.5, 4.0)
    model = both.simulation.model
    ratios = 2.0 / radius_ratios(rest_vertices(model), model.mesh.cells)
    value, _ = both.rest.quality_penalty(barrier, placed)
    rigid = np.zeros(len(model.mesh.cells), dtype=bool)
    for number in np.unique(model.mesh.interface[model.mesh.interface >= 0]):
        held = model.mesh.cells[original_cells(model.mesh.mesh)[model.mesh.interface == number]]
        rigid |= np.isin(model.mesh.cells, held).all(axis=1)
    assert np.sum(ratios[~rigid] > barrier.limit) > 3 and np.any(ratios[rigid] > barrier.limit)
    assert value == pytest.approx(barrier.value(ratios[~rigid]).sum(), rel=1e-8)
    assert both.rest.worst_ratio() == pytest.approx(ratios[~rigid].max(), rel=1e-8)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "space", "size", "order"),
    [
        *((name, "plane-stress", 3.0, 2) for name in CASES),
        pytest.param("truss", "3d", 4.0, 1, marks=pytest.mark.parallel),
        ("force on a link", "plane-strain", 3.0, 2),
        ("force on a link", "plane-stress", 4.0, 3),
        ("force on a link", "3d-symmetric", 4.0, 2),
    ],
)
def test_displacements_pass_the_taylor_test_by_the_parameters(name, space, size, order):
    case = CASES[name]()
    both = bench(case, case.simulate(space, size=size, order=order, comm=MPI.COMM_WORLD))
    placed = both.rest.place(both.design(0.06), None)
    known = both.equilibria.from_zero()
    gradient = both.rest.gradient(placed, np.array([own.design for own in both.equilibria.gradients(known)]))
    direction = both.direction(7)

    def reached(h: np.ndarray) -> np.ndarray:
        both.rest.place(placed.p + h[0] * direction, placed)
        return both.equilibria.values(both.equilibria.from_design(known))

    rates = taylor_rates(reached, [0.0], [1.0], (gradient @ direction)[:, None], [0.02, 0.01, 0.005])
    assert rates.with_gradient.min() >= 1.95
    assert rates.without.min() >= 0.95
