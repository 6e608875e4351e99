"""R − I and its derivatives: against scipy's rotations, down to tiny angles, and the same formula in sympy."""

import numpy as np
import pytest
import sympy

from fenicsmech.joints import RIGID_SPACES

from .poses import PLANAR, SPACES, SPATIAL, matrix, pose, random_pose, rotation_of, turn
from .taylor import assert_derivative

TINY = 1e-9

pytestmark = pytest.mark.parametrize("space", SPACES, ids=["planar", "spatial"])


@pytest.mark.parametrize("seed", range(5))
def test_increment_is_the_rotation_less_the_identity(space, seed):
    z = random_pose(space, np.random.default_rng(seed))
    expected = matrix(space, rotation_of(space, z)) - np.eye(space.dim)
    assert space.rotation_increment(z) == pytest.approx(expected, abs=1e-15)


def test_increment_of_the_identity_is_exactly_zero(space):
    assert np.array_equal(space.rotation_increment(space.identity), np.zeros((space.dim, space.dim)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_tiny_turn_about_z_keeps_the_digits_of_both_components(space, sign):
    # cos φ − 1 = −φ²/2 is far below the rounding of 1
    omega = np.zeros(2 * space.dim - 3)
    omega[-1] = sign * TINY
    z = pose(space, np.zeros(space.dim), turn(space, omega))
    (u,) = space.displace(z, np.eye(space.dim)[:1])
    assert u[:2] == pytest.approx([-0.5 * TINY**2, sign * TINY], rel=1e-12, abs=0.0)


@pytest.mark.parametrize("seed", range(5))
def test_tiny_turn_about_any_axis_keeps_its_digits(space, seed):
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(2 * space.dim - 3)
    axis /= np.linalg.norm(axis)
    offset = rng.standard_normal(space.dim)
    z = pose(space, np.zeros(space.dim), turn(space, TINY * axis))
    (u,) = space.displace(z, offset[None])
    if space.dim == 2:
        expected = TINY * axis[0] * np.array([-offset[1], offset[0]]) - 0.5 * TINY**2 * offset
    else:
        across = np.cross(axis, offset)
        expected = TINY * across + 0.5 * TINY**2 * np.cross(axis, across)
    assert np.linalg.norm(u - expected) <= 1e-12 * np.linalg.norm(expected)


@pytest.mark.parametrize("seed", range(3))
def test_gradient_passes_the_taylor_test(space, seed):
    rng = np.random.default_rng(seed)
    z = random_pose(space, rng)

    def increment(r):
        return space.rotation_increment(np.concatenate([z[: space.dim], r])).ravel()

    slope = space.rotation_gradient(z).reshape(space.rotation_size, -1).T
    assert_derivative(increment, z[space.dim :], slope, rng)


@pytest.mark.parametrize("seed", range(3))
def test_hessian_passes_the_taylor_test(space, seed):
    rng = np.random.default_rng(seed)
    z = random_pose(space, rng)

    def gradient(r):
        return space.rotation_gradient(np.concatenate([z[: space.dim], r])).ravel()

    curvature = space.rotation_hessian(z)
    assert np.array_equal(curvature, curvature.transpose(1, 0, 2, 3))
    assert_derivative(gradient, z[space.dim :], curvature.transpose(0, 2, 3, 1).reshape(-1, space.rotation_size), rng)


@pytest.mark.parametrize("seed", range(3))
def test_symbolic_rotation_is_the_numeric_one(space, seed):
    # for any parameters: off the unit sphere too, where derivatives are taken
    r = np.random.default_rng(seed).standard_normal(space.rotation_size)
    symbols = list(sympy.symbols(f"r:{space.rotation_size}"))
    symbolic = sympy.lambdify(symbols, space.symbolic_rotation(symbols))(*r)
    numeric = np.eye(space.dim) + space.rotation_increment(np.concatenate([np.zeros(space.dim), r]))
    assert np.array(symbolic) == pytest.approx(numeric, rel=1e-14, abs=1e-14)


def test_spaces_are_found_by_dimension(space):
    assert RIGID_SPACES[space.dim] is space
    assert (space.dim, space.rotation_size, space.pose_size, space.freedoms) in {(2, 1, 3, 3), (3, 4, 7, 6)}
    assert space in (PLANAR, SPATIAL)
