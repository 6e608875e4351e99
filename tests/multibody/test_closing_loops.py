"""A loop that cannot close is named, with the fraction of the motion reached."""

import re

import numpy as np
import pytest

from fenicsmech.errors import AssemblyError
from fenicsmech.mechanism import Mechanism

from ..oracles.fourbar import FourBar
from .machine import Machine
from .planar_machines import four_bar, slider_crank, slider_position

# The crank is too long to turn: it stops where coupler and rocker are in line, stretched or folded (cosine law).
STOPPED = FourBar((0.0, 0.0), (30.0, 0.0), crank=25.0, coupler=12.0, rocker=20.0)
LAST, FIRST = (np.arccos((25.0**2 + 30.0**2 - reach**2) / (2.0 * 25.0 * 30.0)) for reach in (20.0 + 12.0, 20.0 - 12.0))
START = 0.9
EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])


def fraction(error: AssemblyError) -> float:
    return float(re.search(r"the motors get (\d+\.\d)% of the way", error.problem)[1]) / 100.0


@EVERY_DIMENSION
@pytest.mark.parametrize("turn", [2.0 * np.pi, LAST - START + 1e-3, -np.pi])
def test_loop_is_named_with_the_fraction_of_the_motion_reached(turn, dim):
    machine = four_bar(STOPPED, START)
    linkage = machine.linkage(dim)
    with pytest.raises(AssemblyError) as caught:
        machine.drive(linkage, turn)
    error = caught.value
    assert error.part == "configuration 'driven'"
    assert re.fullmatch(r"the loop through '\w+' \(.*\) does not close: the motors get .*% of the way", error.problem)
    for link in ("ground", "crank", "coupler", "rocker"):
        assert link in error.problem
    assert error.remedy == "Check motor positions and link lengths"
    reach = (LAST if turn > 0.0 else FIRST) - START
    assert fraction(error) == pytest.approx(reach / turn, abs=2e-3)


def test_a_fraction_just_below_one_is_not_printed_as_one():
    machine = slider_crank(10.0, 30.0, 1.0, driven="slider")
    linkage = machine.linkage(2)
    with pytest.raises(AssemblyError, match=r"get 99\.9% of the way"):
        machine.drive(linkage, 40.0001 - slider_position(10.0, 30.0, 1.0))


@EVERY_DIMENSION
def test_only_the_loop_that_fails_is_named(dim):
    machine = four_bar(STOPPED, START)
    m, ground = machine.mechanism, machine.mechanism.links[0]
    arm, hand = m.rigid("arm"), m.rigid("hand")
    m.revolute(ground, arm, at=(-10.0, 0.0))
    m.revolute(arm, hand, at=(-20.0, 0.0))
    linkage = machine.linkage(dim)
    with pytest.raises(AssemblyError) as caught:
        machine.drive(linkage, 2.0)
    assert not re.search("arm|hand", str(caught.value))


@EVERY_DIMENSION
def test_motor_between_fixed_links_cannot_move(dim):
    m = Mechanism("rigid")
    joint = m.revolute(m.rigid("base", fixed=True), m.rigid("wall", fixed=True), at=(0.0, 0.0), name="pin")
    machine = Machine(m, m.motor(joint))
    with pytest.raises(AssemblyError, match=re.escape("'pin' (base – wall) does not close: the motors get 0.0%")):
        machine.drive(machine.linkage(dim), 0.5)


@EVERY_DIMENSION
def test_contradictory_motors_are_refused(dim):
    machine = four_bar(STOPPED, START)
    axle = next(joint for joint in machine.mechanism.joints if joint.name == "axle")
    second = machine.mechanism.motor(axle)
    linkage = machine.linkage(dim)
    with pytest.raises(AssemblyError, match="does not close"):
        Machine(machine.mechanism, second).drive(linkage, 0.3)  # the first stays where it was drawn
