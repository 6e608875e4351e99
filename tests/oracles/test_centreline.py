"""Centrelines of the beam oracle: arc length, tangent angle, trimming."""

import numpy as np
import pytest
from scipy.special import ellipe

from . import centreline


def assert_angle_is_the_tangent(line):
    s = np.linspace(0.0, line.length, 37)[1:-1]
    step = 1e-4 * line.length
    ahead, behind = (line.position(s + k * step) for k in (1.0, -1.0))
    far_ahead, far_behind = (line.position(s + k * step) for k in (2.0, -2.0))
    tangent = (8.0 * (ahead - behind) - (far_ahead - far_behind)) / (12.0 * step)
    expected = np.stack([np.cos(line.angle(s)), np.sin(line.angle(s))], axis=-1)
    assert tangent == pytest.approx(expected, abs=1e-8)


def test_arc_ends_where_the_circle_does():
    line = centreline.arc(2.0, -0.5 * np.pi, start=(1.0, 1.0), heading=0.5 * np.pi)
    assert line.length == pytest.approx(np.pi)
    assert line.position(np.array([line.length]))[0] == pytest.approx([3.0, 3.0])
    assert_angle_is_the_tangent(line)


def test_parametric_ellipse_has_its_arc_length():
    a, b = 3.0, 1.0
    line = centreline.from_parametric(
        lambda t: np.stack([a * np.cos(t), b * np.sin(t)], axis=-1),
        lambda t: np.stack([-a * np.sin(t), b * np.cos(t)], axis=-1),
        (0.0, 2.0 * np.pi),
        panels=64,
    )
    assert line.length == pytest.approx(4.0 * a * ellipe(1.0 - b**2 / a**2), rel=1e-12)
    assert line.angle(np.array([line.length]))[0] - line.angle(np.array([0.0]))[0] == pytest.approx(2.0 * np.pi)
    assert_angle_is_the_tangent(line)


def test_spline_runs_through_its_points_by_arc_length():
    points = np.array([(0.0, 0.0), (18.0, 12.0), (40.0, 14.0), (60.0, 4.0), (80.0, 9.0)])
    line = centreline.through(points)
    s = np.array([0.0, *line.breaks, line.length])
    assert line.position(s) == pytest.approx(points, abs=1e-10)
    smooth = centreline.Centreline(line.length, line.position, line.angle)
    assert_angle_is_the_tangent(smooth)


def test_two_points_give_a_straight_line():
    line = centreline.through([(0.0, 0.0), (3.0, 4.0)])
    assert line.length == 5.0
    assert line.position(np.array([2.5]))[0] == pytest.approx([1.5, 2.0])


def test_function_of_arc_length_is_taken_as_it_is():
    def circle(s):
        return np.sin(s), 1.0 - np.cos(s), s

    line = centreline.from_function(circle, 1.0)
    assert line.position(np.array([0.0, 1.0]))[1] == pytest.approx([np.sin(1.0), 1.0 - np.cos(1.0)])
    assert line.angle(np.array([0.25, 0.5])) == pytest.approx([0.25, 0.5])


def test_trimmed_line_is_part_of_the_whole():
    line = centreline.through([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 0.5)])
    part = line.trimmed(0.3, 0.4)
    assert part.length == pytest.approx(line.length - 0.7)
    assert part.position(np.array([0.2])) == pytest.approx(line.position(np.array([0.5])))
    assert part.angle(np.array([0.2])) == pytest.approx(line.angle(np.array([0.5])))
    assert part.breaks == pytest.approx([b - 0.3 for b in line.breaks])
    with pytest.raises(ValueError, match="cannot cut"):
        line.trimmed(2.0, 3.0)
