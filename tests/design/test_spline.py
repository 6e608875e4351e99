"""Splines: parameter counts, joints that stay, and derivatives."""

import numpy as np
import pytest

from fenicsmech.design import LinkSpline

from ..oracles.dense import jacobian


def spline(joints: list[bool], seed: int = 0) -> LinkSpline:
    """A wavy spline with control points at x = 0, 10, 20, …"""
    random = np.random.default_rng(seed)
    controls = random.uniform(-2.0, 2.0, (len(joints), 2, 3)) + np.array([[0.0, 0.0, 3.0], [10.0, 0.0, 0.0]])
    controls[:, 0, 0] += 10.0 * np.arange(len(joints))
    controls[joints, 0, 2] = 1.0
    return LinkSpline(controls, np.array(joints))


@pytest.mark.parametrize(
    ("joints", "count"),
    [
        ([True, False, False, True], 18),
        ([True, False, True], 12),
        ([True, True, False, True], 15),
        ([True, True, True], 9),
    ],
)
def test_parameters_are_three_per_joint_and_six_per_interior_control_point(joints, count):
    assert spline(joints).size == len(spline(joints).initial) == count


def test_joints_keep_place_and_thickness_for_all_parameters():
    link = spline([True, False, True, True])
    joints = np.flatnonzero(link.is_joint)
    fixed = link.evaluate(link.initial, joints)
    p = link.initial + np.random.default_rng(1).uniform(-5.0, 5.0, link.size)
    assert link.evaluate(p, joints) == pytest.approx(fixed, abs=1e-13)
    assert fixed[:, 2] == pytest.approx(1.0)


def test_curve_and_its_tangent_are_continuous_where_segments_meet():
    link = spline([True, False, False, True])
    t = np.array([1.0, 2.0])
    for order in (0, 1):
        before, after = (link.basis(t, order=order, segments=s) for s in (np.array([0, 1]), np.array([1, 2])))
        assert before == pytest.approx(after, abs=1e-14)


def test_parameters_are_positions_and_tangents():
    link = spline([True, False, True])
    p = np.arange(1.0, 13.0)
    assert link.derivative(p, np.array([0.0, 2.0])) == pytest.approx(np.array([[1, 2, 3], [10, 11, 12]]))
    assert link.evaluate(p, np.array([1.0])) == pytest.approx(np.array([[4, 5, 6]]))
    assert link.derivative(p, np.array([1.0])) == pytest.approx(np.array([[7, 8, 9]]))


@pytest.mark.parametrize("order", [0, 1, 2])
def test_derivatives_by_parameters_and_along_the_curve(order):
    link = spline([True, False, False, True])
    t, p = np.array([0.3, 1.4, 2.9]), link.initial + 0.5
    by_p = jacobian(lambda q: link.basis(t, order=order) @ link.controls_at(q).reshape(-1, 3), p)
    assert link.gradient(t, order=order) == pytest.approx(by_p, abs=1e-9)
    by_t = jacobian(lambda shift: link.basis(t + shift, order=order), [0.0], step=0.05)[..., 0]
    assert link.basis(t, order=order + 1) == pytest.approx(by_t, abs=1e-8)
