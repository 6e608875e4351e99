"""Errors of meshing name the link and the joint, show the value and give a remedy."""

from pathlib import Path

import pytest

from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.mechanism import Arc, Disc, Line, Rectangle, gmsh_mesh, outline, polygon, step_file, strip
from fenicsmech.meshing import InterfaceSite, check_link, gmsh, gmsh_session, mesh_link

MESHES = Path(__file__).parents[2] / "meshes"
BAR = strip([(0, 0), (60, 0)], thickness=3, depth=10)
PLATE = polygon([(0, 0), (30, 0), (30, 20), (0, 20)], depth=4)
PART = step_file(MESHES / "curved_link.step", depth=10)
SAVED = gmsh_mesh(MESHES / "strip2d.msh", depth=10)
SAVED_SOLID = gmsh_mesh(MESHES / "strip3d.msh", depth=10)


def pin(*at, radius=1.0, name="hinge", axis=(0.0, 0.0, 1.0)):
    return InterfaceSite(at, Disc(radius), axis=axis, name=name)


@pytest.mark.thorough
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "shape, at",
    [
        (BAR, (30.0, 2.0)),
        (BAR, (-0.5, 0.0)),
        (BAR, (60.5, 0.0)),
        (PLATE, (-0.3, 10.0)),
        (PLATE, (31.0, 21.0)),
        (PART, (30.0, 0.0)),
        (PART, (-4.5, 0.0)),
    ],
)
def test_a_joint_off_its_link_is_refused(shape, at, dim):
    with pytest.raises(MeshingError, match=r"joint 'hinge' on link 'rod'.*not on the link") as caught:
        mesh_link("rod", shape, [pin(*at)], dim=dim, size=2.0)
    assert f"({at[0]:g}, {at[1]:g})" in caught.value.problem
    assert "joint" in caught.value.remedy


@pytest.mark.parametrize("shape, dim", [(SAVED, 2), (SAVED_SOLID, 3)])
def test_a_joint_off_a_mesh_file_is_refused(shape, dim):
    with pytest.raises(MeshingError, match=r"joint 'hinge' on link 'rod'.*not on the link"):
        mesh_link("rod", shape, [pin(30.0, 2.0)], dim=dim, size=2.0)


@pytest.mark.parametrize("shape, z", [(BAR, 6.0), (PART, -5.3)])
def test_a_joint_above_or_below_its_link_is_refused(shape, z):
    with pytest.raises(MeshingError, match=r"joint 'hinge'.*not on the link: along the joint's axis"):
        mesh_link("rod", shape, [pin(0.0, 0.0, z, radius=3.0)], dim=3, size=2.0)


@pytest.mark.parametrize("shape", [PART, PLATE])
def test_a_joint_on_the_very_edge_is_on_the_link(shape):
    edge = {PART: (60.0, 0.0, 5.0), PLATE: (0.0, 10.0, 0.0)}[shape]
    assert mesh_link("rod", shape, [pin(*edge, radius=3.0)], dim=3, size=2.0).cells_of(0).size


def test_a_region_between_the_cells_of_a_mesh_file_is_refused():
    with pytest.raises(MeshingError, match=r"joint 'hinge' on link 'rod': no cell lies in Disc\(radius=0.2\)"):
        mesh_link("rod", SAVED, [pin(30.0, 0.1, radius=0.2)], dim=2, size=1.5)


@pytest.mark.parametrize(
    "shape, dim, sites",
    [
        (BAR, 2, [pin(10.0, 0.0, name="a", radius=3.0), pin(14.0, 0.0, name="b", radius=3.0)]),
        (BAR, 3, [pin(10.0, 0.0, name="a", radius=3.0), pin(16.0, 0.0, name="b", radius=3.0)]),  # they touch
        (BAR, 2, [pin(10.0, 0.0, name="a"), pin(10.0, 0.0, name="b")]),
        (PLATE, 2, [pin(10.0, 10.0, name="a", radius=4.0), InterfaceSite((14.0, 10.0), Rectangle(3, 3), name="b")]),
        (PART, 3, [pin(0.0, 0.0, name="a", radius=3.0), pin(0.0, 0.0, name="b", radius=2.0)]),
        (SAVED, 2, [pin(0.0, 0.0, name="a", radius=3.0), pin(1.0, 0.0, name="b", radius=3.0)]),
        (SAVED_SOLID, 3, [pin(0.0, 0.0, name="a", radius=3.0), pin(1.0, 0.0, name="b", radius=3.0)]),
    ],
)
def test_regions_that_touch_or_overlap_are_refused(shape, dim, sites):
    with pytest.raises(MeshingError, match=r"link 'rod'.*joints 'a' at \(.*\) and 'b' at \(.*\) touch or overlap"):
        mesh_link("rod", shape, sites, dim=dim, size=2.0)


def test_a_link_held_everywhere_is_refused():
    with pytest.raises(MeshingError, match="cover the whole link"):
        mesh_link("rod", PLATE, [InterfaceSite((15.0, 10.0), Rectangle(40, 40), name="clamp")], dim=2, size=4.0)


def test_a_strip_that_folds_over_is_refused():
    with pytest.raises(MeshingError, match=r"link 'rod': the centreline bends with radius .* half the thickness 13"):
        mesh_link("rod", strip([(0, 0), (10, 8), (20, 0)], thickness=13, depth=1), dim=2, size=2.0)


def test_a_strip_that_crosses_itself_is_refused():
    loop = strip([(0, 0), (40, 0), (50, 20), (30, 30), (20, -20)], thickness=2, depth=1)
    with pytest.raises(MeshingError, match=r"link 'rod': the strip crosses itself near \("):
        mesh_link("rod", loop, dim=2, size=2.0)


