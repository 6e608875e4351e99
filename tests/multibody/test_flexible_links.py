"""Flexible links are carried along undeformed; where the motors would strain them, the assembly stops short."""

import numpy as np
import pytest

from fenicsmech.errors import AssemblyError
from fenicsmech.mechanism import ONYX, Mechanism, Rectangle

from ..joints.poses import carry
from .flexible_machines import bent_strip, finger, flexible_four_bar, links_by_name
from .machine import Machine, point_of
from .planar_machines import CRANK_ROCKER, DRAWN_ANGLE

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])


@EVERY_DIMENSION
@pytest.mark.parametrize("angle", [-2.0, 1.0, 3.0, 2.0 * np.pi])
def test_flexible_links_follow_as_rigid_ones(angle, dim):
    machine = flexible_four_bar(DRAWN_ANGLE)
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, angle)
    assert assembly.fraction == 1.0
    links = links_by_name(machine)
    drawn, moved = CRANK_ROCKER.positions(DRAWN_ANGLE), CRANK_ROCKER.positions(DRAWN_ANGLE + angle)
    for name, k in (("coupler", 0), ("coupler", 1), ("rocker", 1)):
        found = point_of(linkage, assembly.poses, links[name], drawn[k])
        assert found[:2] == pytest.approx(moved[k], abs=1e-9 * linkage.length)


@EVERY_DIMENSION
def test_both_ends_of_a_carried_link_move_as_one(dim):
    machine = flexible_four_bar(DRAWN_ANGLE)
    linkage = machine.linkage(dim)
    poses = machine.drive(linkage, 2.0).poses
    space = linkage.joints.space
    for first, second in linkage.interfaces.values():
        lever = np.subtract(linkage.bodies[second].centre, linkage.bodies[first].centre)
        carried = carry(space, poses[first], space.identity, lever)
        assert poses[second] == pytest.approx(carried, abs=1e-12 * linkage.length)


@EVERY_DIMENSION
@pytest.mark.parametrize("position", [0.3, -1.0, 1e-3])
def test_motor_that_strains_a_link_stops_the_assembly_without_error(position, dim):
    machine = finger()
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, position)
    assert assembly.fraction < 1e-3
    assert assembly.poses == pytest.approx(linkage.joints.drawn, abs=1e-3)
    residual = linkage.rigid.value(assembly.poses, linkage.rigid.motor_values(lambda m: assembly.fraction * position))
    assert np.max(np.abs(linkage.rigid.row_scale * residual)) <= 1e-13


@EVERY_DIMENSION
def test_motor_stops_where_slack_ends(dim):
    # the lever is free for as long as the rod may swing: until lever and rod are in line
    m = Mechanism("lever on a flexible rod")
    base, lever, swing = m.rigid("base", fixed=True), m.rigid("lever"), m.rigid("swing")
    rod = m.flexible("rod", bent_strip((10.0, 0.0), (22.0, 0.0)), ONYX)
    shaft = m.revolute(base, lever, at=(0.0, 0.0))
    m.revolute(lever, rod, at=(10.0, 0.0), interface_radius=1.0)
    m.revolute(rod, swing, at=(22.0, 0.0), interface_radius=1.0)
    m.revolute(swing, base, at=(22.0, 10.0))
    machine = Machine(m, m.motor(shaft))
    linkage = machine.linkage(dim)
    assembly = machine.drive(linkage, 2.0)
    # pin at 12 + 10 = 22 from (22, 10): (22 − 10 cos φ)² + (10 − 10 sin φ)² = 22²
    angles = np.linspace(0.0, 2.0, 200001)
    stop = angles[(22.0 - 10.0 * np.cos(angles)) ** 2 + (10.0 - 10.0 * np.sin(angles)) ** 2 <= 22.0**2].max()
    assert stop < 2.0
    assert assembly.fraction == pytest.approx(stop / 2.0, abs=1e-3)


@EVERY_DIMENSION
def test_loop_of_rigid_links_that_does_not_close_is_an_error_whatever_bends_elsewhere(dim):
    machine = finger()
    m = machine.mechanism
    base = m.links[0]
    wall = m.rigid("wall")
    m.weld(base, wall, at=(0.0, 5.0))
    left = links_by_name(machine)["left"]
    m.weld(left, wall, at=(0.0, 10.0))
    linkage = machine.linkage(dim)
    with pytest.raises(AssemblyError) as caught:
        machine.drive(linkage, 0.5)
    for name in ("base", "left", "wall"):
        assert name in caught.value.problem
    assert "0.0% of the way" in caught.value.problem


@EVERY_DIMENSION
def test_clamped_link_is_carried_by_what_it_is_clamped_to(dim):
    m = Mechanism("spring on an arm")
    base, arm = m.rigid("base", fixed=True), m.rigid("arm")
    spring = m.flexible("spring", bent_strip((10.0, 0.0), (30.0, 0.0)), ONYX)
    shaft = m.revolute(base, arm, at=(0.0, 0.0))
    m.weld(arm, spring, at=(10.0, 0.0), region=Rectangle(4.0, 4.0))
    tip = m.rigid("tip")
    m.revolute(spring, tip, at=(30.0, 0.0), interface_radius=2.0)
    machine = Machine(m, m.motor(shaft))
    linkage = machine.linkage(dim)
    poses = machine.drive(linkage, 1.0).poses
    for body in linkage.interfaces[spring]:
        at = np.array(linkage.bodies[body].centre)
        found = at + linkage.joints.space.displace(poses[body], np.zeros((1, dim)))[0]
        assert found[:2] == pytest.approx(at[0] * np.array([np.cos(1.0), np.sin(1.0)]), abs=1e-12 * linkage.length)
