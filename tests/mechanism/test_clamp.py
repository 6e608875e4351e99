"""Clamps at the ends of strips: place, direction and width."""

import math

import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import ONYX, Mechanism, Rectangle, polygon, strip

LENGTH, THICKNESS = 30.0, 2.0


def clamped(centreline, *, end, length=4.0, thickness=THICKNESS):
    mechanism = Mechanism("rig")
    wall = mechanism.rigid("wall", fixed=True)
    blade = mechanism.flexible("blade", strip(centreline, thickness=thickness, depth=5.0), ONYX)
    return mechanism.clamp(wall, blade, end=end, length=length)


@pytest.mark.parametrize("angle", [0.0, 0.3, -2.0, 0.5 * math.pi])
@pytest.mark.parametrize("end", ["start", "end"])
def test_a_clamp_is_centred_on_the_end_and_aligned_with_the_strip(angle, end):
    tip = (LENGTH * math.cos(angle), LENGTH * math.sin(angle))
    joint = clamped([(0.0, 0.0), tip], end=end)
    at, region = joint.at, joint.regions[1]
    assert at[:2] == pytest.approx((0.0, 0.0) if end == "start" else tip)
    assert (region.length, region.angle) == (pytest.approx(8.0), pytest.approx(angle))
    assert region.width > THICKNESS


@pytest.mark.parametrize("end", ["start", "end"])
def test_the_length_counts_along_the_centreline_of_a_curved_strip(end):
    radius, sweep = 20.0, 1.2
    arc = [(radius * math.sin(sweep * k / 20), radius * (1.0 - math.cos(sweep * k / 20))) for k in range(21)]
    joint = clamped(arc, end=end, length=5.0)
    turned = 5.0 / radius
    assert joint.regions[1].angle == pytest.approx(turned if end == "start" else sweep - turned, abs=1e-4)
    # the end of an arc is r sin φ away from the face that is r φ away along it
    assert 0.5 * joint.regions[1].length == pytest.approx(radius * math.sin(turned), rel=1e-4)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"end": "left"}, "the end of the strip is 'left'. Give end='start' or end='end'"),
        ({"end": "end", "length": 0.0}, "length of 'clamp wall–blade'"),
        ({"end": "end", "length": 30.0}, "its length 30 is not less than that of the strip, 30"),
    ],
)
def test_an_invalid_clamp_is_refused(arguments, message):
    with pytest.raises(DescriptionError, match=message):
        clamped([(0.0, 0.0), (LENGTH, 0.0)], **arguments)


def test_a_strip_that_bends_back_over_its_clamp_is_refused():
    half_turn = [(5.0 * math.sin(0.1 * k), 5.0 * (1.0 - math.cos(0.1 * k))) for k in range(36)]
    with pytest.raises(DescriptionError, match="the strip bends too much for a clamp of length 16. Make the clamp"):
        clamped(half_turn, end="start", length=16.0)


def test_only_strips_have_ends():
    mechanism = Mechanism("rig")
    wall = mechanism.rigid("wall", fixed=True)
    plate = mechanism.flexible("plate", polygon([(0, 0), (9, 0), (9, 2)], depth=1.0), ONYX)
    with pytest.raises(DescriptionError, match=r"link 'plate' is not a strip. Use weld\(…, at=…, region=Rectangle"):
        mechanism.clamp(wall, plate, end="start", length=4.0)
    with pytest.raises(DescriptionError, match="'wall' is not a strip"):
        mechanism.clamp(plate, wall, end="start", length=4.0)


def test_a_clamp_is_a_weld_with_a_rectangle():
    joint = clamped([(0.0, 0.0), (LENGTH, 0.0)], end="start")
    assert joint.kind.name == "weld" and isinstance(joint.regions[1], Rectangle) and joint.regions[0] is None
