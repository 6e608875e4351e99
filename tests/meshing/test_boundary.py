"""The boundary of a plane mesh: closed polygons with the link to their left."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import step_file
from fenicsmech.meshing import CurvedEdges, LinkMesh, boundary_loops, cell_measures, mesh_link

from .bent_links import link

PART = Path(__file__).parents[2] / "meshes" / "curved_link.step"


def area(polygon):
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def edges_of(loops):
    return {edge for loop in loops for edge in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)}


def triangles(points, cells):
    return LinkMesh(np.array(points, dtype=float), np.array(cells), np.full(len(cells), -1), CurvedEdges.none(2))


def test_a_part_with_two_holes_has_three_loops_and_their_areas_add_up():
    mesh = mesh_link("part", step_file(PART, depth=10.0), dim=2, size=1.0)
    loops = boundary_loops("part", mesh)
    areas = [area(mesh.points[loop]) for loop in loops]
    assert areas[0] > 0.0 and max(areas[1:]) < 0.0 and len(loops) == 3
    assert areas[1:] == pytest.approx([-np.pi * 1.5**2] * 2, rel=0.1)
    assert sum(areas) == pytest.approx(cell_measures(mesh.points, mesh.cells).sum(), rel=1e-12)


def test_loops_run_through_every_edge_of_a_single_triangle_once():
    mesh = link(2.0)
    directed = [tuple(cell[[k, (k + 1) % 3]].tolist()) for cell in mesh.cells for k in range(3)]
    assert edges_of(boundary_loops("strip", mesh)) == {(a, b) for a, b in directed if (b, a) not in directed}


def test_turned_over_triangles_are_refused():
    mesh = link(2.0)
    points = mesh.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), np.concatenate(boundary_loops("strip", mesh)))[0]
    points[inner] += 5.0
    with pytest.raises(MeshingError, match=r"link 'crank': triangles are turned over or lie on others: \d+ of \d+"):
        boundary_loops("link 'crank'", replace(mesh, points=points))
    # the same mesh, its triangles turned back one by one: they lie on each other
    with pytest.raises(MeshingError, match="turned over or lie on others"):
        boundary_loops("link 'crank'", LinkMesh.from_cells(points, mesh.cells, mesh.interface))


def test_pieces_and_points_of_contact_are_refused():
    apart = triangles([(0, 0), (1, 0), (0, 1), (2, 0), (3, 0), (2, 1)], [(0, 1, 2), (3, 4, 5)])
    with pytest.raises(MeshingError, match="falls into 2 separate pieces"):
        boundary_loops("link", apart)
    touching = triangles([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)], [(0, 1, 2), (0, 3, 4)])
    with pytest.raises(MeshingError, match=r"touches itself in the single point \(0, 0\)"):
        boundary_loops("link", touching)
