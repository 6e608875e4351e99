"""Strips: their area, round eyes of any size relative to the thickness, element size, and indifference to the unit."""

import math

import numpy as np
import pytest

from fenicsmech.mechanism import Centreline, Disc, Rectangle, strip
from fenicsmech.meshing import FREE, InterfaceSite, cell_measures, mesh_link, radius_ratios

STRAIGHT = [(0.0, 0.0), (40.0, 0.0)]
BENT = [(0.0, 0.0), (18.0, 34.0), (40.0, 60.0)]
WAVY = [(0.0, 0.0), (20.0, 15.0), (40.0, 0.0), (60.0, 15.0)]
RATIOS = [0.5, 0.9, 0.99, 1.0, 1.01, 1.1, 1.5, 2.0]  # radius over half the thickness


def pins(*places, radius):
    return [InterfaceSite(at, Disc(radius), name=f"pin {k}") for k, at in enumerate(places)]


def on_curve(points, fraction):
    curve = Centreline(points)
    return tuple(curve.evaluate(fraction * curve.end).tolist())


def area(mesh):
    return cell_measures(mesh.points, mesh.cells).sum()


def test_a_straight_strip_without_joints_is_a_rectangle():
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=3.0, depth=5.0), dim=2, size=1.5)
    assert area(mesh) == pytest.approx(120.0, rel=1e-10)
    assert np.allclose(mesh.points.min(axis=0), (0.0, -1.5)) and np.allclose(mesh.points.max(axis=0), (40.0, 1.5))
    assert np.all(mesh.interface == FREE)


@pytest.mark.parametrize("points", [BENT, WAVY])
def test_a_curved_strip_has_the_area_length_times_thickness(points):
    mesh = mesh_link("bow", strip(points, thickness=3.0, depth=5.0), dim=2, size=0.75)
    assert area(mesh) == pytest.approx(3.0 * Centreline(points).length, rel=2e-4)


@pytest.mark.parametrize("ratio", [1.1, 1.5, 2.0])
def test_eyes_add_the_part_of_their_disc_beyond_the_strip(ratio):
    half, size = 1.5, 0.4
    radius = ratio * half
    inside = half * math.sqrt(radius**2 - half**2) + radius**2 * math.asin(half / radius)
    exact = 2.0 * half * 40.0 + 2.0 * (math.pi * radius**2 - inside)
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=3.0, depth=5.0), pins(*STRAIGHT, radius=radius), dim=2, size=size)
    segments = 2.0 * math.pi * radius / size
    missing = 2.0 * math.pi * radius**2 * (2.0 * math.pi**2 / 3.0) / segments**2  # of two inscribed polygons
    assert exact - 1.1 * missing < area(mesh) < exact


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("half", "thickness", "points"),
    [
        *((None, thickness, points) for thickness in (2.5, 1.0, 0.3) for points in (STRAIGHT, BENT, WAVY)),
        *((half, thickness, BENT) for half in (False, True) for thickness in (2.5, 0.3)),
    ],
)
def test_eyes_much_wider_than_the_strip_are_discs_around_their_pins(points, thickness, half):
    radius, size, depth = 3.0, 0.6, 2.0
    sites = pins(points[0], on_curve(points, 0.5), points[-1], radius=radius)
    space = {"dim": 2} if half is None else {"dim": 3, "half": half}
    mesh = mesh_link("link", strip(points, thickness=thickness, depth=depth), sites, size=size, **space)
    height = 1.0 if half is None else depth * (0.5 if half else 1.0)
    for number, site in enumerate(sites):
        held = mesh.cells_of(number)
        assert np.linalg.norm(mesh.points[np.unique(held), :2] - site.at, axis=1).max() == pytest.approx(radius)
        segments = math.ceil(2.0 * math.pi * radius / size)
        polygon = 0.5 * segments * radius**2 * math.sin(2.0 * math.pi / segments)
        assert cell_measures(mesh.points, held).sum() == pytest.approx(height * polygon, rel=2e-3)
    # two ends and two sides of the middle reach from the rims: what is left of the strip is flexible
    free = thickness * (Centreline(points).length - 4.0 * radius)
    assert cell_measures(mesh.points, mesh.cells_of(FREE)).sum() == pytest.approx(height * free, rel=0.02)


@pytest.mark.parametrize("ratio", [0.5, 1.0])
def test_pins_no_wider_than_the_strip_round_its_ends(ratio):
    exact = 3.0 * Centreline(BENT).length + math.pi * 1.5**2
    sites = pins(BENT[0], BENT[-1], radius=ratio * 1.5)
    mesh = mesh_link("bow", strip(BENT, thickness=3.0, depth=5.0), sites, dim=2, size=0.4)
    assert area(mesh) == pytest.approx(exact, rel=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0.6, 3.0])
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("points", [STRAIGHT, BENT, WAVY])
def test_pins_of_any_width_at_the_ends_and_along_the_way_give_well_shaped_cells(points, ratio, size):
    sites = pins(points[0], on_curve(points, 0.5), points[-1], radius=ratio * 1.5)
    mesh = mesh_link("link", strip(points, thickness=3.0, depth=20.0), sites, dim=2, size=size)
    assert radius_ratios(mesh.points, mesh.cells).min() > 0.15
    assert set(mesh.interface) == {FREE, 0, 1, 2}


