"""The builder refuses contradictory parts, with the name of the part and a remedy."""

import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.joints import SPHERICAL
from fenicsmech.laws import NeoHookean
from fenicsmech.mechanism import (
    ONYX,
    Configuration,
    Disc,
    Face,
    Material,
    Mechanism,
    Rectangle,
    RigidLink,
    Scene,
    material,
    outline,
    strip,
)

from .parts import assert_refused, parts

OWN_NAME = "Give each part a name of its own"


def bar():
    return strip([(0.0, 0.0), (9.0, 0.0)], thickness=1.0, depth=1.0)


@pytest.mark.parametrize(
    ("part", "name", "action"),
    [
        ("link 'crank'", "crank", lambda p: p.mechanism.rigid("crank")),
        ("link 'crank'", "crank", lambda p: p.mechanism.flexible("crank", bar(), ONYX)),
        ("link 'rod'", "rod", lambda p: p.mechanism.rigid("rod", fixed=True)),
        ("'shaft'", "shaft", lambda p: p.mechanism.weld(p.base, p.crank, at=(1.0, 0.0), name="shaft")),
        ("motor 'drive'", "drive", lambda p: p.mechanism.motor(p.shaft, name="drive")),
    ],
)
def test_name_that_is_taken_is_refused(part, name, action):
    assert_refused(lambda: action(parts()), part, f"the name {name!r} is taken", OWN_NAME)


@pytest.mark.parametrize("kind", ["force", "output"])
def test_loads_without_a_name_differ_by_their_place_and_direction(kind):
    p = parts()
    add = getattr(p.mechanism, kind)
    loads = [((0.0, 0.0), (1.0, 0.0)), ((5.0, 0.0), (1.0, 0.0)), ((5.0, 0.0), (0.0, 1.0))]
    names = [add(on=p.crank, at=at, direction=direction).name for at, direction in loads]
    name = f"{kind} on crank"
    assert names == [name, f"{name} at (5, 0)", f"{name} at (5, 0) along (0, 1)"]
    taken = names[-1]
    refusal = f"{taken!r}", f"the name {taken!r} is taken", OWN_NAME
    assert_refused(lambda: add(on=p.crank, at=(5.0, 0.0), direction=(0.0, 1.0)), *refusal)
    refusal = f"{name!r}", f"the name {name!r} is taken", OWN_NAME
    assert_refused(lambda: add(on=p.crank, at=(5.0, 0.0), direction=(1.0, 0.0), name=name), *refusal)


def test_joints_between_the_same_links_differ_by_their_place():
    m = Mechanism("clamp")
    a, b = m.rigid("a", fixed=True), m.rigid("b")
    names = [m.weld(a, b, at=at).name for at in ((0.0, 0.0), (1.0, 0.0))]
    assert names == ["weld joint a–b", "weld joint a–b at (1.0, 0.0)"]


def test_same_joint_twice_is_refused():
    m = Mechanism("clamp")
    a, b = m.rigid("a", fixed=True), m.rigid("b")
    for _ in range(2):
        m.weld(a, b, at=(1.0, 0.0))
    name = "weld joint a–b at (1.0, 0.0)"
    assert_refused(lambda: m.weld(a, b, at=(1.0, 0.0)), f"{name!r}", f"the name {name!r} is taken", OWN_NAME)


def test_joint_of_a_link_with_itself_is_refused():
    p = parts()
    assert_refused(
        lambda: p.mechanism.revolute(p.crank, p.crank, at=(0.0, 0.0), name="knot"),
        "'knot'",
        "link 'crank' is joined with itself",
        "Name two different links",
    )


