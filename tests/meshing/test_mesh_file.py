"""Links read from gmsh mesh files, and the committed files themselves."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.mechanism import Disc, gmsh_mesh, step_file, strip
from fenicsmech.meshing import InterfaceSite, LinkMesh, cell_measures, mesh_link, plan_size

MESHES = Path(__file__).parents[2] / "meshes"
SITES = [InterfaceSite(at, Disc(3.0), name=f"pin at {at}") for at in ((0.0, 0.0), (60.0, 0.0))]
SECOND_ORDER = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
9
1 0 0 2
2 4 0 2
3 4 4 2
4 0 4 2
5 2 0 2
6 4 2 2
7 2 2 2
8 2 4 2
9 0 2 2
$EndNodes
$Elements
3
1 15 2 0 1 1
2 9 2 0 1 1 2 3 5 6 7
3 9 2 0 1 1 4 3 9 8 7
$EndElements
"""


@pytest.mark.parametrize("dim, file, size", [(2, "strip2d.msh", 1.5), (3, "strip3d.msh", 2.0)])
def test_a_saved_mesh_comes_back_with_its_cells_and_interfaces(dim, file, size):
    saved = mesh_link("strip", strip([(0, 0), (60, 0)], thickness=3, depth=10), SITES, dim=dim, size=size)
    read = mesh_link("strip", gmsh_mesh(MESHES / file, depth=10.0), SITES, dim=dim, size=size)
    assert isinstance(read, LinkMesh) and read.dim == dim
    for site in (-1, 0, 1):
        one, other = (cell_measures(mesh.points, mesh.cells_of(site)).sum() for mesh in (saved, read))
        assert other == pytest.approx(one, rel=1e-2)


def test_cells_partly_in_a_region_stay_free():
    sites = [InterfaceSite((0.0, 0.0), Disc(2.0), name="pin")]
    mesh = mesh_link("strip", gmsh_mesh(MESHES / "strip2d.msh", depth=10.0), sites, dim=2, size=1.5)
    assert np.linalg.norm(mesh.points[mesh.cells_of(0)], axis=2).max() <= 2.0
    corners = np.linalg.norm(mesh.points[mesh.cells_of(-1)], axis=2)
    assert np.all(corners.max(axis=1) > 2.0)


def test_curved_cells_are_read_by_their_corners_and_turned_to_positive_area(tmp_path):
    path = tmp_path / "square.msh"
    path.write_text(SECOND_ORDER)
    mesh = mesh_link("square", gmsh_mesh(path, depth=1.0), dim=2, size=4.0)
    assert cell_measures(mesh.points, mesh.cells) == pytest.approx([8.0, 8.0])
    assert mesh.points.shape == (4, 2)


@pytest.mark.parametrize("dim, file, size", [(2, "strip2d.msh", 1.5), (3, "strip3d.msh", 2.0)])
def test_elements_of_a_mesh_file_are_counted_before_it_is_a_link(dim, file, size):
    shape = gmsh_mesh(MESHES / file, depth=10.0)
    assert plan_size(shape, "strip") == (0.0, len(mesh_link("strip", shape, SITES, dim=dim, size=size).cells))


def test_area_of_a_step_file_is_known_before_it_is_meshed():
    shape = step_file(MESHES / "diagonal.step", depth=20.0)
    area, given = plan_size(shape, "diagonal")
    mesh = mesh_link("diagonal", shape, dim=2, size=3.0)
    assert area == pytest.approx(cell_measures(mesh.points, mesh.cells).sum(), rel=0.01) and not given


FILES = ["curved_link.step", "diagonal.step", "strip2d.msh", "strip3d.msh"]


def test_the_committed_files_are_small_and_made_by_their_script(tmp_path):
    runpy.run_path(str(MESHES / "generate.py"))["generate"](tmp_path)
    for name in FILES:
        assert (MESHES / name).stat().st_size < 200_000
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES
    assert "2000-01-01T00:00:00" in (tmp_path / "curved_link.step").read_text()
    for dim, file in ((2, "strip2d.msh"), (3, "strip3d.msh")):
        mesh = mesh_link("strip", gmsh_mesh(tmp_path / file, depth=10.0), SITES, dim=dim, size=1.5)
        assert cell_measures(mesh.points, mesh.cells).sum() == pytest.approx(
            (180.0 + 2.0 * (math.pi * 9.0 - 8.609)) * (10.0 if dim == 3 else 1.0), rel=0.02
        )
