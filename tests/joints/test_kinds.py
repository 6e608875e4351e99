"""The attributes of each joint kind agree with its equations."""

import pytest

from fenicsmech.joints import CYLINDRICAL, PLANAR_JOINT, PRISMATIC, REVOLUTE, SPHERICAL, UNIVERSAL, WELD, constraint

KINDS = (REVOLUTE, PRISMATIC, CYLINDRICAL, SPHERICAL, UNIVERSAL, PLANAR_JOINT, WELD)


def test_kinds_have_names_of_their_own():
    assert len({kind.name for kind in KINDS}) == len(KINDS)


@pytest.mark.parametrize(
    ("flag", "kinds"),
    [
        ("planar", {REVOLUTE, PRISMATIC, PLANAR_JOINT, WELD}),
        ("sliding", {PRISMATIC}),
        ("motorised", {REVOLUTE, PRISMATIC}),
    ],
)
def test_flags_are_those_of_the_table(flag, kinds):
    assert {kind for kind in KINDS if getattr(kind, flag)} == kinds


@pytest.mark.parametrize("kind", [CYLINDRICAL, SPHERICAL, UNIVERSAL], ids=lambda kind: kind.name)
def test_planar_equations_of_a_spatial_joint_raise(kind):
    with pytest.raises(NotImplementedError, match=f"a {kind.name} joint has no planar form"):
        constraint(kind, 2, False)


@pytest.mark.parametrize(
    ("kind", "dim"),
    [(kind, 3) for kind in KINDS if not kind.motorised] + [(PLANAR_JOINT, 2), (WELD, 2)],
    ids=lambda value: getattr(value, "name", f"{value}d"),
)
def test_joint_without_a_free_coordinate_to_drive_takes_no_motor(kind, dim):
    with pytest.raises(NotImplementedError, match=f"a {kind.name} joint takes no motor"):
        constraint(kind, dim, True)


def test_equations_are_compiled_once():
    assert constraint(REVOLUTE, 2, True) is constraint(REVOLUTE, 2, True)
