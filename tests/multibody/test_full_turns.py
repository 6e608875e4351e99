"""Motors turn any number of times, and the mechanism comes back to where it was drawn."""

import numpy as np
import pytest

from ..oracles.fourbar import FourBar
from .planar_machines import CRANK_ROCKER, DRAWN_ANGLE, four_bar, klann
from .spatial_machines import Bennett

DRAG_LINK = FourBar((0.0, 0.0), (10.0, 0.0), crank=25.0, coupler=22.0, rocker=28.0)
BOTH_WAYS = pytest.mark.parametrize("turns", [2, -2], ids=["forwards", "backwards"])


@BOTH_WAYS
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "machine",
    [four_bar(CRANK_ROCKER, DRAWN_ANGLE), four_bar(DRAG_LINK, DRAWN_ANGLE), klann()],
    ids=["crank-rocker", "drag link", "Klann"],
)
def test_two_turns_bring_every_point_back_to_where_it_was_drawn(machine, dim, turns):
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, 2.0 * np.pi * turns)
    assert assembly.fraction == 1.0
    rng = np.random.default_rng(0)
    for pose in assembly.poses:
        offsets = linkage.length * rng.uniform(-1.0, 1.0, (5, dim))
        assert np.max(np.abs(linkage.joints.space.displace(pose, offsets))) <= 1e-12 * linkage.length


@BOTH_WAYS
def test_planar_angles_count_the_turns_of_the_links_that_turn(turns):
    machine = four_bar(DRAG_LINK, DRAWN_ANGLE)  # every link turns fully but for the ground
    linkage = machine.linkage(2)
    angles = machine.drive(linkage, 2.0 * np.pi * turns).poses[:, 2]
    assert angles == pytest.approx([0.0, *[2.0 * np.pi * turns] * 3], abs=1e-12)
    machine = four_bar(CRANK_ROCKER, DRAWN_ANGLE)  # coupler and rocker swing
    linkage = machine.linkage(2)
    angles = machine.drive(linkage, 2.0 * np.pi * turns).poses[:, 2]
    assert angles == pytest.approx([0.0, 2.0 * np.pi * turns, 0.0, 0.0], abs=1e-12)


@BOTH_WAYS
def test_quaternions_return_after_two_turns_and_are_opposite_after_one(turns):
    machine = four_bar(CRANK_ROCKER, DRAWN_ANGLE)
    linkage = machine.linkage(3)
    half, whole = (machine.drive(linkage, np.pi * k).poses[1, 3:] for k in (turns, 2 * turns))
    assert half == pytest.approx([-1.0, 0.0, 0.0, 0.0], abs=1e-12)
    assert whole == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("position", [0.3, 5.0, 4.0 * np.pi, -20.0])
def test_quaternions_stay_on_the_unit_sphere(position):
    machine = klann()
    linkage = machine.linkage(3)
    norms = np.linalg.norm(machine.drive(linkage, position).poses[:, 3:], axis=1)
    assert norms == pytest.approx(np.ones_like(norms), abs=4e-16)


@pytest.mark.parametrize("turn", [0.5, 1.5, -1.5, 3.0, 2.0 * np.pi])
def test_bennett_loop_follows_its_closed_form(turn):
    bennett = Bennett()
    machine = bennett.machine(1.2, driven=True)
    linkage = machine.linkage(3)
    found = machine.positions(linkage, machine.drive(linkage, turn).poses)
    points, _ = bennett.hinges(1.2 + turn)
    for k in (1, 2):
        assert found[f"hinge {k}"] == pytest.approx(points[k], abs=1e-9 * linkage.length)
