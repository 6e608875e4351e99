"""Every number of a description is checked to be finite, and named if it is not."""

import re

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError, counted
from fenicsmech.mechanism import (
    Arc,
    Configuration,
    Disc,
    Line,
    Material,
    Rectangle,
    Scene,
    gmsh_mesh,
    outline,
    polygon,
    step_file,
    strip,
)

from .parts import assert_refused, parts

TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]


def pin(p, **options):
    """A joint between crank and rod at another place."""
    return p.mechanism.revolute(
        p.crank, p.rod, **{"at": (40.0, 0.0), "interface_radius": 2.0, "name": "far pin", **options}
    )


# The name in the message, and the entry: a function of the parts and the number that is wrong.
COORDINATES = {
    "position of 'far pin'": lambda p, x: pin(p, at=(x, 0.0)),
    "axis of 'far pin'": lambda p, x: pin(p, axis=(0.0, x, 1.0)),
    "angle of the interface of 'far pin'": lambda p, x: pin(p, interface_radius=None, region=Rectangle(1.0, 1.0, x)),
    "position of 'push'": lambda p, x: p.mechanism.force(on=p.crank, at=(0.0, x), direction=(1.0, 0.0), name="push"),
    "direction of 'push'": lambda p, x: p.mechanism.force(on=p.crank, at=(0.0, 0.0), direction=(x, 1.0), name="push"),
    "position of 'tip'": lambda p, x: p.mechanism.output(on=p.crank, at=(x, 0.0), direction=(1.0, 0.0), name="tip"),
    "direction of 'tip'": lambda p, x: p.mechanism.output(on=p.crank, at=(0.0, 0.0), direction=(1.0, x), name="tip"),
    "position of motor 'drive' in configuration 'up'": lambda p, x: Scene(p.mechanism).configuration(
        "up", {p.motor: x}
    ),
    "position of motor 'drive' in configuration 'down'": lambda p, x: Configuration("down", ((p.motor, x),)),
    "strip centreline": lambda p, x: strip([(0.0, 0.0), (x, 1.0)], thickness=1.0, depth=1.0),
    "polygon": lambda p, x: polygon([*TRIANGLE, (x, 5.0)], depth=1.0),
    "outline start": lambda p, x: outline((x, 0.0), [Line((1.0, 1.0))], depth=1.0),
    "outline segment end": lambda p, x: outline((0.0, 0.0), [Line((1.0, x))], depth=1.0),
    "outline arc": lambda p, x: outline((0.0, 0.0), [Arc((x, 1.0), (1.0, 1.0))], depth=1.0),
    "STEP section": lambda p, x: step_file("part.step", depth=1.0, section=x),
    "Poisson's ratio of law NeoHookean of material 'clay'": lambda p, x: Material("clay", 1.0, x),
}
SIZES = {
    "radius of 'far pin'": lambda p, x: pin(p, interface_radius=x),
    "radius of 'far clamp'": lambda p, x: pin(p, interface_radius=None, region=Disc(x), name="far clamp"),
    "length of the interface of 'far pin'": lambda p, x: pin(p, interface_radius=None, region=Rectangle(x, 1.0)),
    "width of the interface of 'far pin'": lambda p, x: pin(p, interface_radius=None, region=Rectangle(1.0, x)),
    "strip thickness": lambda p, x: strip(TRIANGLE, thickness=x, depth=1.0),
    "strip depth": lambda p, x: strip(TRIANGLE, thickness=1.0, depth=x),
    "polygon depth": lambda p, x: polygon(TRIANGLE, depth=x),
    "outline depth": lambda p, x: outline((0.0, 0.0), [Line((1.0, 1.0))], depth=x),
    "STEP depth": lambda p, x: step_file("part.step", depth=x),
    "mesh depth": lambda p, x: gmsh_mesh("part.msh", depth=x),
    "Young's modulus of law NeoHookean of material 'clay'": lambda p, x: Material("clay", x, 0.3),
    "density of material 'clay'": lambda p, x: Material("clay", 1.0, 0.3, density=x),
}
NUMBERS = COORDINATES | SIZES
OPTIONAL = ("radius of 'far pin'", "density of material 'clay'")  # None is not given


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")], ids=["nan", "inf", "-inf"])
@pytest.mark.parametrize("part", NUMBERS)
def test_number_that_is_not_finite_is_refused(part, value):
    assert_refused(lambda: NUMBERS[part](parts(), value), part, f"the value is {value}", "Give a finite number")


@pytest.mark.parametrize("value", ["wide", None, (1.0,), 1j], ids=repr)
@pytest.mark.parametrize("part", [part for part in NUMBERS if part not in OPTIONAL])
def test_value_that_is_not_a_number_is_refused(part, value):
    assert_refused(lambda: NUMBERS[part](parts(), value), part, f"{value!r} is not a number", "Give a finite number")


