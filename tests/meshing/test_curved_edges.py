"""Curved edges: cells cover what is drawn, in the plane, through the depth and on several ranks, and never fold."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.mechanism import Arc, Disc, Line, outline, strip
from fenicsmech.meshing import CurvedEdges, InterfaceSite, LinkMesh, cell_measures, extrude, mesh_link

from ..plot.grids import box, rectangle
from .curved_measure import least_jacobian, measure

LENGTH, THICKNESS, DEPTH = 20.0, 4.0, 3.0
INNER, OUTER = 4.0, 7.0
HALF_RING = outline(
    (OUTER, 0.0), [Arc((0.0, OUTER), (-OUTER, 0.0)), Line((-INNER, 0.0)), Arc((0.0, INNER), (INNER, 0.0))], depth=DEPTH
)


def disc_ended(size: float) -> LinkMesh:
    """A straight strip whose pins round its ends."""
    ends = (0.0, 0.0), (LENGTH, 0.0)
    pins = [InterfaceSite(at, Disc(0.5 * THICKNESS), name=f"pin {k}") for k, at in enumerate(ends)]
    return mesh_link("bar", strip(ends, thickness=THICKNESS, depth=DEPTH), pins, dim=2, size=size)


def half_ring(size: float) -> LinkMesh:
    return mesh_link("ring", HALF_RING, dim=2, size=size)


EXACT = {
    disc_ended: LENGTH * THICKNESS + math.pi * (0.5 * THICKNESS) ** 2,
    half_ring: 0.5 * math.pi * (OUTER**2 - INNER**2),
}


@pytest.mark.parametrize("link", EXACT)
def test_area_converges_with_the_fourth_power_of_the_length_of_edges_and_misses_far_less_than_polygons(link):
    def errors(mesh):
        areas = np.array([cell_measures(mesh.points, mesh.cells).sum(), measure(mesh)])
        return np.abs(areas / EXACT[link] - 1.0)

    meshes = [link(size) for size in (0.6, 0.15)]  # where concave arcs ask for no smaller elements
    coarse, fine = map(errors, meshes)
    assert coarse[1] < 2e-4 and coarse[1] < 0.01 * coarse[0]
    polygons, curved = np.log(coarse / fine) / np.log(len(meshes[1].curved.ends) / len(meshes[0].curved.ends))
    # polygons miss h² on the outer side and gain it on the inner one, which may cancel
    assert polygons < 3.0 < 3.5 < curved


def test_a_straight_outline_has_no_curved_edge():
    mesh = mesh_link("bar", strip([(0.0, 0.0), (LENGTH, 0.0)], thickness=THICKNESS, depth=DEPTH), dim=2, size=2.0)
    assert len(mesh.curved.ends) == 0
    assert measure(mesh) == pytest.approx(LENGTH * THICKNESS, rel=1e-12)


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("part, half", [(1.0, False), (0.5, True)])
def test_walls_of_an_extruded_link_bulge_like_its_plan(part, half, layers):
    plan = half_ring(2.0)
    solid = extrude(plan, DEPTH, layers, half=half)
    assert measure(solid) == pytest.approx(part * DEPTH * measure(plan), rel=1e-12)
    assert not solid.curved.bulges[:, 2].any()
    assert set(map(tuple, solid.curved.bulges[:, :2])) == set(map(tuple, plan.curved.bulges))


def test_a_solid_with_a_pin_across_follows_its_outline():
    # not extruded: meshed as a solid because of the pin's axis
    pin = InterfaceSite((0.5 * (INNER + OUTER), 0.5, 0.0), Disc(0.5), axis=(1.0, 0.0, 0.0), name="pin")
    mesh = mesh_link("ring", HALF_RING, [pin], dim=3, size=2.0)
    exact = DEPTH * EXACT[half_ring]
    polygonal = cell_measures(mesh.points, mesh.cells).sum()
    assert abs(measure(mesh) / exact - 1.0) < min(1e-3, 0.1 * abs(polygonal / exact - 1.0))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("cells, dim", [([[0, 1, 2]], 2), ([[0, 1, 2, 3]], 3)])
def test_bulges_of_cells_are_those_of_their_pairs_of_corners_however_numbered(cells, dim, turned):
    cells = np.array(cells)[:, :: -1 if turned else 1]
    edges = CurvedEdges(np.array([[0, 2], [1, 2]]), np.array([[0.1, 0.0, 0.3], [0.0, 0.2, 0.0]])[:, :dim])
    pairs = [(a, b) for k, a in enumerate(cells[0]) for b in cells[0][k + 1 :]]
    known = {(0, 2): edges.bulges[0], (1, 2): edges.bulges[1]}
    expected = [known.get((min(pair), max(pair)), np.zeros(dim)) for pair in pairs]
    assert np.array_equal(edges.of_cells(cells)[0], expected)


@pytest.mark.parametrize("dim", [2, 3])
def test_bulges_of_no_cells_are_an_empty_array(dim):
    edges = CurvedEdges(np.array([[0, 2], [1, 2]]), np.ones((2, dim)))
    assert edges.of_cells(np.zeros((0, dim + 1), dtype=np.int32)).shape == (0, dim * (dim + 1) // 2, dim)


def test_renumbered_edges_keep_their_bulges_and_lose_those_without_an_end():
    edges = CurvedEdges(np.array([[0, 1], [1, 2], [2, 3]]), np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]))
    renumbered = edges.renumbered(np.array([7, 4, 5, -1]))
    assert renumbered.ends.tolist() == [[4, 7], [4, 5]]
    assert renumbered.bulges[:, 0].tolist() == [1.0, 2.0]


def test_edges_through_points_on_their_chords_are_straight():
    points = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])
    ends = np.array([[1, 0], [1, 2], [0, 1]])
    edges = CurvedEdges.through(points, ends, np.array([(1.0, -0.1), (2.0, 1.0), (1.0, -0.1)]))
    assert edges.ends.tolist() == [[0, 1]]
    assert edges.bulges == pytest.approx(np.array([[0.0, -0.1]]), abs=1e-15)


def crowded_cells(dim: int, part: float) -> tuple[np.ndarray, np.ndarray, CurvedEdges]:
    """A grid all of whose edges bulge anywhere by up to a ``part`` of the side of its squares."""
    points, cells = rectangle(3, 2, 3.0, 2.0) if dim == 2 else box(2, 1, 1, (2.0, 1.0, 1.0))
    turned = cell_measures(points, cells) < 0.0
    cells[turned, -2:] = cells[turned, :-3:-1]
    ends = np.unique(np.sort(np.vstack([cells[:, [i, j]] for i in range(dim + 1) for j in range(i)]), axis=1), axis=0)
    return points, cells, CurvedEdges(ends, np.random.default_rng(4).uniform(-part, part, (len(ends), dim)))


@pytest.mark.parametrize("dim", [2, 3])
def test_limited_edges_turn_no_cell_inside_out(dim):
    points, cells, edges = crowded_cells(dim, 0.5)
    assert least_jacobian(points, cells, edges) < 0.0
    limited = edges.limited(points, cells)
    assert least_jacobian(points, cells, limited) > 0.1
    assert np.linalg.norm(limited.bulges) > 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_edges_that_squeeze_no_cell_too_much_are_left_alone(dim):
    points, cells, edges = crowded_cells(dim, 0.02)
    assert np.array_equal(edges.limited(points, cells).bulges, edges.bulges)


@pytest.mark.parametrize("size", [0.5, 1.5, 4.0])
@pytest.mark.parametrize("radius", [1.0, 1.5, 2.4])
def test_no_cell_of_a_meshed_link_is_inside_out(radius, size):
    points = ((0.0, 0.0), (8.0, 6.0), (16.0, 0.0))
    pins = [InterfaceSite(at, Disc(radius), name="pin") for at in (points[0], points[-1])]
    mesh = mesh_link("bow", strip(points, thickness=3.0, depth=2.0), pins, dim=2, size=size)
    assert len(mesh.curved.ends) > 0
    assert least_jacobian(mesh.points, mesh.cells, mesh.curved, steps=4) > 0.1


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_measure_is_the_same_on_any_number_of_ranks(dim):
    plan = half_ring(2.0)
    mesh = plan if dim == 2 else extrude(plan, DEPTH, 1)
    assert measure(mesh, MPI.COMM_WORLD) == pytest.approx(measure(mesh), rel=1e-13)
