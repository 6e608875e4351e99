"""Handles at joints turn about z only where every joint of the interface lets the link turn so."""

from __future__ import annotations

import pytest

import fenicsmech as fm
from fenicsmech.design import shape_request
from fenicsmech.joints import CYLINDRICAL, PLANAR_JOINT, PRISMATIC, REVOLUTE, SPHERICAL, UNIVERSAL, WELD
from fenicsmech.multibody import build_linkage

X, Y, Z, TILTED = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)


def turns(*joints, dim: int = 3, link_first: bool = False, driven: bool = False) -> bool:
    """Whether a link may turn at an interface with these ``joints`` (kind, axis), each to a body of its own."""
    mechanism = fm.Mechanism("bench")
    base = mechanism.rigid("base", fixed=True)
    bar = mechanism.flexible("bar", fm.strip([(0, 0), (20, 3), (40, 0)], thickness=3.0, depth=6.0), fm.ONYX)
    for number, (kind, axis) in enumerate(joints):
        other = mechanism.rigid(f"other {number}")
        ends = (bar, other) if link_first else (other, bar)
        joint = mechanism.join(kind, *ends, at=(0, 0), axis=axis, region=fm.Disc(3.0))
        if driven:
            mechanism.motor(joint)
    mechanism.weld(base, bar, at=(40, 0), interface_radius=3.0)
    request = shape_request(fm.SplineDesign(bar, 2), mechanism, build_linkage(mechanism, dim))
    assert not request.turns[1]  # at the weld
    return request.turns[0]


@pytest.mark.parametrize("link_first", [True, False])
@pytest.mark.parametrize(
    ("kind", "axis", "allowed"),
    [
        (REVOLUTE, Z, True),
        (REVOLUTE, X, False),
        (REVOLUTE, TILTED, False),
        (CYLINDRICAL, Z, True),
        (CYLINDRICAL, Y, False),
        (PLANAR_JOINT, Z, True),
        (PLANAR_JOINT, X, False),
        (SPHERICAL, Z, True),
        (SPHERICAL, TILTED, True),
        (PRISMATIC, X, False),
        (PRISMATIC, Z, False),
        (UNIVERSAL, Z, False),
        (UNIVERSAL, X, True),
        (UNIVERSAL, TILTED, False),
        (WELD, Z, False),
    ],
)
def test_each_joint_allows_the_turns_of_its_freedoms(kind, axis, allowed, link_first):
    assert turns((kind, axis), link_first=link_first) == allowed


@pytest.mark.parametrize(
    ("kind", "axis", "allowed"), [(REVOLUTE, Z, True), (PLANAR_JOINT, Z, True), (PRISMATIC, X, False), (WELD, Z, False)]
)
def test_planar_models_allow_the_same(kind, axis, allowed):
    assert turns((kind, axis), dim=2) == allowed


def test_all_joints_of_an_interface_must_allow_a_turn():
    assert turns((REVOLUTE, Z), (SPHERICAL, X))
    assert not turns((REVOLUTE, Z), (PRISMATIC, X))
    assert not turns((REVOLUTE, Z), (REVOLUTE, X))


def test_a_motor_drives_a_freedom_that_the_joint_keeps():
    assert turns((REVOLUTE, Z), driven=True)


def test_a_kind_from_outside_needs_its_equations_only():
    class Screw(fm.JointKind):
        """A nut that climbs as it turns: it cannot turn in its place."""

        name = "screw"
        pin_along_axis = True

        def equations(self, a, b):
            apart = b.origin - a.origin
            climb = apart.dot(a.e3) - 2.0 * a.angle_to(b)
            return [apart.dot(a.e1), apart.dot(a.e2), a.e1.dot(b.e3), a.e2.dot(b.e3), climb]

    assert not turns((Screw(), Z))