def test_a_strip_with_a_doubled_point_is_refused():
    with pytest.raises(DescriptionError, match=r"centreline of link 'rod': points 1 and 2 coincide at \(5, 0\)"):
        mesh_link("rod", strip([(0, 0), (5, 0), (5, 0)], thickness=1, depth=1), dim=2, size=1.0)


@pytest.mark.parametrize(
    "shape, complaint",
    [
        (polygon([(0, 0), (10, 10), (10, 0), (0, 10)], depth=1), r"the outline crosses itself near \(5, 5\)"),
        (outline((0, 0), [Arc((1, 0), (2, 0)), Line((2, 3))], depth=1), "three points in line"),
        (outline((0, 0), [Line((0, 0))], depth=1), "encloses no area"),
    ],
)
def test_an_outline_that_encloses_no_area_properly_is_refused(shape, complaint):
    with pytest.raises(MeshingError, match=complaint):
        mesh_link("plate", shape, dim=2, size=1.0)


@pytest.mark.parametrize("make, kind", [(step_file, "STEP file"), (gmsh_mesh, "gmsh mesh file")])
def test_a_missing_file_is_named(make, kind, tmp_path):
    with pytest.raises(MeshingError, match=rf"link 'rod': the {kind} '.*/absent' cannot be read \(No such file"):
        mesh_link("rod", make(tmp_path / "absent", depth=1.0), dim=2, size=1.0)


@pytest.mark.parametrize("make, kind", [(step_file, "STEP file"), (gmsh_mesh, "gmsh mesh file")])
@pytest.mark.parametrize("content", ["", "SystemCall 'echo never';\n"])
def test_a_file_of_another_kind_is_refused_before_gmsh_reads_it(make, kind, content, tmp_path):
    path = tmp_path / "part.geo"
    path.write_text(content)
    with pytest.raises(MeshingError, match=rf"'.*part.geo' is not a {kind}"):
        mesh_link("rod", make(path, depth=1.0), dim=2, size=1.0)


@pytest.mark.parametrize("make, file", [(step_file, "curved_link.step"), (gmsh_mesh, "strip2d.msh")])
def test_a_truncated_file_is_refused(make, file, tmp_path):
    path = tmp_path / file
    path.write_text((MESHES / file).read_text()[:3000])
    with pytest.raises(MeshingError, match="link 'rod'"):
        mesh_link("rod", make(path, depth=1.0), dim=2, size=1.0)


def write_step(path, draw):
    with gmsh_session("test part"):
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))


@pytest.mark.parametrize(
    "count, draw",
    [
        ("no", lambda occ: occ.addRectangle(0, 0, 0, 10, 5)),
        ("2", lambda occ: [occ.addBox(0, 0, 0, 10, 5, 5), occ.addBox(20, 0, 0, 10, 5, 5)]),
    ],
)
def test_a_step_file_without_exactly_one_solid_is_refused(count, draw, tmp_path):
    write_step(tmp_path / "parts.step", draw)
    with pytest.raises(MeshingError, match=rf"'.*parts.step' holds {count} solids\. Export exactly one solid"):
        mesh_link("rod", step_file(tmp_path / "parts.step", depth=5.0), dim=3, size=1.0)


def test_a_section_beside_the_solid_is_refused_with_the_extent_of_the_solid():
    with pytest.raises(MeshingError, match=r"the section z = 7 misses the solid in .* between z = -5 and 5 mm"):
        mesh_link("rod", step_file(MESHES / "curved_link.step", depth=10.0, section=7.0), dim=2, size=1.0)


def test_a_section_in_pieces_is_refused(tmp_path):
    def bridge(occ):
        body = occ.addBox(0, 0, 0, 30, 5, 10)
        occ.cut([(3, body)], [(3, occ.addBox(10, -1, -1, 10, 7, 6))])

    write_step(tmp_path / "bridge.step", bridge)
    part = step_file(tmp_path / "bridge.step", depth=5.0, section=2.0)
    with pytest.raises(MeshingError, match="the link falls into 2 separate pieces"):
        mesh_link("rod", part, dim=2, size=2.0)


@pytest.mark.parametrize(
    "shape, dim, complaint",
    [(SAVED, 3, "holds no cells, not tetrahedra only"), (SAVED_SOLID, 2, "holds Tetrahedron 4, not triangles only")],
)
def test_a_mesh_file_of_the_wrong_dimension_is_refused(shape, dim, complaint):
    with pytest.raises(MeshingError, match=complaint):
        mesh_link("rod", shape, dim=dim, size=1.5)


@pytest.mark.parametrize("options", [{"size": 0.0}, {"size": float("nan")}, {"dim": 4}, {"layers": 0}, {"layers": 1.5}])
def test_arguments_out_of_range_are_refused(options):
    with pytest.raises(DescriptionError, match="link 'rod'"):
        mesh_link("rod", BAR, **{"dim": 3, "size": 2.0, **options})


@pytest.mark.parametrize(
    "shape",
    [
        strip([(0.0, 0.0), (60.0, 0.0)], thickness=4.0, depth=5.0),
        polygon([(-2, -2), (62, -2), (62, 2), (-2, 2)], depth=5.0),
    ],
)
def test_a_point_off_its_link_is_refused_before_meshing_and_one_on_it_is_not(shape):
    check_link("rod", shape, [], {"probe": (30.0, 1.9)}, dim=2, size=1.0)
    with pytest.raises(MeshingError, match=r"'probe': the point \(30, 3\) is not on link 'rod'"):
        check_link("rod", shape, [], {"probe": (30.0, 3.0)}, dim=2, size=1.0)
