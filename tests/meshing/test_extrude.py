"""Extrusion fills the prism with conforming tetrahedra of positive volume."""

from itertools import combinations

import numpy as np
import pytest

from fenicsmech.mechanism import Disc, strip
from fenicsmech.meshing import InterfaceSite, cell_measures, extrude, mesh_link

BOW = strip([(0.0, 0.0), (10.0, 4.0), (22.0, 3.0)], thickness=2.0, depth=7.0)
SITES = [InterfaceSite((0.0, 0.0), Disc(2.0), name="pin")]


@pytest.fixture(scope="module")
def plan():
    return mesh_link("bow", BOW, SITES, dim=2, size=1.0)


@pytest.mark.parametrize("layers", [1, 2, 3])
def test_volume_is_area_times_depth(plan, layers):
    mesh = extrude(plan, 7.0, layers)
    volumes = cell_measures(mesh.points, mesh.cells)
    assert np.all(volumes > 0.0)
    assert volumes.sum() == pytest.approx(7.0 * cell_measures(plan.points, plan.cells).sum(), rel=1e-13)
    assert len(mesh.cells) == 3 * layers * len(plan.cells)


@pytest.mark.parametrize("layers", [1, 2, 3])
def test_every_face_belongs_to_two_cells_or_lies_on_the_surface(plan, layers):
    mesh = extrude(plan, 7.0, layers)
    faces = np.sort(np.concatenate([mesh.cells[:, list(kept)] for kept in combinations(range(4), 3)]), axis=1)
    _, counts = np.unique(faces, axis=0, return_counts=True)
    edges = np.sort(np.concatenate([plan.cells[:, list(kept)] for kept in combinations(range(3), 2)]), axis=1)
    _, edge_counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) <= {1, 2}
    # top and bottom, and two triangles per layer on each outer edge
    assert np.sum(counts == 1) == 2 * len(plan.cells) + 2 * layers * np.sum(edge_counts == 1)


def test_an_even_number_of_layers_is_symmetric_about_the_middle_plane(plan):
    mesh = extrude(plan, 7.0, 4)

    def keys(points):
        corners = np.round(points[mesh.cells], 9) + 0.0  # no negative zeros
        return {frozenset(map(tuple, cell)) for cell in corners}

    assert keys(mesh.points) == keys(mesh.points * (1.0, 1.0, -1.0))


def cells_at(mesh) -> set:
    """The cells by the places of their corners."""
    corners = np.round(mesh.points[mesh.cells], 9) + 0.0  # no negative zeros
    return {frozenset(map(tuple, cell)) for cell in corners}


@pytest.mark.parametrize("layers", [1, 2])
def test_half_is_what_the_whole_of_twice_as_many_layers_has_above_its_middle_plane(plan, layers):
    whole, half = extrude(plan, 7.0, 2 * layers), extrude(plan, 7.0, layers, half=True)
    assert cells_at(half) == {cell for cell in cells_at(whole) if all(z >= 0.0 for *_, z in cell)}
    assert 2 * len(half.cells) == len(whole.cells)
    assert np.all(cell_measures(half.points, half.cells) > 0.0)
    assert cell_measures(half.points, half.cells_of(0)).sum() * 2.0 == pytest.approx(
        cell_measures(whole.points, whole.cells_of(0)).sum(), rel=1e-13
    )


def test_half_links_have_layers_as_high_as_whole_ones_and_at_least_one():
    for depth, layers in ((16.0, 4), (8.0, 2), (2.0, 1)):
        shape = strip(BOW.centreline, thickness=2.0, depth=depth)
        mesh = mesh_link("bow", shape, SITES, dim=3, size=1.0, half=True)
        assert np.unique(mesh.points[:, 2]) == pytest.approx(np.linspace(0.0, 0.5 * depth, layers + 1), abs=1e-12)


def test_interfaces_pass_through_the_depth(plan):
    mesh = extrude(plan, 7.0, 2)
    plan_area = cell_measures(plan.points, plan.cells_of(0)).sum()
    assert cell_measures(mesh.points, mesh.cells_of(0)).sum() == pytest.approx(7.0 * plan_area, rel=1e-13)


def test_plane_and_spatial_models_share_the_plan_view(plan):
    mesh = mesh_link("bow", BOW, SITES, dim=3, size=1.0, layers=2)
    assert set(map(tuple, mesh.points[:, :2])) == set(map(tuple, plan.points))
    assert set(mesh.points[:, 2]) == {-3.5, 0.0, 3.5}


@pytest.mark.parametrize("depth, size, layers", [(20.0, 1.5, 7), (10.0, 1.5, 3), (1.0, 1.5, 1)])
def test_layers_are_about_two_sizes_high(depth, size, layers):
    bar = strip([(0.0, 0.0), (10.0, 0.0)], thickness=2.0, depth=depth)
    heights = np.unique(mesh_link("bar", bar, dim=3, size=size).points[:, 2])
    assert heights == pytest.approx(np.linspace(-0.5 * depth, 0.5 * depth, layers + 1), abs=1e-12)
