"""Initial splines follow the centrelines they are given."""

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import ControlLayout, fit_spline, lay_out
from fenicsmech.mechanism import Centreline

from ..simulation.demo_scenes import describe
from .shapes import CENTRELINES, JOINTS, RADIUS


def layout(link: int, segments: int = 3):
    """The control points of one of the links."""
    return lay_out(Centreline(CENTRELINES[link]), JOINTS[link], [RADIUS] * len(JOINTS[link]), segments)


def demo_links(name: str):
    """Centreline, joints and thickness of every flexible link of a demo."""
    mechanism = describe(name)[0].mechanism
    for link in mechanism.flexible_links:
        joints = [joint.at[:2] for joint in mechanism.joints if link in (joint.a, joint.b)]
        yield Centreline(link.shape.centreline), joints, link.shape.thickness


@pytest.mark.parametrize("name", ["claw", "truss", "klann"])
def test_splines_of_the_demos_deviate_by_less_than_two_percent_of_the_thickness(name):
    for centreline, joints, thickness in demo_links(name):
        control = lay_out(centreline, joints, [thickness] * len(joints), 3)
        assert fit_spline(centreline, joints, control).deviation < 0.02 * thickness


@pytest.mark.parametrize("link", [0, 1])
def test_reported_deviation_is_the_largest_distance_to_the_centreline(link):
    centreline = Centreline(CENTRELINES[link])
    fit = fit_spline(centreline, JOINTS[link], layout(link))
    t = np.linspace(0.0, fit.spline.segments, 200)
    points = fit.spline.evaluate(fit.spline.initial, t)[:, :2]
    distances = [np.linalg.norm(centreline.evaluate(centreline.closest(point)) - point) for point in points]
    assert max(distances) == pytest.approx(fit.deviation, rel=0.02, abs=1e-6)


def test_joints_are_put_in_order_and_interior_points_at_equal_arc_lengths():
    centreline = Centreline(CENTRELINES[0])
    fit = fit_spline(centreline, JOINTS[0], layout(0))
    assert fit.sites == (1, 0)
    assert fit.spline.controls[[0, -1], 0, :2] == pytest.approx(np.array([CENTRELINES[0][0], CENTRELINES[0][2]]))
    s = np.linspace(0.0, centreline.end, 20001)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centreline.evaluate(s), axis=0), axis=1))])
    thirds = centreline.evaluate(np.interp(arc[-1] * np.array([1, 2]) / 3, arc, s))
    assert fit.spline.controls[1:3, 0, :2] == pytest.approx(thirds, abs=1e-5)


def test_thickness_starts_at_one_without_slope():
    spline = fit_spline(Centreline(CENTRELINES[1]), JOINTS[1], layout(1)).spline
    t = np.linspace(0.0, spline.segments, 50)
    assert spline.evaluate(spline.initial, t)[:, 2] == pytest.approx(1.0)
    assert spline.derivative(spline.initial, t)[:, 2] == pytest.approx(0.0)


def test_fit_does_not_depend_on_the_unit_of_length():
    big = fit_spline(Centreline(CENTRELINES[1]), JOINTS[1], layout(1))
    small = fit_spline(Centreline(np.array(CENTRELINES[1]) / 1000), np.array(JOINTS[1]) / 1000, layout(1))
    assert 1000 * small.spline.controls[..., :2] == pytest.approx(big.spline.controls[..., :2], rel=1e-9, abs=1e-9)


def test_two_joints_at_one_place_are_refused():
    with pytest.raises(fm.DescriptionError, match="the same place"):
        fit_spline(Centreline(CENTRELINES[0]), [(0, 0), (0, 0), (40, 0)], ControlLayout(False, False, (1, 1)))


@pytest.mark.parametrize(
    ("joints", "segments", "expected"),
    [
        ([(0, 0), (40, 0)], 3, ControlLayout(False, False, (2,))),
        ([(0, 0)], 2, ControlLayout(False, True, (1,))),
        ([(40, 0)], 2, ControlLayout(True, False, (1,))),
        ([(24, 8.64)], 3, ControlLayout(True, True, (1, 0))),
        ([(30, 6.75), (0, 0)], 3, ControlLayout(False, True, (1, 0))),
        ([(36, 3.24), (0, 0)], 3, ControlLayout(False, False, (2,))),  # a stub beyond a joint is not a free end
    ],
)
def test_control_points_go_to_joints_and_free_ends_and_where_these_are_farthest_apart(joints, segments, expected):
    assert lay_out(Centreline(CENTRELINES[0]), joints, [RADIUS] * len(joints), segments) == expected


@pytest.mark.parametrize(
    ("joints", "reach", "segments", "complaint"),
    [
        ([(0, 0), (20, 9), (40, 0)], 2.5, 1, "1 segment.* for 2 gaps between joints"),
        ([(20, 9)], 2.5, 1, "1 segment.* for 2 gaps between joints and free ends"),
        ([(20, 9)], 25.0, 1, "1 joint and no free end"),
    ],
)
def test_too_few_segments_or_nothing_to_change_are_refused(joints, reach, segments, complaint):
    with pytest.raises(fm.DescriptionError, match=complaint):
        lay_out(Centreline(CENTRELINES[0]), joints, [reach] * len(joints), segments)


def test_a_spline_runs_on_to_a_free_end_which_keeps_its_place_unless_it_may_move():
    centreline = Centreline(CENTRELINES[0])
    control = lay_out(centreline, [(0, 0)], [RADIUS], 2)
    held = fit_spline(centreline, [(0, 0)], control)
    free = fit_spline(centreline, [(0, 0)], control, ends_move=True)
    assert held.sites == (0,)
    assert held.deviation < 0.01
    assert held.spline.evaluate(held.spline.initial, np.array([2.0]))[0] == pytest.approx([40.0, 0.0, 1.0])
    assert (held.spline.size, free.spline.size) == (3 + 6 + 4, 3 + 6 + 6)
    wild = held.spline.initial + np.random.default_rng(0).standard_normal(held.spline.size)
    assert held.spline.evaluate(wild, np.array([2.0]))[0, :2] == pytest.approx([40.0, 0.0])
