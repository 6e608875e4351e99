"""Exported links: closed, of the right size, and read back as written."""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.export import PinHole, write_step, write_stl
from fenicsmech.mechanism import step_file
from fenicsmech.meshing import boundary_loops, cell_measures, gmsh, gmsh_session, mesh_link

from ..meshing.bent_links import CURVED, DEPTH, LENGTH, RADIUS, STRAIGHT, THICKNESS, bent, bent_point, link

PART = Path(__file__).parents[2] / "meshes" / "curved_link.step"
PART_DEPTH = 10.0
PINS = (PinHole(CURVED[0], RADIUS), PinHole(CURVED[-1], RADIUS))
BENT_PINS = (PinHole(bent_point(0.0), RADIUS), PinHole(bent_point(LENGTH), RADIUS))

# a link, and the holes of its pins
LINKS = {
    "curved": (lambda size, dim: link(size, dim=dim), PINS),
    "bent": (lambda size, dim: bent(link(size, dim=dim, points=STRAIGHT)), BENT_PINS),
    "part with holes": (lambda size, dim: mesh_link("part", step_file(PART, depth=DEPTH), dim=2, size=size), ()),
}
each_link = pytest.mark.parametrize("name", LINKS)
# the part is meshed in the plane alone
each_mesh = pytest.mark.parametrize(
    ("name", "dim"), [("curved", 2), ("curved", 3), ("bent", 2), ("bent", 3), ("part with holes", 2)]
)


@cache
def part_in_space():
    """A mesh without layers."""
    return mesh_link("part", step_file(PART, depth=PART_DEPTH), dim=3, size=3.0)


def measures(path):
    """Volume, lowest and highest corner of the one solid in a STEP file."""
    points = []
    with gmsh_session("again"):
        entities = gmsh.model.occ.importShapes(str(path), highestDimOnly=False)
        gmsh.model.occ.synchronize()
        assert [dim for dim, _ in entities].count(3) == 1
        volume = gmsh.model.occ.getMass(*next(entity for entity in entities if entity[0] == 3))
        for _, curve in gmsh.model.getEntities(1):
            (first,), (last,) = gmsh.model.getParametrizationBounds(1, curve)
            points.append(np.reshape(gmsh.model.getValue(1, curve, np.linspace(first, last, 200)), (-1, 3)))
    points = np.concatenate(points)
    return volume, points.min(axis=0), points.max(axis=0)


def facets_of(path):
    """Normals (m, 3) and corners (m, 3, 3) of a binary STL file."""
    content = path.read_bytes()
    count = int.from_bytes(content[80:84], "little")
    assert len(content) == 84 + 50 * count and not content.startswith(b"solid")
    table = np.frombuffer(content, np.dtype([("n", "<f4", 3), ("x", "<f4", (3, 3)), ("a", "<u2")]), offset=84)
    return table["n"].astype(float), table["x"].astype(float)


def plan_area(mesh):
    return cell_measures(mesh.points, mesh.cells).sum() / (DEPTH if mesh.dim == 3 else 1.0)


def holes_area(pins):
    return sum(0.25 * np.pi * pin.diameter**2 for pin in pins)


@pytest.mark.thorough
@each_mesh
def test_the_solid_has_the_volume_and_the_extent_of_a_fine_mesh(name, dim, tmp_path):
    make, _ = LINKS[name]
    mesh = make(0.5, dim)
    write_step(tmp_path / "link.step", mesh, depth=DEPTH)
    volume, low, high = measures(tmp_path / "link.step")
    assert volume == pytest.approx(DEPTH * plan_area(mesh), rel=3e-3)
    flat = mesh.points[:, :2]
    extent = np.append(np.ptp(flat, axis=0), DEPTH)
    assert low == pytest.approx(np.append(flat.min(axis=0), -0.5 * DEPTH), abs=3e-3 * extent.max())
    assert high - low == pytest.approx(extent, rel=3e-3)


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "dim"), [("curved", 3), ("bent", 3), ("part with holes", 2)])
def test_the_solid_is_meshed_as_a_link(name, dim, tmp_path):
    write_step(tmp_path / "link.step", LINKS[name][0](1.5, 2), depth=DEPTH)
    mesh = mesh_link("again", step_file(tmp_path / "link.step", depth=DEPTH), dim=dim, size=2.0)
    _, low, high = measures(tmp_path / "link.step")
    low, extent = low[:dim], (high - low)[:dim]
    assert mesh.points.min(axis=0) == pytest.approx(low, abs=3e-3 * extent.max())
    assert np.ptp(mesh.points, axis=0) == pytest.approx(extent, rel=3e-3)


