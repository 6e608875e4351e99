"""Handles: identity at the start, and exact derivatives of their maps."""

import numpy as np
import pytest

from fenicsmech.design import BETWEEN, shape_link

from ..oracles.dense import jacobian, taylor_rates
from .shapes import bench, request, strip_mesh

LINKS = [0, 1]


def away(link: int):
    """Handles of a link with a design and positions away from the initial ones."""
    both = bench(2)
    handles = both.shape.shapes[link].handles
    return handles, both.shape.parameters(both.design(0.2))[link], both.shape.positions(both.positions())[link]


@pytest.mark.parametrize("link", LINKS)
def test_nothing_moves_at_the_initial_design(link):
    handles = bench(2).shape.shapes[link].handles
    assert handles.transforms(handles.spline.initial, handles.initial) == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("link", LINKS)
def test_handles_sit_at_joints_and_at_even_distances_outside_of_interfaces(link):
    handles = bench(2).shape.shapes[link].handles
    joints = handles.site != BETWEEN
    assert np.all(np.diff(handles.t) > 0.0)
    assert sorted(handles.site[joints]) == list(range(joints.sum()))
    for start, end in zip(np.flatnonzero(joints), np.flatnonzero(joints)[1:], strict=False):
        inner = handles.centre[start + 1 : end]
        steps = np.linalg.norm(np.diff(inner, axis=0), axis=1)
        assert steps == pytest.approx(np.full(len(steps), steps.mean()), rel=0.02)
        for joint in (start, end):
            assert np.linalg.norm(inner - handles.centre[joint], axis=1).min() > 2.5  # the radius of an interface


def test_an_intermediary_handle_turns_scales_and_shifts_like_the_spline():
    handles, p, theta = away(0)
    spline, between = handles.spline, np.flatnonzero(handles.slides)
    T = handles.transforms(p, theta)[between]
    now, before = (
        (spline.evaluate(q, t[between]), spline.derivative(q, t[between])[:, :2])
        for q, t in ((p, theta), (spline.initial, handles.t))
    )
    assert T[..., 2] == pytest.approx(now[0][:, :2] - before[0][:, :2])
    for matrix, delta, old, new in zip(T[..., :2] + np.eye(2), now[0][:, 2], before[1], now[1], strict=True):
        assert matrix.T @ matrix == pytest.approx(delta**2 * np.eye(2))
        assert matrix @ old / np.linalg.norm(old) == pytest.approx(delta * new / np.linalg.norm(new))


@pytest.mark.parametrize("link", LINKS)
def test_gradients_of_the_maps(link):
    handles, p, theta = away(link)
    by_p, by_theta = handles.gradients(p, theta)
    assert by_p == pytest.approx(jacobian(lambda q: handles.transforms(q, theta), p), abs=1e-8)
    step = 0.2 * np.min(np.abs(theta[handles.slides] - np.rint(theta[handles.slides])))
    full = jacobian(lambda x: handles.transforms(p, x), theta, step=min(step, 0.05))
    for j, rows in enumerate(full):
        assert rows[..., j] == pytest.approx(by_theta[j], abs=1e-7)
        assert np.delete(rows, j, axis=-1) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("link", LINKS)
def test_maps_pass_the_taylor_test_by_parameters_and_positions_together(link):
    handles, p, theta = away(link)
    by_p, by_theta = handles.gradients(p, theta)
    random = np.random.default_rng(9)
    dp = random.standard_normal(len(p)) * np.where(handles.spline.is_thickness, 0.2, 3.0)
    dtheta = random.uniform(-0.1, 0.1, len(theta))
    slope = by_p @ dp + by_theta * dtheta[:, None, None]
    rates = taylor_rates(
        lambda h: handles.transforms(p + h[0] * dp, theta + h[0] * dtheta).ravel(),
        [0.0],
        [1.0],
        slope.reshape(-1, 1),
        [0.04, 0.02, 0.01, 0.005],
    )
    assert rates.with_gradient.min() >= 1.95
    assert rates.without.min() >= 0.95


@pytest.mark.parametrize("link", LINKS)
def test_second_derivatives_of_the_maps(link):
    handles, p, theta = away(link)
    weights = np.random.default_rng(5).standard_normal((len(handles), 2, 3))
    cross, twice = (
        derivative(p, theta, weights, handles.segments(theta))
        for derivative in (handles.by_theta_and_p, handles.twice_by_theta)
    )

    def slope(q, x):
        return np.sum(weights * handles.gradients(q, x)[1], axis=(1, 2))

    assert cross == pytest.approx(jacobian(lambda q: slope(q, theta), p), abs=1e-6)
    step = 0.2 * np.min(np.abs(theta[handles.slides] - np.rint(theta[handles.slides])))
    along = jacobian(lambda shift: slope(p, theta + shift), [0.0], step=min(step, 0.05))[:, 0]
    assert twice == pytest.approx(along, rel=1e-6, abs=1e-6)


def test_clamped_interfaces_do_not_turn():
    handles = shape_link(strip_mesh(0, 2), request(0, turns=False)).handles
    assert not np.any(handles.turns)
    assert np.any(bench(2).shape.shapes[0].handles.turns)


def test_wide_links_have_fewer_handles():
    counts = [len(shape_link(strip_mesh(0, 2, width=width), request(0)).handles) for width in (3.0, 5.0, 9.0)]
    assert counts[0] > counts[1] > counts[2] >= 3
