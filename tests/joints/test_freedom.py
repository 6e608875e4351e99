"""Each joint leaves exactly its own motions free, finite ones included, and a motor drives one of them."""

import numpy as np
import pytest

from fenicsmech.joints import UNIVERSAL

from .cases import CASES, DRIVEN, MOTIONS, compiled, draw
from .poses import random_pose

EVERY_JOINT = pytest.mark.parametrize("case", CASES, ids=str)
EVERY_MOTOR = pytest.mark.parametrize("case", DRIVEN, ids=str)
BLOCKED = [(case, motion) for case in CASES for motion in case.blocked]
# a cross bent by a right angle is singular
ANYWHERE = [
    (case, size) for case in CASES for size in (0.7, 0.5 * np.pi, 3.0) if case.kind is not UNIVERSAL or size < 1.0
]
SEEDS = pytest.mark.parametrize("seed", range(3))


def residual(case, drawn, z):
    return np.max(np.abs(compiled(case).value(z, drawn.anchors, drawn.triad, 0.0)), initial=0.0)


def responses(c, drawn, z, body):
    """Rates of all equations, motor as drawn, while ``body`` makes each of the unit motions; a column each."""
    gradient = c.gradient(z, drawn.anchors, drawn.triad, 0.0)
    return gradient @ np.stack([drawn.rigid_motion(z, motion, body) for motion in MOTIONS[drawn.space.dim]], axis=1)


@pytest.mark.thorough
@EVERY_JOINT
@SEEDS
def test_free_motions_keep_the_joint_closed(case, seed):
    rng = np.random.default_rng(seed)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    together = {motion: rng.uniform(-2.0, 2.0) for motion in case.free}
    for motions in ({}, *({motion: size} for motion, size in together.items()), together):
        assert residual(case, drawn, drawn.moved(a, motions)) <= 1e-14


@pytest.mark.parametrize(("case", "motion"), BLOCKED, ids=str)
@pytest.mark.parametrize("size", [0.2, -0.2])
def test_blocked_motions_open_the_joint(case, motion, size):
    rng = np.random.default_rng(0)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    assert residual(case, drawn, drawn.moved(a, {motion: size})) >= np.sin(0.2) / np.sqrt(case.dim)


@EVERY_JOINT
@pytest.mark.parametrize("body", [0, 1], ids=["a", "b"])
@SEEDS
def test_rank_is_the_number_of_blocked_motions(case, body, seed):
    rng = np.random.default_rng(seed)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    response = responses(compiled(case), drawn, drawn.moved(a, {}), body)
    assert len(response) == len(case.blocked) == case.space.freedoms - len(case.free)  # no equation too many
    assert np.linalg.matrix_rank(response, tol=0.5) == len(case.blocked)
    silent = [MOTIONS[case.dim].index(motion) for motion in case.free]
    assert response[:, silent] == pytest.approx(np.zeros((len(response), len(silent))), abs=1e-14)


@pytest.mark.parametrize(("case", "size"), ANYWHERE, ids=str)
def test_free_motions_neither_lock_nor_loosen_the_joint(case, size):
    rng = np.random.default_rng(0)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    z = drawn.moved(a, dict.fromkeys(case.free, size))
    response = responses(compiled(case), drawn, z, 1)
    assert np.linalg.matrix_rank(response, tol=0.2) == len(case.blocked)


@EVERY_JOINT
@SEEDS
def test_moving_both_bodies_together_is_free(case, seed):
    rng = np.random.default_rng(seed)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    z = drawn.moved(a, {motion: rng.uniform(-1.0, 1.0) for motion in case.free})
    together = responses(compiled(case), drawn, z, 0) + responses(compiled(case), drawn, z, 1)
    assert together == pytest.approx(np.zeros_like(together), abs=1e-14)


@pytest.mark.thorough
@EVERY_MOTOR
@pytest.mark.parametrize("value", [-2.5, -0.3, 0.0, 1e-9, 0.7, 3.0])
def test_motor_takes_the_free_coordinate_to_its_value(case, value):
    rng = np.random.default_rng(0)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    c = compiled(case, driven=True)
    z = drawn.moved(a, {case.own: value})
    assert c.value(z, drawn.anchors, drawn.triad, value) == pytest.approx(np.zeros(c.rows), abs=1e-14)
    off = c.value(z, drawn.anchors, drawn.triad, value - 0.1)[-1]
    assert off == pytest.approx(0.1, abs=2e-4)  # b is ahead of the motor: the equation is the lag, counted from a to b


@EVERY_MOTOR
@SEEDS
def test_motor_equation_grows_by_one_with_its_own_coordinate(case, seed):
    # its multiplier is then the motor's force or torque
    rng = np.random.default_rng(seed)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    c = compiled(case, driven=True)
    z = drawn.moved(a, {})
    own = MOTIONS[case.dim].index(case.own)
    assert responses(c, drawn, z, 1)[-1, own] == pytest.approx(1.0, abs=1e-14)
    assert responses(c, drawn, z, 0)[-1, own] == pytest.approx(-1.0, abs=1e-14)
    assert c.rate(z, drawn.anchors, drawn.triad, 0.0)[-1] == pytest.approx(-1.0, abs=1e-14)


@EVERY_MOTOR
@pytest.mark.parametrize("value", [-2.0, 0.4, 1.5])
def test_motor_equation_still_grows_by_one_when_the_motor_has_moved(case, value):
    rng = np.random.default_rng(0)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    c, step = compiled(case, driven=True), 1e-3
    ahead, behind = (
        c.value(drawn.moved(a, {case.own: value + side}), drawn.anchors, drawn.triad, value)[-1]
        for side in (step, -step)
    )
    assert (ahead - behind) / (2.0 * step) == pytest.approx(1.0, abs=step**2)
    assert c.rate(drawn.moved(a, {case.own: value}), drawn.anchors, drawn.triad, value)[-1] == pytest.approx(-1.0)


@EVERY_MOTOR
def test_driven_joint_leaves_nothing_of_its_coordinate(case):
    rng = np.random.default_rng(0)
    drawn, a = draw(case.space, rng), random_pose(case.space, rng)
    response = responses(compiled(case, driven=True), drawn, drawn.moved(a, {}), 1)
    assert response.shape == (case.space.freedoms, case.space.freedoms)
    assert np.linalg.matrix_rank(response, tol=0.5) == case.space.freedoms
