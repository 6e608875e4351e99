"""Samples of a spline: linear thickness, the curvature of the circle through three of them, exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design import LinkSpline, SplineSamples

from ..oracles.dense import jacobian, taylor_rates

BETWEEN = np.array([True, False, False, True])


def wavy(unit: float = 1.0) -> LinkSpline:
    """A spline that bends to both sides, in a unit of length ``unit`` mm long."""
    random = np.random.default_rng(2)
    controls = random.uniform(-4.0, 4.0, (4, 2, 3)) + np.array([[0.0, 0.0, 6.0], [12.0, 0.0, 0.0]])
    controls[:, 0, 0] += 12.0 * np.arange(4)
    controls[..., :2] /= unit
    return LinkSpline(controls, BETWEEN)


def design(link: LinkSpline, seed: int = 5) -> np.ndarray:
    return link.initial + np.random.default_rng(seed).uniform(-1.0, 1.0, link.size)


def test_thickness_is_that_of_the_spline_and_linear_in_the_parameters():
    link = wavy()
    samples = SplineSamples(link, count=60)
    p, q = design(link), design(link, 6)
    assert samples.thickness(p) == pytest.approx(link.evaluate(p, samples.t)[:, 2])
    assert samples.thickness(q) - samples.thickness(p) == pytest.approx(samples.thickness_gradient @ (q - p))
    assert samples.t[[0, -1]].tolist() == [0.0, link.segments]


def test_curvature_ratio_is_the_length_of_a_segment_over_the_radius_of_the_circle_through_its_neighbours():
    link = wavy()
    samples = SplineSamples(link, count=40)
    p = design(link)
    points = link.evaluate(p, samples.t)[:, :2]
    a, b = np.diff(points, axis=0)[:-1], np.diff(points, axis=0)[1:]
    sides = [np.linalg.norm(v, axis=1) for v in (a, b, a + b)]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    radius = sides[0] * sides[1] * sides[2] / (4.0 * area)  # positive where it turns to the left
    assert samples.curvature(p) == pytest.approx(0.5 * (sides[0] + sides[1]) / radius, rel=1e-10)
    assert samples.curvature(p).min() < 0.0 < samples.curvature(p).max()


def test_curvature_ratio_does_not_depend_on_the_unit_of_length():
    millimetres, metres = wavy(), wavy(1000.0)
    assert SplineSamples(metres).curvature(metres.initial) == pytest.approx(
        SplineSamples(millimetres).curvature(millimetres.initial), rel=1e-8, abs=1e-12
    )


def test_a_straight_spline_has_no_curvature_but_a_derivative():
    controls = np.zeros((2, 2, 3))
    controls[:, 0], controls[:, 1] = [(0, 0, 1), (30, 0, 1)], [(30, 0, 0), (30, 0, 0)]
    link = LinkSpline(controls, np.array([True, True]))
    samples = SplineSamples(link, count=20)
    everywhere = np.ones(18, dtype=bool)
    assert samples.curvature(link.initial) == pytest.approx(0.0, abs=1e-14)
    gradient = samples.curvature_gradient(link.initial, everywhere)
    assert gradient == pytest.approx(jacobian(samples.curvature, link.initial), abs=1e-9)
    assert np.abs(gradient).max() > 1e-4


def test_curvature_gradient_agrees_with_differences_at_chosen_samples():
    link = wavy()
    samples = SplineSamples(link, count=30)
    p, chosen = design(link), np.arange(28) % 3 == 1
    gradient = samples.curvature_gradient(p, chosen)
    assert gradient.shape == (chosen.sum(), link.size)
    assert gradient == pytest.approx(jacobian(samples.curvature, p)[chosen], abs=1e-8)
    assert not np.any(gradient[:, link.is_thickness])


def test_curvature_gradient_passes_the_taylor_test_at_all_samples():
    link = wavy()
    samples = SplineSamples(link)
    p, direction = design(link), design(link, 7) - link.initial
    slope = samples.curvature_gradient(p, np.ones(len(samples.t) - 2, dtype=bool)) @ direction
    rates = taylor_rates(
        lambda h: samples.curvature(p + h[0] * direction), [0.0], [1.0], slope[:, None], [0.2, 0.1, 0.05, 0.025]
    )
    assert rates.with_gradient.min() >= 1.95
    assert rates.without.min() >= 0.95
