"""Clamps on strips: the region is filled, and rectangles askew on their strip are warned of."""

import logging
import math

import numpy as np
import pytest

from fenicsmech.mechanism import ONYX, Centreline, Disc, Mechanism, Rectangle, strip
from fenicsmech.meshing import InterfaceSite, cell_measures, check_link, mesh_link

STRAIGHT = [(0.0, 0.0), (40.0, 0.0)]
INCLINED = [(0.0, 0.0), (30.0, 17.0)]
WAVY = [(0.0, 0.0), (20.0, 15.0), (40.0, 0.0), (60.0, 15.0)]
THICKNESS, LENGTH = 3.0, 5.0


def clamp(points, end):
    mechanism = Mechanism("rig")
    wall = mechanism.rigid("wall", fixed=True)
    link = mechanism.flexible("blade", strip(points, thickness=THICKNESS, depth=4.0), ONYX)
    joint = mechanism.clamp(wall, link, end=end, length=LENGTH)
    return InterfaceSite(joint.at[:2], joint.regions[1], name="clamp")


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("end", ["start", "end"])
@pytest.mark.parametrize("points", [STRAIGHT, INCLINED, WAVY])
def test_a_clamp_holds_all_of_the_strip_up_to_a_face_across_it(points, end, dim, caplog):
    site, shape = clamp(points, end), strip(points, thickness=THICKNESS, depth=4.0)
    mesh = mesh_link("blade", shape, [site], dim=dim, size=0.8)
    held = mesh.cells_of(0)
    depth = 4.0 if dim == 3 else 1.0
    assert cell_measures(mesh.points, held).sum() == pytest.approx(depth * THICKNESS * LENGTH, rel=0.02)
    curve = Centreline(points)
    inner = curve.parameter_at(LENGTH if end == "start" else curve.length - LENGTH)
    shared = np.intersect1d(held, mesh.cells_of(-1))
    offsets = mesh.points[shared, :2] - curve.evaluate(inner)
    assert offsets @ curve.tangent(inner) == pytest.approx(0.0, abs=1e-8)
    across = offsets @ curve.normal(inner)
    assert (across.min(), across.max()) == (pytest.approx(-1.5, abs=1e-3), pytest.approx(1.5, abs=1e-3))
    check_link("blade", shape, [site], {}, dim=dim, size=0.8)
    assert not caplog.records


@pytest.mark.parametrize(
    "points, at, region",
    [
        (STRAIGHT, (0.0, 0.0), Rectangle(6.0, 4.0)),
        (STRAIGHT, (2.0, 0.0), Rectangle(4.0, 3.0)),
        (STRAIGHT, (20.0, 0.0), Rectangle(4.0, 8.0, 0.5 * math.pi)),
        (INCLINED, (0.0, 0.0), Rectangle(6.0, 4.0, math.atan2(17.0, 30.0))),
        (INCLINED, (0.0, 0.0), Disc(1.0)),
    ],
)
def test_a_rectangle_across_its_strip_gives_no_warning(points, at, region, caplog):
    check_link("blade", strip(points, thickness=THICKNESS, depth=4.0), [InterfaceSite(at, region)], {}, dim=2, size=1.0)
    assert not caplog.records


@pytest.mark.parametrize(
    "points, at, region, problem, remedy",
    [
        (INCLINED, (0.0, 0.0), Rectangle(6.0, 8.0), "near (3, 1.7) is turned by 29.5° from across", "angle=0.51554"),
        (STRAIGHT, (20.0, 0.0), Rectangle(9.0, 9.0, 0.1), "is turned by 5.73° from across", "angle=0 (rad"),
        (STRAIGHT, (0.0, 0.0), Rectangle(6.0, 2.0), "does not cover the width 3 of the strip near (3, ", "wider"),
        (STRAIGHT, (0.0, 1.4), Rectangle(6.0, 3.5), "does not cover the width 3", "Use Mechanism.clamp"),
        (STRAIGHT, (9.0, 1.4), Rectangle(6.0, 2.0), "does not reach the centreline", "move it"),
    ],
)
def test_a_rectangle_askew_on_its_strip_gives_a_warning(points, at, region, problem, remedy, caplog):
    with caplog.at_level(logging.WARNING):
        shape = strip(points, thickness=THICKNESS, depth=4.0)
        check_link("blade", shape, [InterfaceSite(at, region, name="clamp")], {}, dim=2, size=1.0)
    (record,) = caplog.records
    message = record.getMessage()
    assert message.startswith("joint 'clamp' on link 'blade': ") and problem in message and remedy in message
