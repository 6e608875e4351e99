"""The centreline is the interpolating cubic spline, with the right length, frame and curvature."""

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Centreline

BENT = [(0.0, 0.0), (18.0, 34.0), (40.0, 60.0), (70.0, 55.0)]


def test_passes_through_its_points():
    curve = Centreline(BENT)
    assert np.allclose(curve.evaluate(curve.knots), BENT, rtol=0, atol=1e-12)


def test_two_points_give_the_straight_line():
    curve = Centreline([(1.0, 2.0), (4.0, 6.0)])
    assert curve.length == pytest.approx(5.0, rel=1e-14)
    assert np.allclose(curve.evaluate(2.5), (2.5, 4.0))
    assert np.allclose(curve.tangent(1.0), (0.6, 0.8))
    assert np.allclose(curve.normal(1.0), (-0.8, 0.6))
    assert np.allclose(curve.curvature(np.array([0.0, 2.0])), 0.0)


def test_three_points_give_a_parabola_with_its_length_and_curvature():
    # symmetric about x = 1, so that c(s) = (x, 1 − (x − 1)²) with x linear in s
    curve = Centreline([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    s = np.linspace(0.0, curve.end, 17)
    x, y = curve.evaluate(s).T
    assert np.allclose(y, 1.0 - (x - 1.0) ** 2)
    assert np.allclose(curve.curvature(s), -2.0 / (1.0 + 4.0 * (x - 1.0) ** 2) ** 1.5)
    assert curve.length == pytest.approx(np.sqrt(5.0) + 0.5 * np.arcsinh(2.0), rel=1e-12)


def test_curvature_turns_the_tangent():
    curve = Centreline(BENT)
    s, h = 40.0, 1e-4
    speed = np.linalg.norm(curve.evaluate(s + h) - curve.evaluate(s - h)) / (2.0 * h)
    turn = (curve.tangent(s + h) - curve.tangent(s - h)) / (2.0 * h) / speed
    assert np.allclose(turn, curve.curvature(s) * curve.normal(s), atol=1e-7)


@pytest.mark.parametrize("s", [0.0, 11.0, 60.0, 1.0])
def test_the_closest_point_is_the_foot_of_the_normal(s):
    curve = Centreline(BENT)
    assert curve.closest(curve.evaluate(s) + 2.0 * curve.normal(s)) == pytest.approx(s, abs=1e-9)


def test_the_closest_point_beyond_an_end_is_the_end():
    curve = Centreline(BENT)
    assert curve.closest((-5.0, -5.0)) == 0.0
    assert curve.closest((90.0, 50.0)) == curve.end


def test_coinciding_points_are_refused_with_their_place():
    with pytest.raises(DescriptionError, match=r"points 1 and 2 coincide at \(3, 4\)"):
        Centreline([(0.0, 0.0), (3.0, 4.0), (3.0, 4.0)])