@pytest.mark.parametrize(
    ("action", "problem"),
    [
        (lambda p: p.mechanism.motor("shaft"), "'shaft' is not a joint"),
        (lambda p: p.mechanism.clamp("base", p.rod, end="end", length=2.0), "'base' is not a link of 'press'"),
        (lambda p: p.mechanism.clamp(p.base, "rod", end="end", length=2.0), "'rod' is not a link of 'press'"),
        (lambda p: Scene(p.mechanism, effects=Disc(1.0)), "is not a list of effects"),
        (lambda p: Scene(p.mechanism, units="mm"), "'mm' is not a set of units"),
        (lambda p: material("Onyx", units="mm"), "'mm' is not a set of units"),
        (lambda p: Face(where=3), "3 is not a predicate"),
        (lambda p: outline((0.0, 0.0), [], depth=1.0), "it has no segments"),
    ],
)
def test_parts_of_another_type_are_refused(action, problem):
    with pytest.raises(DescriptionError, match=problem):
        action(parts())


def test_joint_kind_of_another_type_is_refused():
    p = parts()
    assert_refused(
        lambda: p.mechanism.join("hinge", p.base, p.crank, at=(0.0, 0.0)),
        "joint",
        "'hinge' is not a joint kind",
        "Give an instance of a JointKind",
    )


GHOST = RigidLink("ghost")


@pytest.mark.parametrize("stranger", [GHOST, "crank", None], ids=repr)
@pytest.mark.parametrize(
    ("part", "action"),
    [
        ("'hinge'", lambda p, link: p.mechanism.revolute(link, p.crank, at=(0.0, 0.0), name="hinge")),
        ("'hinge'", lambda p, link: p.mechanism.revolute(p.crank, link, at=(0.0, 0.0), name="hinge")),
        ("'revolute joint'", lambda p, link: p.mechanism.revolute(p.crank, link, at=(0.0, 0.0))),
        ("'push'", lambda p, link: p.mechanism.force(on=link, at=(0.0, 0.0), direction=(1.0, 0.0), name="push")),
        ("'force'", lambda p, link: p.mechanism.force(on=link, at=(0.0, 0.0), direction=(1.0, 0.0))),
        ("'tip'", lambda p, link: p.mechanism.output(on=link, at=(0.0, 0.0), direction=(1.0, 0.0), name="tip")),
        ("'output'", lambda p, link: p.mechanism.output(on=link, at=(0.0, 0.0), direction=(1.0, 0.0))),
    ],
)
def test_link_that_is_not_in_the_mechanism_is_refused(part, action, stranger):
    p = parts()
    assert_refused(lambda: action(p, stranger), part, f"{stranger!r} is not a link of 'press'", "Add the link first")


@pytest.mark.parametrize("ends", [("crank", "rod"), ("rod", "crank")])
def test_flexible_link_without_interface_is_refused(ends):
    p = parts()
    assert_refused(
        lambda: p.mechanism.revolute(*(getattr(p, end) for end in ends), at=(40.0, 0.0), name="far pin"),
        "'far pin'",
        "no interface on flexible link 'rod'",
        "Give interface_radius=… (pin) or region=… (clamp)",
    )


def test_interface_given_twice_is_refused():
    p = parts()
    assert_refused(
        lambda: p.mechanism.weld(
            p.crank, p.rod, at=(40.0, 0.0), interface_radius=2.0, region=Rectangle(1.0, 1.0), name="clamp"
        ),
        "'clamp'",
        "both an interface radius and a region are given",
        "Give one of the two",
    )


def test_interface_that_is_not_a_region_is_refused():
    p = parts()
    assert_refused(
        lambda: p.mechanism.weld(p.crank, p.rod, at=(40.0, 0.0), region=2.0, name="clamp"),
        "'clamp'",
        "2.0 is not its interface",
        "Give Disc(…) or Rectangle(…)",
    )


def test_interface_is_on_flexible_links_only():
    p = parts()
    joint = p.mechanism.weld(p.crank, p.rod, at=(40.0, 0.0), region=Rectangle(2, 3, 0.5))
    assert joint.regions == (None, Rectangle(2.0, 3.0, 0.5))
    assert p.mechanism.revolute(p.rod, p.base, at=(20.0, 0.0), interface_radius=1).regions == (Disc(1.0), None)


