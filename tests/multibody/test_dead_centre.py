"""Configurations in which the constraints lose rank: dead centres and change points are reached and passed."""

import numpy as np
import pytest

from .machine import freedom_as_drawn
from .planar_machines import CRANK_ROCKER, collinear_parallelogram, four_bar, parallelogram, slider_crank

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])
SIDES = CRANK_ROCKER.crank, CRANK_ROCKER.coupler, CRANK_ROCKER.rocker
GROUND = np.hypot(*CRANK_ROCKER.axle)
TILT = np.arctan2(CRANK_ROCKER.axle[1], CRANK_ROCKER.axle[0])


def dead_centre(reach: float) -> tuple[float, np.ndarray]:
    """Crank–coupler line of length ``reach``: its angle, and where the coupler's far joint is (cosine law)."""
    angle = TILT + np.arccos((reach**2 + GROUND**2 - SIDES[2] ** 2) / (2.0 * reach * GROUND))
    return angle, reach * np.array([np.cos(angle), np.sin(angle)])


def rocker_angle(joint: np.ndarray) -> float:
    return float(np.arctan2(*(joint - CRANK_ROCKER.axle)[::-1]))


@EVERY_DIMENSION
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["stretched", "folded"])
def test_crank_passes_the_dead_centres_of_the_rocker(sign, dim):
    line, joint = dead_centre(SIDES[1] + sign * SIDES[0])
    crank = line if sign > 0.0 else line + np.pi
    machine = four_bar(CRANK_ROCKER, 0.2)
    linkage = machine.linkage(dim)
    found = machine.positions(linkage, machine.drive(linkage, crank - 0.2).poses)["joint"]
    assert found[:2] == pytest.approx(joint, abs=1e-9 * linkage.length)


@EVERY_DIMENSION
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["stretched", "folded"])
def test_rocker_drives_up_to_its_dead_centre(sign, dim):
    # the crank's position goes with the root of the rocker's: half of the digits are all there is
    _, joint = dead_centre(SIDES[1] + sign * SIDES[0])
    start = 2.0
    machine = four_bar(CRANK_ROCKER, start, driven="rocker")
    linkage = machine.linkage(dim)
    travel = rocker_angle(joint) - rocker_angle(CRANK_ROCKER.positions(start)[1])
    assembly = machine.drive(linkage, travel)
    found = machine.positions(linkage, assembly.poses)
    assert assembly.fraction == 1.0
    assert found["joint"][:2] == pytest.approx(joint, abs=1e-9 * linkage.length)
    assert found["pin"][:2] == pytest.approx(sign * joint * SIDES[0] / np.linalg.norm(joint), abs=1e-5 * linkage.length)


@EVERY_DIMENSION
def test_slider_drives_up_to_its_dead_centres(dim):
    machine = slider_crank(10.0, 30.0, 1.0, driven="slider")
    linkage = machine.linkage(dim)
    drawn = machine.pivots["slider"][1][0]
    for end, pin in ((40.0, 10.0), (20.0, -10.0)):
        found = machine.positions(linkage, machine.drive(linkage, end - drawn).poses)
        assert found["slider"][0] == pytest.approx(end, abs=1e-9 * linkage.length)
        assert found["pin"][:2] == pytest.approx([pin, 0.0], abs=1e-5 * linkage.length)


@EVERY_DIMENSION
@pytest.mark.parametrize("turn", [1.0, np.pi, -2.0])
def test_mechanism_drawn_at_a_dead_centre_leaves_it_with_its_crank(turn, dim):
    machine = slider_crank(10.0, 30.0, 0.0, driven="crank")
    linkage = machine.linkage(dim)
    found = machine.positions(linkage, machine.drive(linkage, turn).poses)["pin"]
    assert found[:2] == pytest.approx([10.0 * np.cos(turn), 10.0 * np.sin(turn)], abs=1e-9 * linkage.length)


@EVERY_DIMENSION
def test_dead_centre_as_drawn_counts_one_freedom_that_the_driven_slider_does_not_hold(dim):
    held = freedom_as_drawn(slider_crank(10.0, 30.0, 0.0, driven="slider"), dim)
    assert (held.mobility, held.mobile) == (1, ("crank", "rod"))
    beside = freedom_as_drawn(slider_crank(10.0, 30.0, 1.0, driven="slider"), dim)
    assert (beside.mobility, beside.mobile) == (0, ())
    assert held.redundancy == beside.redundancy + 1


@EVERY_DIMENSION
@pytest.mark.parametrize("turn", [np.pi, -np.pi, 2.0 * np.pi, 4.0])
def test_parallelogram_passes_its_change_points_as_a_parallelogram(turn, dim):
    machine = parallelogram(0.7)
    linkage = machine.linkage(dim)
    found = machine.positions(linkage, machine.drive(linkage, turn).poses)
    apart = found["joint"] - found["pin"]
    assert apart[:2] == pytest.approx([40.0, 0.0], abs=1e-9 * linkage.length)


@EVERY_DIMENSION
@pytest.mark.parametrize("turn", [0.5, -1.0])
def test_parallelogram_drawn_at_its_change_point_moves_with_its_motor(turn, dim):
    machine = collinear_parallelogram(driven=True)
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, turn)
    assert assembly.fraction == 1.0
    crank = linkage.joints.space.rotate(assembly.poses[1], np.eye(dim)[0])
    assert crank[:2] == pytest.approx([np.cos(turn), np.sin(turn)], abs=1e-12)
