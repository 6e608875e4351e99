"""Outlines of lines and arcs: areas, closing, and arcs longer than a half circle."""

import math

import numpy as np
import pytest

from fenicsmech.mechanism import Arc, Line, outline, polygon
from fenicsmech.meshing import cell_measures, mesh_link


def area(shape, size=1.0):
    mesh = mesh_link("plate", shape, dim=2, size=size)
    return cell_measures(mesh.points, mesh.cells).sum()


@pytest.mark.parametrize(
    "corners", [[(0, 0), (12, 0), (12, 5)], [(12, 5), (12, 0), (0, 0)], [(0, 0), (12, 0), (12, 5), (0, 0)]]
)
def test_a_polygon_has_its_area_whichever_way_round_and_however_closed(corners):
    assert area(polygon(corners, depth=1.0)) == pytest.approx(30.0, rel=1e-9)


def test_an_open_outline_is_closed_by_a_straight_line():
    assert area(outline((0, 0), [Line((12, 0)), Line((12, 5))], depth=1.0)) == pytest.approx(30.0, rel=1e-9)


def test_a_slot_of_lines_and_half_circles():
    slot = outline((0, -3), [Line((20, -3)), Arc((23, 0), (20, 3)), Line((0, 3)), Arc((-3, 0), (0, -3))], depth=1.0)
    assert area(slot, size=0.3) == pytest.approx(120.0 + 9.0 * math.pi, rel=1e-3)


@pytest.mark.parametrize("via, sign", [((4.0 + math.sqrt(2.0), 0.0), 1.0), ((math.sqrt(2.0) * -1 + 4.0, 0.0), -1.0)])
def test_an_arc_runs_through_its_middle_point(via, sign):
    # the corner (4, ±r/√2·…) box with one side replaced by an arc of a circle around (4, 0) with radius √2
    ends = (4.0 + 0.0, -math.sqrt(2.0)), (4.0 + 0.0, math.sqrt(2.0))
    shape = outline((0.0, -math.sqrt(2.0)), [Line(ends[0]), Arc(via, ends[1]), Line((0.0, math.sqrt(2.0)))], depth=1.0)
    exact = 8.0 * math.sqrt(2.0) + sign * math.pi
    assert area(shape, size=0.15) == pytest.approx(exact, rel=3e-3)


def test_an_arc_may_be_longer_than_a_half_circle():
    # three quarters of the unit circle and the square's corner: |arc| = 270°
    shape = outline((10.0, 0.0), [Arc((-10.0, 0.0), (0.0, -10.0)), Line((10.0, -10.0))], depth=1.0)
    assert area(shape, size=0.8) == pytest.approx(75.0 * math.pi + 100.0, rel=2e-3)


def test_corners_are_vertices_of_the_mesh():
    corners = np.array([(0.0, 0.0), (12.0, 0.0), (12.3, 5.1), (3.0, 7.0)])
    mesh = mesh_link("plate", polygon(corners.tolist(), depth=1.0), dim=2, size=2.0)
    assert all(np.linalg.norm(mesh.points - corner, axis=1).min() < 1e-9 for corner in corners)
