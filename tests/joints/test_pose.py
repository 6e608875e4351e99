"""Placed points, carried bodies, and the constraints rotation parameters obey among themselves."""

import numpy as np
import pytest

from .poses import PLANAR, SPACES, SPATIAL, carry, matrix, pose, random_pose, random_rotation, rotation_of, turn
from .taylor import STEPS, assert_derivative

EVERY_SPACE = pytest.mark.parametrize("space", SPACES, ids=["planar", "spatial"])


@EVERY_SPACE
def test_identity_moves_no_point(space):
    offsets = np.random.default_rng(0).standard_normal((4, space.dim))
    assert np.array_equal(space.displace(space.identity, offsets), np.zeros((4, space.dim)))


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_points_and_vectors_move_as_the_matrices_say(space, seed):
    rng = np.random.default_rng(seed)
    z, offsets = random_pose(space, rng), rng.standard_normal((4, space.dim))
    R = matrix(space, rotation_of(space, z))
    assert space.displace(z, offsets) == pytest.approx(z[: space.dim] + offsets @ R.T - offsets, abs=1e-14)
    assert space.rotate(z, offsets[0]) == pytest.approx(R @ offsets[0], abs=1e-14)


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_displacement_gradient_passes_the_taylor_test(space, seed):
    rng = np.random.default_rng(seed)
    z, offsets = random_pose(space, rng), rng.standard_normal((4, space.dim))
    slope = space.displacement_gradient(z, offsets).reshape(-1, space.pose_size)
    assert_derivative(lambda y: space.displace(y, offsets).ravel(), z, slope, rng)


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_displacement_hessian_passes_the_taylor_test(space, seed):
    rng = np.random.default_rng(seed)
    z, offsets, forces = random_pose(space, rng), *rng.standard_normal((2, 4, space.dim))

    def weighted(y):
        return np.einsum("ni,nia->a", forces, space.displacement_gradient(y, offsets))

    curvature = space.displacement_hessian(z, forces.T @ offsets)
    assert np.array_equal(curvature, curvature.T)
    assert_derivative(weighted, z, curvature, rng)


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_rotation_rates_are_the_derivative_of_a_finite_rotation_in_space(space, seed):
    rng = np.random.default_rng(seed)
    z, omega = random_pose(space, rng), rng.standard_normal(2 * space.dim - 3)
    slope = space.rotation_rates(z) @ omega
    errors = []
    for step in STEPS:
        turned = pose(space, z[: space.dim], turn(space, step * omega) * rotation_of(space, z))[space.dim :]
        turned = turned * np.sign(turned @ z[space.dim :]) if space.dim == 3 else turned  # q and −q are one rotation
        difference = turned - z[space.dim :] - step * slope
        errors.append(np.linalg.norm(difference if space.dim == 3 else np.angle(np.exp(1j * difference))))
    if errors[0] > 1e-14:
        assert np.min(np.log2(np.divide(errors[:-1], errors[1:]))) >= 1.95


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_carried_body_moves_as_the_product_of_matrices(space, seed):
    rng = np.random.default_rng(seed)
    outer, inner, lever = random_pose(space, rng), random_pose(space, rng), rng.standard_normal(space.dim)
    offsets = rng.standard_normal((4, space.dim))  # from the centre of the carried body
    moved = offsets + space.displace(inner, offsets)
    places = moved + space.displace(outer, lever + moved)
    assert offsets + space.displace(carry(space, outer, inner, lever), offsets) == pytest.approx(places, abs=1e-14)


@EVERY_SPACE
def test_retraction_is_idempotent_and_leaves_its_argument_alone(space):
    raw = np.random.default_rng(0).standard_normal((3, 5, space.pose_size))
    kept = raw.copy()
    once = space.retract(raw)
    assert np.array_equal(raw, kept)
    assert once.shape == raw.shape
    assert space.retract(once) == pytest.approx(once, rel=1e-15)
    assert all(np.abs(space.norm_residual(z)) <= 4e-16 for z in once.reshape(-1, space.pose_size) if space.dim == 3)


@EVERY_SPACE
@pytest.mark.parametrize("seed", range(3))
def test_retraction_is_neutral_to_first_order_along_rotations(space, seed):
    rng = np.random.default_rng(seed)
    z = random_pose(space, rng)
    along = np.concatenate(
        [rng.standard_normal(space.dim), space.rotation_rates(z) @ rng.standard_normal(2 * space.dim - 3)]
    )
    changes = [np.linalg.norm(space.retract(y) - y) for y in (z + step * along for step in STEPS)]
    if space.dim == 3:
        assert np.min(np.log2(np.divide(changes[:-1], changes[1:]))) >= 1.95
    else:
        assert changes == [0.0] * len(STEPS)


@pytest.mark.parametrize("seed", range(3))
def test_quaternion_norm_is_one_on_rotations_and_stationary_along_them(seed):
    z = random_pose(SPATIAL, np.random.default_rng(seed))
    assert SPATIAL.norm_residual(z) == pytest.approx([0.0], abs=4e-16)
    assert SPATIAL.norm_gradient(z)[:, 3:] @ SPATIAL.rotation_rates(z) == pytest.approx(np.zeros((1, 3)), abs=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_the_quaternion_norm_pass_the_taylor_test(seed):
    rng = np.random.default_rng(seed)
    z = np.concatenate([rng.standard_normal(3), rng.standard_normal(4)])
    assert_derivative(SPATIAL.norm_residual, z, SPATIAL.norm_gradient(z), rng)
    assert_derivative(lambda y: SPATIAL.norm_gradient(y)[0], z, SPATIAL.norm_hessian()[0], rng)


def test_planar_parameters_obey_no_constraint():
    z = random_pose(PLANAR, np.random.default_rng(0))
    assert PLANAR.norm_residual(z).shape == (0,)
    assert PLANAR.norm_gradient(z).shape == (0, 3)
    assert PLANAR.norm_hessian().shape == (0, 3, 3)


@pytest.mark.parametrize("seed", range(3))
def test_opposite_quaternions_are_one_rotation(seed):
    rotation = random_rotation(SPATIAL, np.random.default_rng(seed))
    z = pose(SPATIAL, np.zeros(3), rotation)
    assert np.array_equal(SPATIAL.rotation_increment(z), SPATIAL.rotation_increment(-z))
