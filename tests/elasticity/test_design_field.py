"""A design field d does exactly what moving the vertices of the mesh by d would do."""

import numpy as np
import pytest
from dolfinx import fem

from fenicsmech.compat import original_cells, vector_space
from fenicsmech.stress import von_mises

from .cases import each_case
from .single_link import distorted, forces, interpolate, nodes, rest_shape, single_link, wave


@pytest.mark.parametrize("order", [1, 2])
@each_case
def test_energy_force_and_stress_are_those_of_the_mesh_with_moved_vertices(model, law, order):
    points, cells = distorted(model.dim)
    redesign = wave(model.dim, 0.3, seed=1)
    redesigned = single_link(points, cells, model=model, law=law, order=order, depth=2.5)
    linear = fem.Function(vector_space(redesigned.mesh, 1))  # straight edges stay straight
    interpolate(linear, redesign)
    redesigned.shape.interpolate(linear)
    moved = single_link(points + redesign(points), cells, model=model, law=law, order=order, depth=2.5)
    assert nodes(moved.u) == pytest.approx(rest_shape(redesigned), abs=1e-14)  # the same numbering
    assert np.array_equal(original_cells(moved.mesh), original_cells(redesigned.mesh))

    interpolate(redesigned.u, wave(model.dim, 0.2, seed=2))
    moved.u.x.array[:] = redesigned.u.x.array
    assert redesigned.energy() == pytest.approx(moved.energy(), rel=1e-12)
    expected = forces(moved)
    assert forces(redesigned) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
    assert von_mises(redesigned.stress_samples()[0]) == pytest.approx(von_mises(moved.stress_samples()[0]), rel=1e-12)
