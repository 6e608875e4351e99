"""Meshing parts from STEP files: the solid or its half in space, a section of it in the plane."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.mechanism import StepPart
from fenicsmech.meshing.fragments import mesh_fragments
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, mesh_shape
from fenicsmech.meshing.part_file import require_header
from fenicsmech.meshing.regions import DimTag, region_face, region_prism, solid_reach
from fenicsmech.meshing.sizing import pin_refinements

_HEADER = "ISO-10303-21"
_MIRRORED = 1e-6  # by how much two halves may differ, relative to their size: modellers round


@mesh_shape.register
def _(shape: StepPart, request: MeshRequest) -> LinkMesh:
    mesh = {2: _mesh_section, 3: _mesh_solid}[request.dim]
    with gmsh_session(request.part):
        return mesh(shape, _only_solid(shape.path, request), request)


@check_shape.register
def _(shape: StepPart, request: MeshRequest) -> None:
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
    solids = _upper_half(shape, solid, request) if request.half else [solid]
    cutters = [region_prism(site, solid_reach(solids, site)) for site in request.sites]
    refinements = pin_refinements(request.sites, request.size, request.segments)
    mesh = mesh_fragments(request, solids, cutters, size=request.size, refinements=refinements)
    if not request.half:
        return mesh
    points = mesh.points.copy()
    points[points[:, 2] < 1e-9 * points[:, 2].max(), 2] = 0.0  # the mid-plane, but for rounding
    return replace(mesh, points=points)


def _upper_half(shape: StepPart, solid: DimTag, request: MeshRequest) -> list[DimTag]:
    """What of the solid lies above its centroid, which comes to lie at z = 0.

    Whether the halves are mirror images is told by their volumes, centroids and moments of inertia.

    Raises:
        DescriptionError: they are not.
    """
    occ = gmsh.model.occ
    x, y, bottom, right, far, top = occ.getBoundingBox(*solid)
    width, breadth, height = right - x, far - y, top - bottom
    occ.translate([solid], 0.0, 0.0, -occ.getCenterOfMass(*solid)[2])
    above = 3, occ.addBox(x - width, y - breadth, 0.0, 3.0 * width, 3.0 * breadth, height)
    upper = occ.intersect([solid], [above], removeObject=False, removeTool=False)[0]
    lower = occ.cut([solid], [above])[0]
    halves = [_moments(upper, 1.0), _moments(lower, -1.0)]
    occ.remove(lower, recursive=True)
    if not all(np.abs(a - b).max() <= _MIRRORED * np.abs(a).max() for a, b in zip(*halves, strict=True)):
        raise DescriptionError(
            request.part,
            f"the solid in {str(shape.path)!r} is not symmetric about its mid-plane",
            "Use space='3d'",
        )
    return upper


def _moments(solids: list[DimTag], side: float) -> list[np.ndarray]:
    """Volume, centroid and moments of inertia about it, mirrored at z = 0 where ``side`` is −1."""
    occ = gmsh.model.occ
    mirror = np.array([1.0, 1.0, side])
    volumes = np.array([occ.getMass(*solid) for solid in solids])
    centroids = np.array([occ.getCenterOfMass(*solid) for solid in solids]) * mirror
    inertias = sum(np.reshape(occ.getMatrixOfInertia(*solid), (3, 3)) for solid in solids) * np.outer(mirror, mirror)
    return [volumes.sum(), volumes @ centroids / volumes.sum(), inertias]


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
