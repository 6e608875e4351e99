"""Bodies of a description: one per rigid link, one per interface of a flexible link."""

import numpy as np
import pytest

from fenicsmech.joints import PRISMATIC, REVOLUTE
from fenicsmech.mechanism import ONYX, Disc, Mechanism, Rectangle
from fenicsmech.multibody import build_linkage

from .flexible_machines import bent_strip, finger, flexible_four_bar, links_by_name
from .planar_machines import klann

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])


@EVERY_DIMENSION
def test_truss_finger_has_four_rigid_bodies_and_two_interfaces(dim):
    machine = finger()
    linkage = machine.linkage(dim)
    assert [body.name for body in linkage.bodies[:4]] == ["base", "left", "right", "tip"]
    assert [body.region is not None for body in linkage.bodies] == [False] * 4 + [True] * 2
    assert [body.fixed for body in linkage.bodies] == [True] + [False] * 5
    diagonal = links_by_name(machine)["diagonal"]
    assert linkage.interfaces == {diagonal: (4, 5)}
    assert [linkage.bodies[k].region for k in (4, 5)] == [Disc(3.0)] * 2
    assert linkage.bodies[5].centre == (40.0, 60.0, 0.0)[:dim]


@EVERY_DIMENSION
def test_unknowns_are_those_of_the_bodies_that_are_not_fixed(dim):
    linkage = finger().linkage(dim)
    assert linkage.joints.size == linkage.rigid.size == 5 * {2: 3, 3: 7}[dim]
    assert sorted(linkage.joints.columns) == [1, 2, 3, 4, 5]


@EVERY_DIMENSION
def test_joints_at_one_place_of_a_flexible_link_have_one_interface(dim):
    m = Mechanism("shared pin")
    base, a, b = m.rigid("base", fixed=True), m.rigid("a"), m.rigid("b")
    link = m.flexible("link", bent_strip((0.0, 0.0), (30.0, 0.0)), ONYX)
    m.revolute(base, link, at=(0.0, 0.0), interface_radius=2.0)
    m.revolute(link, a, at=(30.0, 0.0), interface_radius=2.0)
    m.revolute(link, b, at=(30.0, 0.0, 0.0), interface_radius=2.0)  # the same place, its z written out
    linkage = build_linkage(m, dim)
    first, second = linkage.interfaces[link]
    assert [c.a for c in linkage.joints.connections[1:]] == [second, second]
    assert linkage.joints.connections[0].b == first


def test_welds_of_flexible_links_are_in_the_rigid_system_only():
    linkage = flexible_four_bar(0.7).linkage(2)
    assert len(linkage.rigid.connections) == len(linkage.joints.connections) + len(linkage.interfaces)
    assert linkage.rigid.rows == linkage.joints.rows + 3 * len(linkage.interfaces)


def test_body_of_a_link_is_itself_or_its_first_interface():
    machine = finger()
    linkage, links = machine.linkage(2), links_by_name(machine)
    assert linkage.body_of(links["tip"]) == 3
    assert linkage.body_of(links["diagonal"]) == 4


def test_length_is_the_diagonal_of_the_box_around_joints_forces_and_outputs():
    m = Mechanism("lever")
    base, lever = m.rigid("base", fixed=True), m.rigid("lever")
    m.revolute(base, lever, at=(5.0, 5.0))
    assert build_linkage(m, 2).length == 1.0  # nothing to measure
    m.force(on=lever, at=(8.0, 5.0), direction=(0.0, 1.0))
    assert build_linkage(m, 2).length == 3.0
    m.output(on=lever, at=(8.0, 9.0), direction=(0.0, 1.0))
    assert build_linkage(m, 2).length == 5.0


def test_rigid_centre_is_the_mean_of_its_joints():
    linkage = klann().linkage(2)
    crank = next(body for body in linkage.bodies if body.name == "crank")
    assert crank.centre == pytest.approx((0.5 * (17.607 + 14.631), 11.807))


@EVERY_DIMENSION
@pytest.mark.parametrize("axis", [(1.0, 0.0), (0.0, -2.0), (3.0, 4.0)])
def test_slider_axis_is_the_one_given(axis, dim):
    m = Mechanism("slider")
    m.prismatic(m.rigid("base", fixed=True), m.rigid("block"), at=(0.0, 0.0), axis=axis)
    (connection,) = build_linkage(m, dim).joints.connections
    assert connection.kind is PRISMATIC
    triad = np.array(connection.triad)
    assert triad[0 if dim == 2 else 2] == pytest.approx([*(np.array(axis) / np.hypot(*axis)), 0.0][:dim])
    assert triad @ triad.T == pytest.approx(np.eye(dim), abs=1e-15)
    assert np.linalg.det(triad) == pytest.approx(1.0)


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (1, 1, 1), (1e-9, 0, 1), (-3, 2, 0.1)])
def test_triads_are_right_handed_with_the_axis_last(axis):
    m = Mechanism("hinge")
    m.revolute(m.rigid("base", fixed=True), m.rigid("lever"), at=(0.0, 0.0), axis=axis)
    (connection,) = build_linkage(m, 3).joints.connections
    assert connection.kind is REVOLUTE
    triad = np.array(connection.triad)
    assert triad @ triad.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(triad) == pytest.approx(1.0)
    assert triad[2] == pytest.approx(np.array(axis) / np.linalg.norm(axis))


def test_interface_takes_region_and_axis_of_its_joint():
    m = Mechanism("clamp")
    link = m.flexible("link", bent_strip((0.0, 0.0), (30.0, 0.0)), ONYX)
    m.weld(m.rigid("base", fixed=True), link, at=(0.0, 0.0), region=Rectangle(4.0, 2.0, 0.1))
    (body,) = (body for body in build_linkage(m, 3).bodies if body.region is not None)
    assert (body.region, body.axis) == (Rectangle(4.0, 2.0, 0.1), (0.0, 0.0, 1.0))