@pytest.mark.thorough
def test_a_solid_of_a_mesh_without_layers_is_the_one_that_was_meshed(tmp_path):
    write_step(tmp_path / "link.step", part_in_space(), depth=PART_DEPTH)
    (volume, *extent), (expected, *drawn) = measures(tmp_path / "link.step"), measures(PART)
    assert volume == pytest.approx(expected, rel=3e-3)
    assert extent[1] - extent[0] == pytest.approx(drawn[1] - drawn[0], rel=3e-3)


@pytest.mark.thorough
def test_the_solid_of_a_coarse_mesh_is_that_of_a_fine_one(tmp_path):
    volumes = []
    for size in (2.5, 0.4):
        write_step(tmp_path / "link.step", bent(link(size, points=STRAIGHT)), depth=DEPTH)
        volumes.append(measures(tmp_path / "link.step")[0])
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-3)


@each_link
def test_edges_of_the_solid_run_through_every_boundary_vertex(name, tmp_path):
    mesh = LINKS[name][0](1.73, 2)
    write_step(tmp_path / "link.step", mesh, depth=DEPTH)
    with gmsh_session("link"):
        gmsh.model.occ.importShapes(str(tmp_path / "link.step"))
        gmsh.model.occ.synchronize()
        curves = [tag for _, tag in gmsh.model.getEntities(1)]
        for vertex in mesh.points[np.concatenate(boundary_loops("link", mesh))]:
            at = [*vertex, 0.5 * DEPTH]
            nearest = min(np.linalg.norm(np.subtract(gmsh.model.getClosestPoint(1, c, at)[0], at)) for c in curves)
            assert nearest < 1e-6


@pytest.mark.thorough
@each_link
def test_pins_leave_holes(name, tmp_path):
    make, pins = LINKS[name]
    pins = pins or (PinHole((0.0, 0.0), 3.0), PinHole((60.0, 0.0), 4.0))  # the part has holes of diameter 3
    mesh = make(1.5, 2)
    write_step(tmp_path / "whole.step", mesh, depth=DEPTH)
    write_step(tmp_path / "drilled.step", mesh, depth=DEPTH, pins=pins)
    whole, drilled = (measures(tmp_path / f"{state}.step")[0] for state in ("whole", "drilled"))
    there = 2.0 * 0.25 * np.pi * 3.0**2 if name == "part with holes" else 0.0
    assert whole - drilled == pytest.approx(DEPTH * (holes_area(pins) - there), rel=1e-2)


@each_mesh
def test_the_surface_is_closed_and_looks_outward(name, dim, tmp_path):
    make, pins = LINKS[name]
    mesh = make(0.6, dim)
    write_stl(tmp_path / "link.stl", mesh, depth=DEPTH, pins=pins)
    normals, corners = facets_of(tmp_path / "link.stl")
    _, vertex = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    edges = np.concatenate([vertex[:, [0, 1]], vertex[:, [1, 2]], vertex[:, [2, 0]]])
    there, back = np.unique(edges, axis=0, return_counts=True), np.unique(edges[:, ::-1], axis=0)
    assert np.all(there[1] == 1) and np.array_equal(there[0], back)  # two facets at each edge, turning the same way
    # ∫ x·n dA = 3 V
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("md,md->", corners[:, 0], outward) / 6.0
    assert volume == pytest.approx(DEPTH * (plan_area(mesh) - holes_area(pins)), rel=5e-3)
    assert np.einsum("md,md->m", normals, outward) == pytest.approx(np.linalg.norm(outward, axis=1), rel=1e-3)


def test_eyes_much_wider_than_the_strip_are_exported(tmp_path):
    radius = 2.5 * THICKNESS
    mesh = link(1.0, points=STRAIGHT, radius=radius)
    pins = [PinHole(at, RADIUS) for at in (STRAIGHT[0], STRAIGHT[-1])]
    half = 0.5 * THICKNESS
    inside = half * np.sqrt(radius**2 - half**2) + radius**2 * np.arcsin(half / radius)  # of the strip, in one eye
    area = LENGTH * THICKNESS + 2.0 * (np.pi * radius**2 - inside) - holes_area(pins)
    write_step(tmp_path / "link.step", mesh, depth=DEPTH, pins=pins)
    with gmsh_session("again"):
        (solid,) = gmsh.model.occ.importShapes(str(tmp_path / "link.step"))
        assert gmsh.model.occ.getMass(*solid) == pytest.approx(DEPTH * area, rel=1e-6)
    write_stl(tmp_path / "link.stl", mesh, depth=DEPTH, pins=pins)
    _, corners = facets_of(tmp_path / "link.stl")
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.einsum("md,md->", corners[:, 0], outward) / 6.0 == pytest.approx(DEPTH * area, rel=2e-3)