def test_motor_on_a_joint_without_a_free_coordinate_is_refused():
    p = parts()
    ball = p.mechanism.join(SPHERICAL, p.base, p.crank, at=(0.0, 0.0), name="ball")
    assert_refused(
        lambda: p.mechanism.motor(ball),
        "motor 'motor of ball'",
        "a spherical joint takes no motor",
        "Use a joint with one free coordinate, such as a revolute or a prismatic one",
    )


def test_second_motor_of_a_joint_is_refused():
    p = parts()
    assert_refused(
        lambda: p.mechanism.motor(p.shaft),
        "motor 'motor of shaft'",
        "'shaft' has a motor already",
        "Give each joint one motor",
    )


def test_motor_on_a_joint_of_another_mechanism_is_refused():
    p = parts()
    other = Mechanism("other")
    hinge = other.revolute(other.rigid("a"), other.rigid("b"), at=(0.0, 0.0), name="hinge")
    assert_refused(
        lambda: p.mechanism.motor(hinge),
        "motor 'motor of hinge'",
        "'hinge' is not a joint of 'press'",
        "Add the joint first",
    )


def test_position_of_a_motor_of_another_mechanism_is_refused():
    p = parts()
    other = Mechanism("other")
    foreign = other.motor(other.revolute(other.rigid("a"), other.rigid("b"), at=(0.0, 0.0), name="hinge"))
    assert_refused(
        lambda: Scene(p.mechanism).configuration("up", {foreign: 1.0}),
        "configuration 'up'",
        f"{foreign.name!r} is not a motor of 'press'",
        "Add it with motor()",
    )


def test_motor_not_named_in_a_configuration_stays_as_drawn():
    p = parts()
    assert Configuration("as it is").position(p.motor) == 0.0
    assert Scene(p.mechanism).configuration("up", {p.motor: 1}).position(p.motor) == 1.0


def test_positions_are_pairs_or_a_mapping_with_each_motor_once():
    p = parts()
    assert Configuration("up", {p.motor: 1}) == Configuration("up", [(p.motor, 1.0)])
    assert Configuration("up", {p.motor: 1}) == Scene(p.mechanism).configuration("up", {p.motor: 1})
    part = "configuration 'up'"
    assert_refused(
        lambda: Configuration("up", [(p.motor, 0.2), (p.motor, 0.3)]),
        part,
        "'drive' is given twice",
        "Give each motor once",
    )
    assert_refused(
        lambda: Configuration("up", {p.shaft: 0.2}), part, f"{p.shaft!r} is not a motor", "Give one from this mechanism"
    )
    for given in (0.2, [p.motor], p.motor):
        assert_refused(
            lambda given=given: Configuration("up", given),
            part,
            f"{given!r} gives no positions",
            "Give {motor: position, …}",
        )


def test_parts_are_listed_in_the_order_given():
    p = parts()
    assert p.mechanism.links == [p.base, p.crank, p.rod]
    assert p.mechanism.rigid_links == [p.base, p.crank]
    assert p.mechanism.flexible_links == [p.rod]


def test_directions_have_unit_length():
    p = parts()
    assert p.mechanism.force(on=p.crank, at=(0.0, 0.0), direction=(3.0, 4.0)).direction == (0.6, 0.8)
    slider = p.mechanism.prismatic(p.base, p.crank, at=(0.0, 0.0), axis=(0.0, -5.0))
    assert slider.axis == (0.0, -1.0, 0.0)


def test_shape_and_material_of_the_wrong_kind_are_refused():
    other = Mechanism("m")
    with pytest.raises(DescriptionError, match="link 'bar': its shape is"):
        other.flexible("bar", [(0, 0), (1, 1)], ONYX)
    with pytest.raises(DescriptionError, match="link 'bar': its material is 'PLA'"):
        other.flexible("bar", bar(), "PLA")
    with pytest.raises(DescriptionError, match="material 'PLA': its law is"):
        Material("PLA", law=NeoHookean)
    with pytest.raises(DescriptionError, match="not a list of points"):
        strip(None, thickness=1.0, depth=1.0)
