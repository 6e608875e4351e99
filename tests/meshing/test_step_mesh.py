"""STEP parts: the solid in space, its section in the plane."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Disc, step_file
from fenicsmech.meshing import InterfaceSite, cell_measures, gmsh, gmsh_session, mesh_link, radius_ratios

PART = Path(__file__).parents[2] / "meshes" / "curved_link.step"
SITES = [InterfaceSite(at, Disc(3.0), name=f"pin at {at}") for at in ((0.0, 0.0), (60.0, 0.0))]
# a band 3 wide on an arc of radius 50 that spans 60; around its ends eyes of radius 4 with holes of radius 1.5
BAND = 3.0 * 50.0 * 2.0 * math.asin(0.6)
EYE = math.pi * (4.0**2 - 1.5**2)


def shared_area():
    """Area common to an eye and the band: at the radius ρ the angle φ with |ρ e^{iφ} − 50| = 4."""
    return quad(lambda rho: rho * math.acos((50.0**2 + rho**2 - 16.0) / (100.0 * rho)), 48.5, 51.5)[0]


PLAN_AREA = BAND + 2.0 * (EYE - shared_area())


@pytest.mark.parametrize("section", [-5.0, 0.0, 3.3, 5.0])
def test_a_section_has_the_area_of_the_part_even_in_its_faces(section):
    mesh = mesh_link("part", step_file(PART, depth=10.0, section=section), SITES, dim=2, size=0.8)
    measures = cell_measures(mesh.points, mesh.cells)
    assert mesh.dim == 2 and np.all(measures > 0.0)
    assert measures.sum() == pytest.approx(PLAN_AREA, rel=4e-3)
    assert radius_ratios(mesh.points, mesh.cells).min() > 0.3


def test_the_solid_has_its_volume():
    mesh = mesh_link("part", step_file(PART, depth=10.0), SITES, dim=3, size=1.5)
    volumes = cell_measures(mesh.points, mesh.cells)
    assert mesh.dim == 3 and np.all(volumes > 0.0)
    assert volumes.sum() == pytest.approx(10.0 * PLAN_AREA, rel=1e-2)
    assert np.ptp(mesh.points[:, 2]) == pytest.approx(10.0)
    assert radius_ratios(mesh.points, mesh.cells).min() > 0.1


@pytest.mark.parametrize("height", [0.0, 7.3])
def test_half_of_the_solid_stands_on_its_mid_plane_wherever_it_was_drawn(height, tmp_path):
    with gmsh_session("moved part"):
        gmsh.model.occ.importShapes(str(PART))
        gmsh.model.occ.translate(gmsh.model.occ.getEntities(3), 0.0, 0.0, height)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "moved.step"))
    mesh = mesh_link("part", step_file(tmp_path / "moved.step", depth=10.0), SITES, dim=3, size=1.5, half=True)
    volumes = cell_measures(mesh.points, mesh.cells)
    assert np.all(volumes > 0.0)
    assert volumes.sum() == pytest.approx(5.0 * PLAN_AREA, rel=1e-2)
    heights = mesh.points[:, 2]
    assert heights.max() == pytest.approx(5.0, rel=1e-6)
    assert np.sum(heights == 0.0) > 100 and heights[heights != 0.0].min() > 0.05
    assert set(mesh.interface) == {-1, 0, 1}


@pytest.mark.parametrize("radius", [1.0, 0.1])
def test_a_solid_with_a_boss_or_a_bump_on_one_side_has_no_half(radius, tmp_path):
    with gmsh_session("boss"):
        occ = gmsh.model.occ
        plate = occ.addBox(0.0, 0.0, 0.0, 20.0, 4.0, 4.0)
        boss = occ.addCylinder(5.0, 2.0, 4.0, 0.0, 0.0, radius, radius)
        occ.fuse([(3, plate)], [(3, boss)])
        occ.synchronize()
        gmsh.write(str(tmp_path / "boss.step"))
    with pytest.raises(DescriptionError, match="not symmetric"):
        mesh_link("plate", step_file(tmp_path / "boss.step", depth=4.0), dim=3, size=2.0, half=True)


def test_the_element_size_is_met_in_the_solid():
    mesh = mesh_link("part", step_file(PART, depth=10.0), dim=3, size=2.0)
    edges = np.linalg.norm(mesh.points[mesh.cells] - mesh.points[np.roll(mesh.cells, 1, axis=1)], axis=2)
    beyond = np.abs(mesh.points[mesh.cells].mean(axis=1)[:, 0] - 30.0) < 20.0  # away from the holes, which refine it
    assert 1.4 < np.median(edges[beyond]) < 2.4
    assert np.median(edges) < 0.7


@pytest.mark.parametrize("dim", [2, 3])
def test_the_same_part_gives_the_same_arrays(dim):
    one, other = (mesh_link("part", step_file(PART, depth=10.0), SITES, dim=dim, size=2.0) for _ in range(2))
    assert np.array_equal(one.points, other.points) and np.array_equal(one.cells, other.cells)
    assert np.array_equal(one.interface, other.interface)


@pytest.mark.thorough
def test_a_fillet_of_a_shaft_has_elements_by_its_radius_and_the_rest_those_asked_for(tmp_path):
    corners = [(-8, 0), (8, 0), (8, 3), (0, 3), (0, 2.5), (-0.5, 2), (-8, 2)]
    with gmsh_session("shaft"):
        occ = gmsh.model.occ
        points, centre = [occ.addPoint(x, y, 0.0) for x, y in corners], occ.addPoint(-0.5, 2.5, 0.0)
        pairs = list(zip(points, [*points[1:], points[0]], strict=True))
        edges = [occ.addCircleArc(a, centre, b) if k == 4 else occ.addLine(a, b) for k, (a, b) in enumerate(pairs)]
        face = occ.addPlaneSurface([occ.addCurveLoop(edges)])
        occ.revolve([(2, face)], 0, 0, 0, 1, 0, 0, 2.0 * math.pi)
        occ.remove([(2, face)])
        occ.synchronize()
        gmsh.write(str(tmp_path / "shaft.step"))
    mesh = mesh_link("shaft", step_file(tmp_path / "shaft.step", depth=6.0), dim=3, size=2.0)
    edges = np.linalg.norm(mesh.points[mesh.cells] - mesh.points[np.roll(mesh.cells, 1, axis=1)], axis=2)
    middle = mesh.points[mesh.cells].mean(axis=1)
    radius = np.hypot(middle[:, 1], middle[:, 2])
    at_fillet = np.hypot(middle[:, 0] + 0.5, radius - 2.5) < 0.6
    assert np.median(edges[at_fillet]) < 2.0 * 2.0 * math.pi * 0.5 / 40
    assert np.median(edges[np.abs(middle[:, 0]) > 5.0]) > 1.0