def test_facets_meet_the_tolerance(tmp_path):
    def written(tolerance):
        write_stl(tmp_path / "link.stl", link(2.0), depth=DEPTH, pins=PINS, tolerance=tolerance)
        _, corners = facets_of(tmp_path / "link.stl")
        hole = np.linalg.norm(corners[..., :2] - PINS[0].centre, axis=2) < 0.51 * RADIUS
        chords = corners[(hole.sum(axis=1) == 2) & (np.ptp(corners[..., 2], axis=1) == 0.0)][:, :, :2]
        middles = [facet[h].mean(axis=0) for facet, h in zip(chords, np.linalg.norm(chords, axis=2) < 1.3, strict=True)]
        return len(corners), (0.5 * RADIUS - np.linalg.norm(middles, axis=1)).max()

    coarse, fine = written(0.1), written(0.002)
    assert fine[0] > 3 * coarse[0]
    assert coarse[1] < 0.1 and 0.0005 < fine[1] < 0.002


@pytest.mark.parametrize("write", [write_step, write_stl])
def test_nothing_is_printed_and_a_failure_leaves_the_old_file(write, tmp_path, capfd):
    path = tmp_path / "new folder" / "link"
    write(path, link(2.0), depth=DEPTH, pins=PINS)
    print("still heard")
    assert capfd.readouterr() == ("still heard\n", "")
    content = path.read_bytes()
    with pytest.raises(MeshingError):
        write(path, link(2.0), depth=DEPTH, pins=[PinHole(CURVED[0], 9.0)])
    assert path.read_bytes() == content
    assert os.listdir(path.parent) == ["link"]


def test_the_step_file_is_in_millimetres(tmp_path):
    write_step(tmp_path / "link.step", link(2.0), depth=DEPTH)
    content = (tmp_path / "link.step").read_text()
    assert "SI_UNIT(.MILLI.,.METRE.)" in content and content.rstrip().endswith("END-ISO-10303-21;")


def turned_over():
    mesh = link(2.0)
    points = mesh.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), np.concatenate(boundary_loops("strip", mesh)))[0]
    points[inner] += 5.0
    return replace(mesh, points=points)


def crossing():
    """A spiral that runs into itself, all its triangles in order."""
    mesh = link(1.5, points=STRAIGHT, pins=())
    x, y = mesh.points.T
    radius, angle = 6.0 - y + 0.05 * x, 2.4 * np.pi * x / LENGTH
    return replace(mesh, points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))


def narrowing():
    """A solid that narrows upwards."""
    mesh = part_in_space()
    x, y, z = mesh.points.T
    return replace(mesh, points=np.column_stack([x * (1.0 - 0.02 * z), y, z]))


@pytest.mark.parametrize("write", [write_step, write_stl])
@pytest.mark.parametrize(
    "mesh, pins, message",
    [
        (turned_over, (), r"link 'crank': cells are turned over: \d+ of \d+\. Choose a design"),
        (crossing, (), r"link 'crank': its outline crosses itself near \(.*Choose a design"),
        (
            lambda: link(2.0),
            [PinHole((0.0, 0.0), 5.5)],
            r"pin hole at \(0, 0\) in link 'crank': its diameter 5.5 is too large.*of less than 4.99",
        ),
        (lambda: link(2.0), [PinHole((20.0, 0.0), 1.0)], r"pin hole at \(20, 0\) .*not on the link"),
        (lambda: link(2.0), [PinHole((0.0, 0.0), 2.0), PinHole((1.0, 1.0), 1.0)], r"it meets the one at \(0, 0\)"),
        (narrowing, (), "not the same all through its depth"),
    ],
    ids=["turned over", "crossing", "too large", "off the link", "meeting", "narrowing"],
)
def test_links_that_cannot_be_exported_are_refused(write, mesh, pins, message, tmp_path):
    with pytest.raises(MeshingError, match=message):
        write(tmp_path / "crank", mesh(), depth=DEPTH, pins=pins)
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("write", [write_step, write_stl])
def test_numbers_out_of_range_are_refused(write, tmp_path):
    for depth in (0.0, -1.0, np.nan):
        with pytest.raises(DescriptionError, match="depth, link 'crank'"):
            write(tmp_path / "crank.step", link(2.0), depth=depth)
    with pytest.raises(MeshingError, match="the mesh is 5 deep, not 4"):
        write(tmp_path / "crank.step", link(2.0, dim=3), depth=4.0)
    for pin, message in ((PinHole((0.0, 0.0), -1.0), "diameter, pin hole"), (PinHole((0.0,), 1.0), "centre, pin hole")):
        with pytest.raises(DescriptionError, match=message):
            write(tmp_path / "crank.step", link(2.0), depth=DEPTH, pins=[pin])
    with pytest.raises(DescriptionError, match="tolerance, link 'crank'"):
        write_stl(tmp_path / "crank.stl", link(2.0), depth=DEPTH, tolerance=0.0)
