"""Meshing parts from STEP files: the solid in space, a section of it in the plane."""

from __future__ import annotations

from pathlib import Path

from fenicsmech.errors import MeshingError
from fenicsmech.mechanism.shapes import StepPart
from fenicsmech.meshing.fragments import mesh_fragments
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, mesh_shape, refuse_half
from fenicsmech.meshing.part_file import require_header
from fenicsmech.meshing.regions import DimTag, region_face, region_prism, solid_reach
from fenicsmech.meshing.sizing import pin_refinements

_HEADER = "ISO-10303-21"


@mesh_shape.register
def _(shape: StepPart, request: MeshRequest) -> LinkMesh:
    mesh = {2: _mesh_section, 3: _mesh_solid}[request.dim]
    with gmsh_session(request.part):
        return mesh(shape, _only_solid(shape.path, request), request)


@check_shape.register
def _(shape: StepPart, request: MeshRequest) -> None:
    refuse_half(request, "a STEP file")
    require_header(shape.path, _HEADER, kind="STEP file", part=request.part)


def _only_solid(path: Path, request: MeshRequest) -> DimTag:
    """The one solid of the file, in mm.

    Raises:
        MeshingError: there is none, or more than one.
    """
    solids = [entity for entity in gmsh.model.occ.importShapes(str(path), format="step") if entity[0] == 3]
    if len(solids) != 1:
        raise MeshingError(
            request.part,
            f"the STEP file {str(path)!r} holds {len(solids) or 'no'} solids",
            "Export exactly one solid body per link",
        )
    return solids[0]


def _mesh_solid(shape: StepPart, solid: DimTag, request: MeshRequest) -> LinkMesh:
    cutters = [region_prism(site, solid_reach([solid], site)) for site in request.sites]
    refinements = pin_refinements(request.sites, request.size, request.segments)
    return mesh_fragments(request, [solid], cutters, size=request.size, refinements=refinements)


def _mesh_section(shape: StepPart, solid: DimTag, request: MeshRequest) -> LinkMesh:
    """Mesh the section with the plane z = ``shape.section``.

    Raises:
        MeshingError: the plane misses the solid.
    """
    occ = gmsh.model.occ
    x, y, bottom, right, far, top = occ.getBoundingBox(*solid)
    width, breadth = right - x, far - y
    plane = 2, occ.addRectangle(x - width, y - breadth, shape.section, 3.0 * width, 3.0 * breadth)
    faces = occ.intersect([plane], [solid])[0]
    if not faces:
        raise MeshingError(
            request.part,
            f"the section z = {shape.section:g} misses the solid in {str(shape.path)!r}, "
            f"which lies between z = {bottom:g} and {top:g} mm",
            "Choose a section in between",
        )
    cutters = [region_face(site, height=shape.section) for site in request.sites]
    refinements = pin_refinements(request.sites, request.size, request.segments)
    return mesh_fragments(request, faces, cutters, size=request.size, refinements=refinements)
