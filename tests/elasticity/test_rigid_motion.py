"""Rigid motions cost no energy and take no force; energy is the same seen from any side."""

import numpy as np
import pytest

from .cases import each_case
from .single_link import distorted, forces, interpolate, rest_shape, single_link, wave

SHIFT = np.array([3.0, -7.0, 2.0])
ANGLES = [1e-9, 1e-3, 1.0, 3.0, 4.0 * np.pi]


def rotation(dim, angle):
    """About an oblique axis in space."""
    axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.array([2.0, -1.0, 2.0]) / 3.0
    cross = np.cross(np.eye(3), axis).T
    return (np.eye(3) + np.sin(angle) * cross + 2.0 * np.sin(0.5 * angle) ** 2 * cross @ cross)[:dim, :dim]


def move(body, turn):
    """u becomes turn (X + u) + shift − X."""
    dim = body.model.dim
    X = rest_shape(body)
    u = body.u.x.array.reshape(-1, dim)
    u[:] = u @ turn.T + X @ (turn - np.eye(dim)).T + SHIFT[:dim]


@pytest.fixture(scope="module", params=[0.0, 0.2], ids=["as meshed", "redesigned"])
def body_of(request):
    def build(model, law, order=2):
        body = single_link(*distorted(model.dim), model=model, law=law, order=order)
        interpolate(body.shape, wave(model.dim, request.param, seed=1))
        return body

    return build


@pytest.mark.thorough
@each_case
@pytest.mark.parametrize("order", [1, 2])
def test_rigid_motion_costs_no_energy_and_takes_no_force(body_of, model, law, order):
    body = body_of(model, law, order)
    young = body.parameters["E"].x.array[0]
    for angle in ANGLES:
        body.u.x.array[:] = 0.0
        move(body, rotation(model.dim, angle))
        assert abs(body.energy()) < 1e-13 * young
        assert np.abs(forces(body)).max() < 1e-12 * young


@pytest.mark.thorough
@each_case
@pytest.mark.parametrize("order", [1, 2])
def test_rounding_of_forces_does_no_work_along_rigid_motions(body_of, model, law, order):
    body = body_of(model, law, order)
    young, dim = body.parameters["E"].x.array[0], model.dim
    for angle in ANGLES:
        body.u.x.array[:] = 0.0
        move(body, rotation(dim, angle))
        force = forces(body).reshape(-1, dim)
        x = rest_shape(body) + body.u.x.array.reshape(-1, dim)
        turns = np.einsum("ai,aj->ij", force, x)
        works = [*force.sum(axis=0), *(turns - turns.T).ravel()]
        assert np.abs(works).max() < 1e-26 * young  # ∂W/∂F : ∇v leaves 1e-15


@pytest.mark.thorough
@each_case
def test_energy_and_forces_turn_with_the_deformed_body(body_of, model, law):
    body = body_of(model, law)
    interpolate(body.u, wave(model.dim, 0.2, seed=2))
    energy, force = body.energy(), forces(body).reshape(-1, model.dim)
    assert energy > 0.0
    turn = rotation(model.dim, 2.0)
    move(body, turn)
    assert body.energy() == pytest.approx(energy, rel=1e-12)
    assert forces(body).reshape(-1, model.dim) == pytest.approx(force @ turn.T, abs=1e-12 * np.abs(force).max())
