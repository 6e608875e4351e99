"""Domains of the weights: plans of extruded links, handles as vertices, linear elements."""

import numpy as np
import pytest

from fenicsmech.design import insert, lumped_mass, pierced, stiffness
from fenicsmech.meshing import FREE, cell_measures, plan_of

from .shapes import DEPTH, strip_mesh

TILTED = (0.0, 0.02, 1.0)
MESHES = {"plane": (2, (0, 0, 1)), "extruded": (3, (0, 0, 1)), "solid": (3, TILTED)}


@pytest.fixture(params=MESHES, scope="module")
def mesh(request):
    dim, axis = MESHES[request.param]
    return strip_mesh(0, dim, axis=axis)


def test_plan_of_an_extruded_link_is_its_planar_mesh():
    link, flat = strip_mesh(0, 3), strip_mesh(0, 2)
    plan = plan_of(link)
    assert plan.mesh.points[plan.column] == pytest.approx(link.points[:, :2])
    assert (len(plan.mesh.points), len(plan.mesh.cells)) == (len(flat.points), len(flat.cells))
    area = cell_measures(plan.mesh.points, plan.mesh.cells)
    assert area.min() > 0.0
    assert DEPTH * area.sum() == pytest.approx(cell_measures(link.points, link.cells).sum())
    for site in range(2):
        held = np.isin(plan.column, plan.mesh.cells_of(site))
        assert set(np.flatnonzero(held)) == set(link.cells_of(site).ravel())


def test_solids_and_planar_links_are_their_own_plans():
    for mesh in (strip_mesh(0, 3, axis=TILTED), strip_mesh(0, 2)):
        assert plan_of(mesh).mesh is mesh


def test_vertical_line_runs_through_the_whole_depth(mesh):
    at = np.array([20.0, 9.0])
    cells, points = pierced(mesh, at)
    assert points[:, :2] == pytest.approx(np.tile(at, (len(cells), 1)))
    if mesh.dim == 2:
        assert len(cells) == 1
    else:
        assert np.ptp(points[:, 2]) > 0.5 * DEPTH
    assert len(pierced(mesh, np.array([20.0, 30.0]))[0]) == 0


@pytest.mark.parametrize("seed", range(5))
def test_inserted_points_are_vertices_of_a_mesh_of_the_same_link(mesh, seed):
    random = np.random.default_rng(seed)
    expanded, inserted = mesh, []
    for cell in random.choice(np.flatnonzero(mesh.interface == FREE), 3, replace=False):
        # near a corner, near an edge, anywhere
        weights = random.dirichlet(np.full(mesh.dim + 1, (0.1, 0.5, 2.0)[len(inserted)]))
        at = weights @ mesh.points[mesh.cells[cell]]
        expanded, vertex = insert(expanded, at)
        inserted.append((vertex, at))
    for vertex, at in inserted[-1:]:
        assert expanded.points[vertex] == pytest.approx(at)
    volumes = [cell_measures(m.points, m.cells) for m in (mesh, expanded)]
    assert volumes[1].min() > 0.0
    assert volumes[1].sum() == pytest.approx(volumes[0].sum(), rel=0.01)
    for site in range(2):
        assert np.array_equal(np.sort(expanded.cells_of(site), axis=0), np.sort(mesh.cells_of(site), axis=0))


def test_a_point_on_an_edge_splits_the_cells_on_both_sides():
    mesh = strip_mesh(0, 2)
    free = mesh.cells[mesh.interface == FREE]
    edges = np.sort(np.concatenate([free[:, [0, 1]], free[:, [1, 2]], free[:, [2, 0]]]), axis=1)
    shared, count = np.unique(edges, axis=0, return_counts=True)
    expanded, _ = insert(mesh, mesh.points[shared[count == 2][0]].mean(axis=0))
    assert len(expanded.cells) == len(mesh.cells) + 2
    volumes = [cell_measures(m.points, m.cells).sum() for m in (mesh, expanded)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-12)


def test_stiffness_and_mass_are_exact_for_linear_fields(mesh):
    volume = cell_measures(mesh.points, mesh.cells).sum()
    slope = np.arange(1.0, mesh.dim + 1)
    field = mesh.points @ slope + 4.0
    assert field @ stiffness(mesh) @ field == pytest.approx(slope @ slope * volume)
    assert field @ stiffness(mesh, axis=1) @ field == pytest.approx(slope[1] ** 2 * volume)
    centroids = mesh.points[mesh.cells].mean(axis=1) @ slope + 4.0
    assert lumped_mass(mesh) @ field == pytest.approx(centroids @ cell_measures(mesh.points, mesh.cells))
