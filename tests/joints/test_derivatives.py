"""Derived gradients, Hessians and motor rates of every joint pass the Taylor test far from the drawn pose."""

import numpy as np
import pytest

from .cases import CASES, DRIVEN, compiled, draw
from .poses import carry, pose, random_pose, turn
from .taylor import assert_derivative

EVERY_JOINT = pytest.mark.parametrize(
    ("case", "driven"),
    [*((case, False) for case in CASES), *((case, True) for case in DRIVEN)],
    ids=lambda value: {True: "driven", False: "free"}.get(value, str(value)),
)
EVERY_MOTOR = pytest.mark.parametrize("case", DRIVEN, ids=str)
SEEDS = pytest.mark.parametrize("seed", range(3))


def anywhere(case, rng):
    """Two unrelated poses, a drawn joint and a motor value."""
    poses = np.concatenate([random_pose(case.space, rng), random_pose(case.space, rng)])
    return poses, draw(case.space, rng), float(rng.uniform(-3.0, 3.0))


@pytest.mark.thorough
@EVERY_JOINT
@SEEDS
def test_gradient_passes_the_taylor_test(case, driven, seed):
    rng = np.random.default_rng(seed)
    c, (z, drawn, value) = compiled(case, driven=driven), anywhere(case, rng)
    slope = c.gradient(z, drawn.anchors, drawn.triad, value)
    assert slope.shape == (c.rows, 2 * case.space.pose_size)
    assert_derivative(lambda y: c.value(y, drawn.anchors, drawn.triad, value), z, slope, rng)


@EVERY_JOINT
@SEEDS
def test_hessian_passes_the_taylor_test(case, driven, seed):
    rng = np.random.default_rng(seed)
    c, (z, drawn, value) = compiled(case, driven=driven), anywhere(case, rng)
    multipliers = rng.standard_normal(c.rows)
    curvature = c.hessian(z, drawn.anchors, drawn.triad, value, multipliers)
    assert np.array_equal(curvature, curvature.T)
    assert_derivative(lambda y: c.gradient(y, drawn.anchors, drawn.triad, value).T @ multipliers, z, curvature, rng)


@EVERY_MOTOR
@SEEDS
def test_motor_rate_passes_the_taylor_test(case, seed):
    rng = np.random.default_rng(seed)
    c, (z, drawn, value) = compiled(case, driven=True), anywhere(case, rng)
    rate = c.rate(z, drawn.anchors, drawn.triad, value)
    assert rate.shape == (c.rows,)
    assert not np.any(rate[:-1])  # a motor's equation is the last
    assert_derivative(
        lambda v: c.value(z, drawn.anchors, drawn.triad, float(v[0])), np.array([value]), rate[:, None], rng
    )


@EVERY_MOTOR
@SEEDS
def test_force_rate_passes_the_taylor_test(case, seed):
    rng = np.random.default_rng(seed)
    c, (z, drawn, value) = compiled(case, driven=True), anywhere(case, rng)
    multipliers = rng.standard_normal(c.rows)
    force_rate = c.force_rate(z, drawn.anchors, drawn.triad, value, multipliers)
    assert force_rate.shape == z.shape

    def weighted(v):
        return c.gradient(z, drawn.anchors, drawn.triad, float(v[0])).T @ multipliers

    assert_derivative(weighted, np.array([value]), force_rate[:, None], rng)


@EVERY_JOINT
def test_every_joint_closes_exactly_as_drawn(case, driven):
    rng = np.random.default_rng(0)
    drawn = draw(case.space, rng)
    for far in (1.0, 1e6):
        value = compiled(case, driven=driven).value(drawn.identity, far * drawn.anchors, drawn.triad, 0.0)
        assert np.max(np.abs(value), initial=0.0) <= 4e-16  # rounding of the triad only, wherever the joint is


@pytest.mark.parametrize("case", [case for case in CASES if case.kind.shares_point], ids=str)
@SEEDS
def test_points_that_a_tiny_turn_parts_keep_the_digits_of_their_distance(case, seed):
    # φ × anchor + ½ φ × (φ × anchor): the rounding of cos φ is a hundred times the second term
    rng = np.random.default_rng(seed)
    drawn, axis = draw(case.space, rng), rng.standard_normal(2 * case.dim - 3)
    turned = pose(case.space, np.zeros(case.dim), turn(case.space, 1e-9 * axis / np.linalg.norm(axis)))
    z = np.concatenate([case.space.identity, turned])
    apart = compiled(case).value(z, drawn.anchors, drawn.triad, 0.0)[: case.dim]
    (expected,) = case.space.displace(turned, drawn.anchors[1:])
    assert np.linalg.norm(apart - expected) <= 1e-14 * np.linalg.norm(expected)


@EVERY_JOINT
@SEEDS
def test_equations_look_the_same_from_every_frame(case, driven, seed):
    # scalar products do not change when both bodies move together; the difference of two points turns
    rng = np.random.default_rng(seed)
    c, (z, drawn, value), half = compiled(case, driven=driven), anywhere(case, rng), case.space.pose_size
    frame = random_pose(case.space, rng)
    lever = drawn.anchors[0] - drawn.anchors[1]
    both = [carry(case.space, frame, z[:half], np.zeros(case.dim)), carry(case.space, frame, z[half:], lever)]
    here = c.value(z, drawn.anchors, drawn.triad, value)
    there = c.value(np.concatenate(both), drawn.anchors, drawn.triad, value)
    points = case.dim if case.kind.shares_point else 0
    assert there[points:] == pytest.approx(here[points:], abs=1e-13)
    assert there[:points] == pytest.approx(case.space.rotate(frame, here[:points]) if points else [], abs=1e-13)