@pytest.mark.parametrize("points", [STRAIGHT, BENT])
@pytest.mark.parametrize("thickness, depth, radius", [(3.0, 20.0, 3.0), (1.0, 20.0, 1.0), (6.0, 10.0, 1.5)])
def test_tetrahedra_of_typical_strips_are_well_shaped(points, thickness, depth, radius):
    sites = pins(points[0], points[-1], radius=radius)
    mesh = mesh_link("link", strip(points, thickness=thickness, depth=depth), sites, dim=3, size=1.5)
    assert radius_ratios(mesh.points, mesh.cells).min() > 0.2


@pytest.mark.parametrize("offset", [0.02, 0.6, 1.2])
def test_a_pin_near_an_end_still_gets_its_eye(offset):
    mesh = mesh_link(
        "bar", strip(STRAIGHT, thickness=3.0, depth=5.0), pins((offset, 0.0), radius=1.2), dim=2, size=0.75
    )
    assert mesh.points[:, 0].min() == pytest.approx(offset - 1.5, abs=0.02)


def test_a_pin_beside_the_centreline_bulges_to_its_side():
    site = pins((20.0, 1.0), radius=2.0)
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=3.0, depth=5.0), site, dim=2, size=0.75)
    assert mesh.points[:, 1].max() == pytest.approx(3.0, abs=0.1)
    assert mesh.points[:, 1].min() == pytest.approx(-1.5, abs=1e-9)


def test_a_rectangle_holds_its_part_of_the_strip_and_adds_nothing():
    sites = [InterfaceSite((0.0, 0.0), Rectangle(8.0, 10.0), name="clamp")]
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=3.0, depth=5.0), sites, dim=2, size=1.0)
    measures = cell_measures(mesh.points, mesh.cells)
    assert measures.sum() == pytest.approx(120.0, rel=1e-10)
    assert measures[mesh.interface == 0].sum() == pytest.approx(12.0, rel=1e-9)
    assert mesh.points[np.unique(mesh.cells_of(0)), 0].max() == pytest.approx(4.0, rel=1e-9)


def test_a_rectangle_turns_with_its_angle():
    sites = [InterfaceSite((20.0, 0.0), Rectangle(10.0, 2.0, 0.5 * math.pi), name="clamp")]
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=3.0, depth=5.0), sites, dim=2, size=1.0)
    held = mesh.points[np.unique(mesh.cells_of(0))]
    assert np.ptp(held, axis=0) == pytest.approx((2.0, 3.0), rel=1e-9)


@pytest.mark.parametrize("thickness", [1.0, 3.0, 9.0])
@pytest.mark.parametrize("size", [0.75, 1.5])
def test_edges_along_the_sides_have_the_requested_size(thickness, size):
    mesh = mesh_link("bar", strip(STRAIGHT, thickness=thickness, depth=5.0), dim=2, size=size)
    top = np.sort(mesh.points[np.isclose(mesh.points[:, 1], 0.5 * thickness), 0])
    assert np.diff(top) == pytest.approx(size, rel=0.05)
    edges = np.linalg.norm(mesh.points[mesh.cells] - mesh.points[np.roll(mesh.cells, 1, axis=1)], axis=2)
    assert edges.max() < 1.7 * max(size, min(thickness, size))


def test_half_the_size_gives_about_four_times_the_cells():
    bow = strip(BENT, thickness=6.0, depth=5.0)
    coarse, fine = (len(mesh_link("bow", bow, dim=2, size=size).cells) for size in (1.5, 0.75))
    assert 3.3 < fine / coarse < 4.7


@pytest.mark.parametrize("dim", [2, 3])
def test_the_same_input_gives_the_same_arrays(dim):
    sites = pins(BENT[0], BENT[-1], radius=3.0)
    one, other = (mesh_link("bow", strip(BENT, thickness=3.0, depth=20.0), sites, dim=dim, size=1.5) for _ in range(2))
    assert np.array_equal(one.points, other.points)
    assert np.array_equal(one.cells, other.cells)
    assert np.array_equal(one.interface, other.interface)


@pytest.mark.parametrize("unit", [1e-3, 1e3, 0.0254])
@pytest.mark.parametrize("points", [STRAIGHT, BENT])
def test_the_unit_of_length_does_not_matter(points, unit):
    def mesh(scale):
        places = [tuple(scale * c for c in p) for p in points]
        sites = pins(places[0], places[-1], radius=3.0 * scale)
        link = strip(places, thickness=3.0 * scale, depth=20.0 * scale)
        return mesh_link("link", link, sites, dim=3, size=1.5 * scale)

    one, other = mesh(1.0), mesh(unit)
    assert np.array_equal(one.cells, other.cells)
    assert np.allclose(other.points / unit, one.points, rtol=0, atol=1e-8)
