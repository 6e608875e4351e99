"""Best handle positions: better meshes, an exact implicit derivative, kinks of the spline, ranks."""

from dataclasses import replace

import numpy as np
import pytest

from fenicsmech.design import HandleOptimum, HandleOptions, LinkHandles, ShapeError, crowding, follow_spline, motion

from ..oracles.dense import taylor_rates
from .shapes import bench

each_dim = pytest.mark.parametrize("dim", [2, 3])


def naive(both, p: np.ndarray) -> np.ndarray:
    """Joints turned like the spline's tangent, all other handles where they were."""
    shape = both.shape
    links = zip(shape.shapes, shape.parameters(p), strict=True)
    return np.concatenate([follow_spline(link.handles, q) for link, q in links])


def slopes(both, p: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """∂S/∂θ."""
    both.shape.apply(p, theta)
    return both.shape.apply_transpose(p, theta, both.quality.gradient())[1]


@each_dim
def test_strongly_changed_designs_get_better_meshes(dim):
    both = bench(dim)
    p = both.design(0.25, seed=6)
    both.shape.apply(p, naive(both, p))
    before, worst_before = both.quality.value(), both.quality.cell_values().max()
    placed = both.optimum.solve(p)
    after, worst_after = both.quality.value(), both.quality.cell_values().max()
    assert placed.quality == pytest.approx(after)
    assert after < before
    assert worst_after < worst_before


@each_dim
def test_the_sum_is_stationary_at_the_optimum_and_handles_stay_in_order(dim):
    both = bench(dim)
    p = both.design(0.2, seed=6)
    placed = both.optimum.solve(p)
    start = slopes(both, p, both.shape.initial_theta)
    assert np.abs(slopes(both, p, placed.theta)).max() < 1e-6 * np.abs(start).max()
    for link, theta in zip(both.shape.shapes, both.shape.positions(placed.theta), strict=True):
        along = np.where(link.handles.slides, theta, link.handles.t)
        assert np.all(np.diff(along) > 0.0)
        assert (along[0], along[-1]) == (0.0, link.handles.spline.segments)


def test_designs_that_invert_cells_at_first_are_reached_in_steps():
    both = bench(2)
    p = both.design(0.45, seed=8)
    both.shape.apply(p, naive(both, p))
    assert both.quality.value() == np.inf
    assert np.isfinite(both.optimum.solve(p).quality)


def test_designs_without_a_proper_mesh_are_refused():
    both = bench(2)
    p = both.shape.initial.copy()
    p[np.concatenate([link.handles.spline.is_thickness for link in both.shape.shapes])] = -3.0
    with pytest.raises(ShapeError, match="inverted"):
        both.optimum.solve(p)


def test_joints_that_may_not_turn_do_not():
    both = bench(2, turns=False)
    placed = both.optimum.solve(both.design(0.2, seed=6))
    for link, theta in zip(both.shape.shapes, both.shape.positions(placed.theta), strict=True):
        assert not np.any(theta[~link.handles.slides])


def test_optimum_does_not_depend_on_the_unit_of_length():
    millimetres, metres = bench(2), bench(2, unit=1000.0)
    p = millimetres.design(0.2, seed=6)
    lengths = ~np.concatenate([link.handles.spline.is_thickness for link in millimetres.shape.shapes])
    one, other = millimetres.optimum.solve(p), metres.optimum.solve(np.where(lengths, p / 1000.0, p))
    assert other.theta == pytest.approx(one.theta, abs=1e-6)
    assert other.quality == pytest.approx(one.quality, rel=1e-9)


@each_dim
@pytest.mark.parametrize("seed", [1, 2])
def test_total_gradient_agrees_with_differences_of_best_positions(dim, seed):
    both = bench(dim)
    placed = both.optimum.solve(both.design(0.2, seed))
    g = np.random.default_rng(seed).standard_normal((both.shape.owned, dim))
    gradient = both.optimum.total_gradient(placed, *both.shape.apply_transpose(placed.p, placed.theta, g))
    direction = both.direction(seed + 20)

    def value(h: float) -> float:
        near = both.optimum.solve(placed.p + h * direction, placed)
        return np.sum(g * both.shape.field(near.p, near.theta)[: both.shape.owned])

    h = 1e-4
    difference = (value(h) - value(-h)) / (2 * h)
    assert gradient @ direction == pytest.approx(difference, rel=1e-5)
    partial = both.shape.apply_transpose(placed.p, placed.theta, g)[0] @ direction
    assert abs(partial - difference) > 1e-3 * abs(difference)  # the part of the handles is not small


@each_dim
@pytest.mark.parametrize("shared", [False, pytest.param(True, marks=pytest.mark.parallel)], ids=["alone", "together"])
def test_total_gradient_passes_the_taylor_test_with_handles_that_follow(dim, shared):
    both = bench(dim, shared=shared)
    comm, owned = both.mesh.mesh.comm, both.shape.owned
    placed = both.optimum.solve(both.design(0.2))
    g = np.random.default_rng(4).standard_normal(both.mesh.vertices.shape)[both.shape.original][:owned]
    gradient = both.optimum.total_gradient(placed, *both.shape.apply_transpose(placed.p, placed.theta, g))

    def value(p: np.ndarray) -> float:
        near = both.optimum.solve(p, placed)
        return comm.allreduce(np.sum(g * both.shape.field(near.p, near.theta)[:owned]))

    rates = taylor_rates(value, placed.p, both.direction(24), gradient, [0.002, 0.001, 0.0005])
    assert rates.with_gradient.min() >= 1.95
    assert rates.without.min() >= 0.95


def test_gradients_of_several_outputs_at_once():
    both = bench(2)
    placed = both.optimum.solve(both.design())
    random = np.random.default_rng(0)
    by_p, by_theta = random.standard_normal((3, len(placed.p))), random.standard_normal((3, len(placed.theta)))
    together = both.optimum.total_gradient(placed, by_p, by_theta)
    for row, one_p, one_theta in zip(together, by_p, by_theta, strict=True):
        assert row == pytest.approx(both.optimum.total_gradient(placed, one_p, one_theta))


def test_handles_near_by_are_found_in_few_iterations():
    both = bench(2)
    placed = both.optimum.solve(both.design(0.2))
    nothing = np.zeros(len(placed.theta))
    both.optimum.total_gradient(placed, np.zeros(len(placed.p)), nothing)  # lets the next solve start on the tangent
    near = both.optimum.solve(both.design(0.201), placed)
    assert near.iterations <= 2
    fresh = HandleOptimum(both.shape, both.quality).solve(both.design(0.201), placed)
    assert near.theta == pytest.approx(fresh.theta, abs=1e-7)


def test_a_placement_without_a_gradient_leads_to_those_near_by_all_the_same():
    both = bench(2)
    p = both.design(0.2, seed=6)
    best, nearby = both.optimum.solve(p), both.optimum.solve(1.001 * p)
    refused = 0
    for shift in 0.2 * np.eye(len(best.theta)):
        off = replace(best, theta=best.theta + shift)
        both.shape.apply(p, off.theta)
        if not np.isfinite(both.quality.value()):
            continue
        try:
            both.optimum.total_gradient(off, np.zeros(len(p)), np.ones(len(shift)))
        except ShapeError:
            refused += 1
            assert both.optimum.solve(1.001 * p, off).quality == pytest.approx(nearby.quality, rel=1e-6)
    assert refused > 0


def one_handle_at_a_control_point() -> tuple[LinkHandles, np.ndarray, np.ndarray]:
    """Handles of the arch with an intermediary one at t = 1, and a design that bends differently on both sides."""
    handles = bench(2).shape.shapes[0].handles
    t = np.array([0.0, 1.0, handles.spline.segments])
    few = LinkHandles(handles.spline, t, np.array([0, -1, 1]), np.array([True, False, True]))
    p = handles.spline.initial.copy()
    p[1] += 15.0  # the tangent at the first joint
    return few, p, few.initial


@pytest.mark.parametrize("held", [True, False])
def test_a_handle_at_a_kink_is_held_or_goes_to_the_side_where_the_sum_falls(held):
    handles, p, theta = one_handle_at_a_control_point()
    after, before = (handles.by_theta(p, theta, np.full(3, segment))[1] for segment in (1, 0))
    assert np.abs(after - before).max() > 1e-3
    # the sum rises both ways, or falls on the later side
    wanted = np.array([1.0, -1.0]) if held else np.array([-1.0, -1.0])
    slope = np.linalg.lstsq(np.array([after.ravel(), before.ravel()]), wanted, rcond=None)[0]
    gradient = np.zeros((3, 2, 3))
    gradient[1] = slope.reshape(2, 3)
    sides = motion(handles, p, theta, gradient, HandleOptions())
    assert sides.free.tolist() == [True, not held, True]
    assert held or sides.segments[1] == 1


def test_handles_that_a_constant_slope_presses_together_stay_apart():
    handles, options = bench(2).shape.shapes[0].handles, HandleOptions()
    theta, force = handles.initial.copy(), np.zeros(len(handles))
    second, third = np.flatnonzero(handles.slides)[1:3]
    force[second] = -100.0  # falls towards the next one
    drawn = theta[third] - theta[second]
    for _ in range(60):
        gap = theta[third] - theta[second]
        _, slope, curvature = crowding(handles, theta, options)
        step = -(slope + force)[second] / max(curvature[second, second], 1e-3)
        theta[second] += np.clip(step, -0.8 * gap, 0.8 * gap)
    _, slope, curvature = crowding(handles, theta, options)
    assert (slope + force)[second] == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < theta[third] - theta[second] < options.close * drawn
    assert curvature[second, second] > 0.0


def test_what_keeps_handles_apart_is_nothing_far_apart_and_smooth():
    handles, options = bench(2).shape.shapes[0].handles, HandleOptions()
    value, slope, curvature = crowding(handles, handles.initial, options)
    assert value == 0.0 and not slope.any() and not curvature.any()
    first, second = np.flatnonzero(handles.slides)[:2]
    near = handles.initial.copy()
    near[first] += 0.95 * (near[second] - near[first])
    value, slope, curvature = crowding(handles, near, options)
    assert value > 0.0
    direction = 1e-3 * (near[second] - near[first]) * handles.slides
    ahead, behind = (crowding(handles, near + sign * direction * np.arange(len(near)), options) for sign in (1, -1))
    turned = direction * np.arange(len(near))
    assert (ahead[0] - behind[0]) / 2.0 == pytest.approx(slope @ turned, rel=1e-2)
    assert (ahead[1] - behind[1]) / 2.0 == pytest.approx(curvature @ turned, rel=1e-2, abs=1e-3 * abs(value))
    near[first] = near[second] + 1e-3
    assert crowding(handles, near, options)[0] == np.inf


@pytest.mark.parallel
@each_dim
def test_optimum_and_its_derivative_do_not_depend_on_the_number_of_ranks(dim):
    seen = []
    for shared in (False, True):
        both = bench(dim, shared=shared)
        placed = both.optimum.solve(both.design(0.2))
        whole = np.random.default_rng(3).standard_normal(both.mesh.vertices.shape)
        g = whole[both.shape.original[: both.shape.owned]]
        pulled = both.shape.apply_transpose(placed.p, placed.theta, g)
        gradient = both.optimum.total_gradient(placed, *pulled)
        seen.append((placed.quality, placed.theta, gradient))
    assert seen[1][0] == pytest.approx(seen[0][0], rel=1e-12)
    assert seen[1][1] == pytest.approx(seen[0][1], abs=1e-7)
    assert seen[1][2] == pytest.approx(seen[0][2], rel=1e-5, abs=1e-6 * np.abs(seen[0][2]).max())