@pytest.mark.parametrize("value", [0.0, -2.0])
@pytest.mark.parametrize("part", SIZES)
def test_size_that_is_not_positive_is_refused(part, value):
    remedy = "Give a number greater than zero"
    assert_refused(lambda: SIZES[part](parts(), value), part, f"{value:g} is not positive", remedy)


@pytest.mark.parametrize("part", NUMBERS)
def test_refused_part_is_not_added(part):
    p = parts()
    before = [len(each) for each in (p.mechanism.joints, p.mechanism.forces, p.mechanism.outputs)]
    with pytest.raises(DescriptionError, match=re.escape(part)):
        NUMBERS[part](p, float("nan"))
    assert [len(each) for each in (p.mechanism.joints, p.mechanism.forces, p.mechanism.outputs)] == before


@pytest.mark.parametrize("part", NUMBERS)
def test_sound_number_is_accepted(part):
    NUMBERS[part](parts(), 0.25)


@pytest.mark.parametrize("nu", [-1.0, 0.5, 0.6, -3.0])
def test_poissons_ratio_outside_its_range_is_refused(nu):
    assert_refused(
        lambda: Material("clay", 1.0, nu),
        "law NeoHookean of material 'clay'",
        f"Poisson's ratio is {nu:g}",
        "Give a value between −1 and 0.5, both excluded",
    )


@pytest.mark.parametrize("nu", [-0.999, 0.0, 0.4999])
def test_poissons_ratio_within_its_range_is_accepted(nu):
    assert Material("clay", 1.0, nu).law.nu == nu


@pytest.mark.parametrize(
    ("part", "action"),
    [
        ("axis of 'far pin'", lambda p: pin(p, axis=(0.0, 0.0, 0.0))),
        (
            "direction of 'push'",
            lambda p: p.mechanism.force(on=p.crank, at=(0.0, 0.0), direction=(0.0, 0.0), name="push"),
        ),
        (
            "direction of 'tip'",
            lambda p: p.mechanism.output(on=p.crank, at=(0.0, 0.0), direction=(0.0, 0.0, 0.0), name="tip"),
        ),
    ],
)
def test_direction_without_length_is_refused(part, action):
    assert_refused(
        lambda: action(parts()), part, "the direction has zero length", "Give a vector that points somewhere"
    )


@pytest.mark.parametrize(
    ("part", "values", "wanted", "action"),
    [
        ("position of 'far pin'", (1.0,), "2 or 3", lambda p, v: pin(p, at=v)),
        ("position of 'far pin'", 3.0, "2 or 3", lambda p, v: pin(p, at=v)),
        ("axis of 'far pin'", (1.0, 0.0, 0.0, 0.0), "2 or 3", lambda p, v: pin(p, axis=v)),
        ("strip centreline", (1.0, 2.0, 3.0), "2", lambda p, v: strip([(0.0, 0.0), v], thickness=1.0, depth=1.0)),
        ("outline start", (1.0, 2.0, 3.0), "2", lambda p, v: outline(v, [Line((1.0, 1.0))], depth=1.0)),
    ],
)
def test_wrong_number_of_coordinates_is_refused(part, values, wanted, action):
    assert_refused(
        lambda: action(parts(), values),
        part,
        f"{values!r} does not have {wanted} coordinates",
        f"Give {wanted} numbers",
    )


@pytest.mark.parametrize(
    ("part", "least", "action"),
    [
        ("strip centreline", 2, lambda points: strip(points, thickness=1.0, depth=1.0)),
        ("polygon", 3, lambda points: polygon(points, depth=1.0)),
    ],
)
def test_too_few_points_are_refused(part, least, action):
    given = least - 1
    assert_refused(
        lambda: action(TRIANGLE[:given]), part, f"{counted(given, 'point')} given", f"Give at least {least} points"
    )


def test_outline_of_anything_but_lines_and_arcs_is_refused():
    assert_refused(
        lambda: outline((0.0, 0.0), [(1.0, 1.0)], depth=1.0),
        "outline",
        "(1.0, 1.0) is not a segment",
        "Give Line(…) or Arc(…)",
    )


def test_numbers_of_any_kind_become_plain_ones():
    p = parts()
    joint = pin(p, at=np.array([40, 0]), axis=np.array([0, 0, 2]), interface_radius=np.float32(2))
    assert (joint.at, joint.axis, joint.regions[1]) == ((40.0, 0.0), (0.0, 0.0, 1.0), Disc(2.0))
    assert {type(x) for x in (*joint.at, *joint.axis, joint.regions[1].radius)} == {float}
    assert strip(np.array(TRIANGLE), thickness=1, depth=1).centreline == tuple(TRIANGLE)
    clay = Material("clay", np.int64(3), np.float32(0.25))
    assert (clay.law.E, clay.law.nu) == (3.0, 0.25)
    assert type(clay.law.E) is type(clay.law.nu) is float
