"""Barriers and penalties: the paper's constants, exact gradients, and how they combine."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design.barrier import Barrier
from fenicsmech.design.penalties import Bounds, ShapeBounds, StayClose
from fenicsmech.design.spline import LinkSpline
from fenicsmech.design.spline_samples import SplineSamples

from ..oracles.dense import hessian, taylor_rates


def spline() -> LinkSpline:
    """An arch with one interior control point."""
    controls = np.zeros((3, 2, 3))
    controls[:, 0] = [(0, 0, 1), (30, 12, 1), (60, 0, 1)]
    controls[:, 1] = [(30, 20, 0), (30, 0, 0), (30, -20, 0)]
    return LinkSpline(controls, np.array([True, False, True]))


def bounds(link: LinkSpline) -> ShapeBounds:
    return ShapeBounds([SplineSamples(link)], [3.0], [Bounds((2.5, 3.5), bend=0.002)], [slice(0, link.size)])


def test_barrier_is_zero_inside_and_twice_continuously_differentiable_at_its_limit():
    barrier = Barrier(30.0, 30.0, 5.0)
    assert barrier.value(np.array([0.0, 30.0, 60.0])) == pytest.approx([0.0, 0.0, 5.0])
    just = np.array([30.0 - 1e-9, 30.0 + 1e-9])
    for derivative in (barrier.value, barrier.slope, barrier.curvature):
        assert derivative(just) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_curvature_ratio_of_a_circle_is_segment_over_radius():
    link = spline()
    samples = SplineSamples(link, count=40)
    p = link.initial
    points = link.evaluate(p, samples.t)[:, :2]
    a, b = np.diff(points, axis=0)[:-1], np.diff(points, axis=0)[1:]
    sides = [np.linalg.norm(v, axis=1) for v in (a, b, a + b)]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    radius = sides[0] * sides[1] * sides[2] / (4.0 * area)
    assert np.abs(samples.curvature(p)[0]) == pytest.approx(0.5 * (sides[0] + sides[1]) / radius, rel=1e-10)


def test_shape_bounds_pass_the_taylor_test_where_all_four_are_active():
    link = spline()
    penalty = bounds(link)
    random = np.random.default_rng(3)
    p = link.initial + np.where(
        link.is_thickness, random.uniform(-2.0, 2.0, link.size), random.uniform(-9, 9, link.size)
    )
    direction = random.standard_normal(link.size) * np.where(link.is_thickness, 0.3, 3.0)
    assert penalty.at(p).value > 1.0
    rates = taylor_rates(
        lambda q: penalty.at(q).value, p, direction, penalty.at(p).gradient, [0.02, 0.01, 0.005, 0.0025]
    )
    assert np.all(rates.with_gradient >= 1.95)
    assert np.all(rates.without >= 0.95)


def test_nothing_is_penalised_inside_the_bounds():
    link = spline()
    penalty = ShapeBounds([SplineSamples(link)], [3.0], [Bounds((1.0, 9.0))], [slice(0, link.size)])
    here = penalty.at(link.initial)
    assert here.value == 0.0
    assert not here.gradient.any()
    assert not here.curvature.any()


def test_thickness_barriers_have_their_exact_curvature():
    link = spline()
    penalty = ShapeBounds([SplineSamples(link, count=30)], [3.0], [Bounds((2.0, 4.0), bend=9.0)], [slice(0, link.size)])
    p = link.initial + np.where(link.is_thickness, 0.8, 0.0)
    here = penalty.at(p)
    assert here.value > 0.0
    exact = hessian(lambda q: penalty.at(q).value, p, step=1e-3)
    assert here.curvature == pytest.approx(exact, abs=1e-5 * np.abs(exact).max())


def test_penalties_add_and_scale():
    start, p = np.array([1.0, -2.0]), np.array([2.0, 0.0])
    close = StayClose(start)
    both = 3.0 * close + close * 0.5
    assert both.at(p).value == pytest.approx(3.5 * 2.5)
    assert both.at(p).gradient == pytest.approx(3.5 * (p - start))
    assert both.at(p).curvature == pytest.approx(3.5 * np.eye(2))
