"""The displacement carried to a new rest shape: exact for rigid motions, close to it elsewhere, on any rank."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticBody

from .single_link import distorted, interpolate, rest_shape, single_link, wave
from .test_rigid_motion import SHIFT, move, rotation

each_model = pytest.mark.parametrize("model", [PLANE_STRESS, PLANE_STRAIN, SPATIAL], ids=lambda model: model.name)
each_order = pytest.mark.parametrize("order", [1, 2])


def change_of(body: ElasticBody, amplitude: float) -> np.ndarray:
    """A smooth change of the rest shape, as values of d."""
    change = fem.Function(body.shape.function_space)
    interpolate(change, wave(body.model.dim, amplitude, seed=7))
    return change.x.array.copy()


@pytest.mark.parallel
@pytest.mark.parametrize("angle", [1e-9, 0.3, 2.4])
@each_order
@each_model
def test_a_link_that_was_moved_rigidly_stays_so_in_its_new_shape(model, order, angle):
    body = single_link(*distorted(model.dim), model=model, order=order, comm=MPI.COMM_WORLD)
    interpolate(body.shape, wave(model.dim, 0.2, seed=1))
    turn = rotation(model.dim, angle)
    move(body, turn)
    change = change_of(body, 0.1)
    carried = body.carried(change).reshape(-1, model.dim)
    body.shape.x.array[:] += change
    X = rest_shape(body)
    expected = X @ (turn - np.eye(model.dim)).T + SHIFT[: model.dim]
    assert carried == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


@each_order
@each_model
def test_displacement_and_shape_are_left_as_they_are(model, order):
    body = single_link(*distorted(model.dim), model=model, order=order)
    interpolate(body.shape, wave(model.dim, 0.2, seed=1))
    interpolate(body.u, wave(model.dim, 0.2, seed=2))
    before = body.u.x.array.copy(), body.shape.x.array.copy()
    body.carried(change_of(body, 0.1))
    assert np.array_equal(body.u.x.array, before[0])
    assert np.array_equal(body.shape.x.array, before[1])
    assert body.carried(np.zeros_like(body.shape.x.array)) == pytest.approx(body.u.x.array, abs=1e-15)


@each_order
@each_model
def test_a_uniform_stretch_carries_every_node_along(model, order):
    body = single_link(*distorted(model.dim), model=model, order=order)
    stretch = np.random.default_rng(3).uniform(-0.3, 0.3, (model.dim, model.dim))
    interpolate(body.u, lambda X: X @ stretch.T)
    change = change_of(body, 0.1)
    carried = body.carried(change).reshape(-1, model.dim)
    body.shape.x.array[:] += change
    assert carried == pytest.approx(rest_shape(body) @ stretch.T, abs=1e-13)
