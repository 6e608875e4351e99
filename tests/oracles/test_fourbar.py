"""Closed-form four-bar linkages against classical ones."""

import numpy as np
import pytest

from .fourbar import LEFT, RIGHT, FourBar, circle_intersection

TURN = np.linspace(0.0, 2.0 * np.pi, 721)


def test_circles_meet_on_either_side_of_the_line_of_centres():
    left = circle_intersection([0.0, 0.0], 5.0, [6.0, 0.0], 5.0, side=LEFT)
    right = circle_intersection([0.0, 0.0], 5.0, [6.0, 0.0], 5.0, side=RIGHT)
    assert left == pytest.approx([3.0, 4.0])
    assert right == pytest.approx([3.0, -4.0])


def test_circles_apart_are_refused():
    with pytest.raises(ValueError, match="cannot close"):
        circle_intersection([0.0, 0.0], 1.0, [6.0, 0.0], 2.0, side=LEFT)


def test_parallelogram_carries_its_coupler_without_turning_it():
    linkage = FourBar((0.0, 0.0), (4.0, 0.0), crank=2.0, coupler=4.0, rocker=2.0)
    pin, joint = linkage.positions(np.linspace(0.1, 3.0, 50))
    assert joint - pin == pytest.approx(np.tile([4.0, 0.0], (50, 1)), abs=1e-12)


@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_crank_rocker_obeys_freudenstein(side):
    # d/a cos φ − d/c cos θ + (a² − b² + c² + d²) / 2ac = cos(θ − φ), ground d along x
    a, b, c, d = 1.0, 3.0, 2.5, 3.2
    linkage = FourBar((0.0, 0.0), (d, 0.0), crank=a, coupler=b, rocker=c, side=side)
    _, joint = linkage.positions(TURN)
    rocker = np.arctan2(joint[:, 1], joint[:, 0] - d)
    constant = (a**2 - b**2 + c**2 + d**2) / (2.0 * a * c)
    assert d / a * np.cos(rocker) - d / c * np.cos(TURN) + constant == pytest.approx(np.cos(TURN - rocker), abs=1e-12)


def test_crank_rocker_keeps_its_branch_over_the_turn():
    linkage = FourBar((0.0, 0.0), (3.2, 0.0), crank=1.0, coupler=3.0, rocker=2.5)
    _, joint = linkage.positions(TURN)
    assert np.abs(np.diff(joint, axis=0)).max() < 0.02
    assert joint[0] == pytest.approx(joint[-1], abs=1e-12)


def test_chebyshev_lambda_linkage_draws_a_straight_line():
    # crank 1, ground 2, coupler and rocker 2.5, the coupler extended by its own length: height within 0.3 % of 4
    linkage = FourBar((0.0, 0.0), (2.0, 0.0), crank=1.0, coupler=2.5, rocker=2.5)
    point = linkage.coupler_point(np.radians(np.linspace(95.0, 265.0, 171)), along=5.0, across=0.0)
    assert point[:, 1] == pytest.approx(4.0, abs=0.012)
    assert np.ptp(point[:, 0]) > 3.5
