"""Interface cells fill the region where a joint holds the link, no more and no less."""

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.mechanism import Disc, polygon, step_file, strip
from fenicsmech.meshing import InterfaceSite, cell_measures, circle_segments, mesh_link

MESHES = Path(__file__).parents[2] / "meshes"
BOW = strip([(0.0, 0.0), (18.0, 34.0), (40.0, 60.0)], thickness=3.0, depth=8.0)
PLATE = polygon([(0.0, 0.0), (30.0, 0.0), (30.0, 12.0), (0.0, 20.0)], depth=4.0)
PART = step_file(MESHES / "curved_link.step", depth=10.0)
HOLE = 1.5  # radius of the pin holes of the STEP part


def boundary_vertices(cells):
    """Vertices of the facets that only one of ``cells`` has."""
    width = cells.shape[1]
    facets = np.sort(np.concatenate([cells[:, list(kept)] for kept in combinations(range(width), width - 1)]), axis=1)
    single, counts = np.unique(facets, axis=0, return_counts=True)
    return np.unique(single[counts == 1])


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0.7, 2.0, 6.0])
@pytest.mark.parametrize("ratio", [0.5, 0.9, 0.99, 1.0, 1.01, 1.1, 1.5, 2.0])
@pytest.mark.parametrize("at", [BOW.centreline[0], BOW.centreline[1]])
def test_a_disc_on_a_strip_is_filled_by_a_polygon_with_its_corners_on_the_circle(at, ratio, size):
    site = InterfaceSite(at, Disc(1.5 * ratio), name="pin")
    mesh = mesh_link("bow", BOW, [site], dim=2, size=size)
    held = mesh.cells_of(0)
    # a radius within 2 % of half the thickness is taken as that, unless the elements are fine enough to tell
    snapped = abs(ratio - 1.0) <= min(0.02, 1.0 - math.cos(math.pi / circle_segments(1.5 * ratio, size)))
    radius = 1.5 if snapped else 1.5 * ratio
    distance = np.linalg.norm(site.across(mesh.points), axis=1)
    assert distance[np.unique(held)].max() <= radius * (1.0 + 1e-8)
    assert distance[boundary_vertices(held)] == pytest.approx(radius, rel=1e-8)
    # an inscribed polygon of n sides: n/2 r² sin(2π/n)
    segments = circle_segments(radius, size)
    filled = cell_measures(mesh.points, held).sum() / (math.pi * radius**2)
    assert 0.99 * segments / (2.0 * math.pi) * math.sin(2.0 * math.pi / segments) < filled < 1.0
    centroids = site.across(mesh.points)[mesh.cells_of(-1)].mean(axis=1)
    assert np.linalg.norm(centroids, axis=1).min() > radius * math.cos(math.pi / segments) * 0.99


def test_a_small_pin_gets_eight_segments_whatever_the_size():
    mesh = mesh_link("plate", PLATE, [InterfaceSite((10.0, 8.0), Disc(1.0), name="pin")], dim=2, size=5.0)
    assert len(boundary_vertices(mesh.cells_of(0))) >= 8


def test_a_pin_through_an_extruded_link_is_a_cylinder():
    site = InterfaceSite((10.0, 8.0, 1.0), Disc(3.0), name="pin")
    plan = mesh_link("plate", PLATE, [site], dim=2, size=1.0)
    mesh = mesh_link("plate", PLATE, [site], dim=3, size=1.0)
    flat, solid = plan.cells_of(0), mesh.cells_of(0)
    assert cell_measures(mesh.points, solid).sum() == pytest.approx(
        4.0 * cell_measures(plan.points, flat).sum(), rel=1e-12
    )
    assert np.ptp(mesh.points[np.unique(solid), 2]) == pytest.approx(4.0)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, 0.6, -0.8)])
def test_a_cylinder_lies_along_the_axis_whichever_way_it_points(axis):
    site = InterfaceSite((15.0, 6.0, 0.0), Disc(1.2), axis=axis, name="hinge")
    mesh = mesh_link("plate", PLATE, [site], dim=3, size=1.5)
    held = mesh.cells_of(0)
    assert np.linalg.norm(site.across(mesh.points), axis=1)[np.unique(held)].max() <= 1.2 * (1.0 + 1e-6)
    # length of the axis inside the plate: between the slanted top y = 20 − 8x/30 and y = 0, and |z| ≤ 2
    _, y, z = np.abs(axis)
    through = min(4.0 / z if z else math.inf, 16.0 / y if y else math.inf)
    assert cell_measures(mesh.points, held).sum() == pytest.approx(math.pi * 1.2**2 * through, rel=0.12)
    assert cell_measures(mesh.points, mesh.cells).sum() == pytest.approx(480.0 * 4.0, rel=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize(("dim", "extent", "radius"), [(2, 1.0, 2.5), (2, 1.0, 4.0), (3, 10.0, 2.5)])
def test_around_the_hole_of_a_step_part_a_ring_is_held(dim, extent, radius):
    site = InterfaceSite((60.0, 0.0), Disc(radius), name="pin")
    mesh = mesh_link("part", PART, [site], dim=dim, size=1.0)
    held = mesh.cells_of(0)
    distance = np.linalg.norm(site.across(mesh.points), axis=1)[boundary_vertices(held)]
    assert distance.max() <= radius * (1.0 + 1e-6)
    on_circle = np.isclose(distance, radius, rtol=1e-6)
    on_hole = np.isclose(distance, HOLE, rtol=1e-6)
    if dim == 2:
        assert np.all(on_circle | on_hole)
    assert on_circle.any() and on_hole.any()
    ring = math.pi * (radius**2 - HOLE**2) * extent
    assert cell_measures(mesh.points, held).sum() == pytest.approx(ring, rel=0.05)
