"""A mechanism that cannot be simulated is refused before anything is meshed, with the name of the part and a remedy."""

import pytest

from fenicsmech.joints import CYLINDRICAL, SPHERICAL, UNIVERSAL
from fenicsmech.mechanism import ONYX, Disc, Mechanism, Rectangle, strip, validate

from .parts import assert_refused, parts

EVERY_DIMENSION = pytest.mark.parametrize("dim", [2, 3])


@EVERY_DIMENSION
def test_sound_mechanism_is_accepted(dim):
    p = parts()
    p.mechanism.force(on=p.rod, at=(40.0, 0.0), direction=(0.0, 1.0))
    p.mechanism.output(on=p.base, at=(0.0, 0.0), direction=(0.0, 1.0))
    validate(p.mechanism, dim)


@EVERY_DIMENSION
def test_mechanism_without_links_is_refused(dim):
    assert_refused(
        lambda: validate(Mechanism("void"), dim),
        "mechanism 'void'",
        "it has no links",
        "Add links with rigid() and flexible()",
    )


@EVERY_DIMENSION
def test_mechanism_without_ground_is_refused(dim):
    m = Mechanism("afloat")
    m.revolute(m.rigid("a"), m.rigid("b"), at=(0.0, 0.0))
    assert_refused(
        lambda: validate(m, dim),
        "mechanism 'afloat'",
        "no link is fixed, so no load has a path to ground",
        "Make one rigid link the ground: rigid(name, fixed=True)",
    )


@EVERY_DIMENSION
@pytest.mark.parametrize("flexible", [False, True])
def test_link_without_joint_is_refused(flexible, dim):
    p = parts()
    if flexible:
        p.mechanism.flexible("spare", strip([(0, 0), (9, 0)], thickness=1.0, depth=1.0), ONYX)
    else:
        p.mechanism.rigid("spare")
    assert_refused(
        lambda: validate(p.mechanism, dim),
        "link 'spare'",
        "it is not connected: no joint holds it",
        "Join it to another link or remove it",
    )


@EVERY_DIMENSION
def test_second_ground_needs_no_joint(dim):
    p = parts()
    p.mechanism.rigid("wall", fixed=True)
    validate(p.mechanism, dim)


@EVERY_DIMENSION
def test_island_without_a_path_to_ground_is_refused(dim):
    p = parts()
    island = [p.mechanism.rigid(name) for name in ("raft", "mast", "sail")]
    for a, b in zip(island, island[1:], strict=False):
        p.mechanism.revolute(a, b, at=(0.0, 50.0))
    assert_refused(
        lambda: validate(p.mechanism, dim),
        "link 'raft'",
        "no load path to ground: no joint connects 'raft', 'mast', 'sail' with a fixed link",
        "Join one of them to a fixed link",
    )


@EVERY_DIMENSION
def test_force_on_a_fixed_link_is_refused(dim):
    p = parts()
    p.mechanism.force(on=p.base, at=(0.0, 0.0), direction=(1.0, 0.0), name="push")
    assert_refused(
        lambda: validate(p.mechanism, dim), "force 'push'", "it acts on the fixed link 'base'", "Give a link that moves"
    )


@EVERY_DIMENSION
@pytest.mark.parametrize("at", [(10.0, 0.0), (10.0, 0.0, 0.0)], ids=["plane", "space"])
@pytest.mark.parametrize("region", [Disc(3.0), Rectangle(4.0, 4.0)], ids=["disc", "rectangle"])
def test_different_interfaces_at_one_place_are_refused(region, at, dim):
    p = parts()
    p.mechanism.revolute(p.rod, p.base, at=at, region=region, name="second pin")
    assert_refused(
        lambda: validate(p.mechanism, dim),
        "'second pin'",
        f"its interface on 'rod' is {region}, but 'pin' has Disc(radius=2.0) at the same place",
        "Give joints at one place of a link the same interface radius or region",
    )


@EVERY_DIMENSION
def test_equal_interfaces_at_one_place_are_accepted(dim):
    p = parts()
    p.mechanism.revolute(p.rod, p.base, at=(10.0, 0.0, 0.0), interface_radius=2.0)
    validate(p.mechanism, dim)


def test_interfaces_above_each_other_meet_in_the_plane_only():
    p = parts()
    p.mechanism.revolute(p.rod, p.base, at=(10.0, 0.0, 5.0), interface_radius=3.0, name="upper pin")
    validate(p.mechanism, 3)
    assert_refused(
        lambda: validate(p.mechanism, 2),
        "'upper pin'",
        "its interface on 'rod' is Disc(radius=3.0), but 'pin' has Disc(radius=2.0) at the same place",
        "Give joints at one place of a link the same interface radius or region",
    )


@pytest.mark.parametrize("kind", [SPHERICAL, CYLINDRICAL, UNIVERSAL], ids=lambda kind: kind.name)
def test_joint_that_does_not_exist_in_the_plane_is_refused_there(kind):
    p = parts()
    p.mechanism.join(kind, p.base, p.crank, at=(0.0, 0.0), name="joint")
    validate(p.mechanism, 3)
    assert_refused(
        lambda: validate(p.mechanism, 2),
        "'joint'",
        f"a {kind.name} joint does not exist in a planar model",
        "Use space='3d' or a planar joint",
    )


@pytest.mark.parametrize("axis", [(0.0, 0.6, 0.8), (1.0, 0.0, 0.0)])
@pytest.mark.parametrize("kind", ["revolute", "planar"])
def test_axis_that_is_not_normal_to_the_plane_is_refused_there(kind, axis):
    p = parts()
    getattr(p.mechanism, kind)(p.base, p.crank, at=(0.0, 0.0), axis=axis, name="joint")
    validate(p.mechanism, 3)
    assert_refused(
        lambda: validate(p.mechanism, 2),
        "'joint'",
        f"its axis {axis} is not normal to the plane",
        "Leave it at (0, 0, 1) or use space='3d'",
    )


def test_slider_that_leaves_the_plane_is_refused_there():
    p = parts()
    p.mechanism.prismatic(p.base, p.crank, at=(0.0, 0.0), axis=(0.0, 0.6, 0.8), name="slider")
    validate(p.mechanism, 3)
    assert_refused(
        lambda: validate(p.mechanism, 2),
        "'slider'",
        "its axis (0.0, 0.6, 0.8) leaves the plane",
        "Give an axis (x, y) or use space='3d'",
    )


@pytest.mark.parametrize("kind", ["force", "output"])
def test_direction_that_leaves_the_plane_is_refused_there(kind):
    p = parts()
    getattr(p.mechanism, kind)(on=p.crank, at=(0.0, 0.0), direction=(0.6, 0.0, 0.8), name="pull")
    validate(p.mechanism, 3)
    assert_refused(
        lambda: validate(p.mechanism, 2),
        "'pull'",
        "its direction (0.6, 0.0, 0.8) leaves the plane",
        "Give (x, y) or use space='3d'",
    )


def test_axis_downwards_and_directions_with_a_zero_are_in_the_plane():
    p = parts()
    p.mechanism.revolute(p.base, p.crank, at=(0.0, 0.0), axis=(0.0, 0.0, -1.0))
    p.mechanism.force(on=p.crank, at=(0.0, 0.0), direction=(1.0, 0.0, 0.0))
    validate(p.mechanism, 2)
