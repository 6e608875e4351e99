"""Initial splines follow the centrelines they are given."""

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import fit_spline
from fenicsmech.mechanism import Centreline

from ..simulation.demo_scenes import describe
from .shapes import CENTRELINES, INTERIOR, JOINTS


def demo_links(name: str):
    """Centreline, joints and thickness of every flexible link of a demo."""
    mechanism = describe(name)[0].mechanism
    for link in mechanism.flexible_links:
        joints = [joint.at[:2] for joint in mechanism.joints if link in (joint.a, joint.b)]
        yield Centreline(link.shape.centreline), joints, link.shape.thickness


@pytest.mark.parametrize("name", ["claw", "truss", "klann"])
def test_splines_of_the_demos_deviate_by_less_than_two_percent_of_the_thickness(name):
    for centreline, joints, thickness in demo_links(name):
        interior = (2,) if len(joints) == 2 else (0, 1)
        assert fit_spline(centreline, joints, interior).deviation < 0.02 * thickness


@pytest.mark.parametrize("link", [0, 1])
def test_reported_deviation_is_the_largest_distance_to_the_centreline(link):
    centreline = Centreline(CENTRELINES[link])
    fit = fit_spline(centreline, JOINTS[link], INTERIOR[link])
    t = np.linspace(0.0, fit.spline.segments, 200)
    points = fit.spline.evaluate(fit.spline.initial, t)[:, :2]
    distances = [np.linalg.norm(centreline.evaluate(centreline.closest(point)) - point) for point in points]
    assert max(distances) == pytest.approx(fit.deviation, rel=0.02, abs=1e-6)


def test_joints_are_put_in_order_and_interior_points_at_equal_arc_lengths():
    centreline = Centreline(CENTRELINES[0])
    fit = fit_spline(centreline, JOINTS[0], (2,))
    assert fit.sites == (1, 0)
    assert fit.spline.controls[[0, -1], 0, :2] == pytest.approx(np.array([CENTRELINES[0][0], CENTRELINES[0][2]]))
    s = np.linspace(0.0, centreline.end, 20001)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centreline.evaluate(s), axis=0), axis=1))])
    thirds = centreline.evaluate(np.interp(arc[-1] * np.array([1, 2]) / 3, arc, s))
    assert fit.spline.controls[1:3, 0, :2] == pytest.approx(thirds, abs=1e-5)


def test_thickness_starts_at_one_without_slope():
    spline = fit_spline(Centreline(CENTRELINES[1]), JOINTS[1], INTERIOR[1]).spline
    t = np.linspace(0.0, spline.segments, 50)
    assert spline.evaluate(spline.initial, t)[:, 2] == pytest.approx(1.0)
    assert spline.derivative(spline.initial, t)[:, 2] == pytest.approx(0.0)


def test_fit_does_not_depend_on_the_unit_of_length():
    big = fit_spline(Centreline(CENTRELINES[1]), JOINTS[1], INTERIOR[1])
    small = fit_spline(Centreline(np.array(CENTRELINES[1]) / 1000), np.array(JOINTS[1]) / 1000, INTERIOR[1])
    assert 1000 * small.spline.controls[..., :2] == pytest.approx(big.spline.controls[..., :2], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("joints", "interior", "complaint"),
    [
        ([(0, 0)], (), "1 joint"),
        ([(0, 0), (40, 0)], (1, 1), "do not match 2 joints"),
        ([(0, 0), (40, 0)], (-1,), "do not match"),
        ([(0, 0), (0, 0), (40, 0)], (1, 1), "one place"),
    ],
)
def test_joints_and_control_points_that_make_no_sense_are_refused(joints, interior, complaint):
    with pytest.raises(fm.DescriptionError, match=complaint):
        fit_spline(Centreline(CENTRELINES[0]), joints, interior)
