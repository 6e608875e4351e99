"""Four-bars and slider-cranks go where the closed forms put them, on the branch they were drawn on."""

import numpy as np
import pytest

from fenicsmech.mechanism import DRAWN
from fenicsmech.multibody import assemble

from ..oracles.fourbar import RIGHT, FourBar
from .planar_machines import CRANK_ROCKER, DRAWN_ANGLE, four_bar, slider_crank, slider_position

TURN = np.linspace(0.0, 2.0 * np.pi, 25)
CROSSED = FourBar((0.0, 0.0), (32.0, 4.0), crank=10.0, coupler=30.0, rocker=25.0, side=RIGHT)
DRAG_LINK = FourBar((0.0, 0.0), (10.0, 0.0), crank=25.0, coupler=22.0, rocker=28.0)


@pytest.mark.thorough
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("oracle", [CRANK_ROCKER, CROSSED, DRAG_LINK], ids=["open", "crossed", "drag link"])
def test_pivots_follow_the_closed_form_over_a_turn(oracle, dim):
    machine = four_bar(oracle, DRAWN_ANGLE)
    linkage = machine.linkage(dim)
    for angle in TURN:
        assembly = machine.drive(linkage, angle)
        assert assembly.fraction == 1.0
        found = machine.positions(linkage, assembly.poses)
        pin, joint = oracle.positions(DRAWN_ANGLE + angle)
        assert found["pin"] == pytest.approx([*pin, 0.0][:dim], abs=1e-9 * linkage.length)
        assert found["joint"] == pytest.approx([*joint, 0.0][:dim], abs=1e-9 * linkage.length)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("angle", [-8.0, -1.0, 1.0, np.pi - 1.0, 8.0])
def test_slider_follows_the_closed_form_of_its_crank(angle, dim):
    machine = slider_crank(10.0, 30.0, 1.0, driven="crank")
    linkage = machine.linkage(dim)
    found = machine.positions(linkage, machine.drive(linkage, angle).poses)["slider"]
    assert found == pytest.approx([slider_position(10.0, 30.0, 1.0 + angle), 0.0, 0.0][:dim], abs=1e-9 * linkage.length)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("crank_angle", [0.3, 2.0, 3.0])
def test_driven_slider_turns_its_crank_by_the_closed_form(crank_angle, dim):
    # the motor's position is a travel, along the axis as the user gave it
    machine = slider_crank(10.0, 30.0, 1.0, driven="slider")
    linkage = machine.linkage(dim)
    travel = slider_position(10.0, 30.0, crank_angle) - slider_position(10.0, 30.0, 1.0)
    found = machine.positions(linkage, machine.drive(linkage, travel).poses)["pin"]
    expected = [10.0 * np.cos(crank_angle), 10.0 * np.sin(crank_angle), 0.0]
    assert found == pytest.approx(expected[:dim], abs=1e-9 * linkage.length)


@pytest.mark.parametrize("dim", [2, 3])
def test_nothing_moves_while_the_motor_stays(dim):
    machine = four_bar(CRANK_ROCKER, DRAWN_ANGLE)
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, 0.0)
    assert assembly.fraction == 1.0
    assert np.array_equal(assembly.poses, linkage.joints.drawn)


@pytest.mark.parametrize("dim", [2, 3])
def test_mechanism_without_motor_stays_as_drawn(dim):
    machine = four_bar(CRANK_ROCKER, DRAWN_ANGLE, driven=None)
    linkage = machine.linkage(dim)
    assert np.array_equal(assemble(linkage, DRAWN).poses, linkage.joints.drawn)
