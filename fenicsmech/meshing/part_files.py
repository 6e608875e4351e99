"""Links read from files: solids from STEP files, or sections through them, and meshes from gmsh files."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.mechanism import MeshPart, StepPart
from fenicsmech.meshing.cutting import DimTag, mesh_fragments, mesh_nodes, region_face, region_prism
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, boundary_polygons, plan_of
from fenicsmech.meshing.link_mesher import MeshRequest, check_shape, mesh_shape
from fenicsmech.meshing.outline import CircleArc, Curve, chained, outer_loop, outermost, straight_line
from fenicsmech.meshing.session import gmsh, gmsh_session

_INTERPOLATED = 1e-8  # of the extent of a part: how far splines deviate from its curves; sections are rounded to 1e-9
_TOLERANCE = 1e-6  # of the extent of a mesh from a file, whose coordinates are rounded


@check_shape.register
def _(shape: StepPart, request: MeshRequest) -> None:
    _check_file(shape, request.part)


@check_shape.register
def _(shape: MeshPart, request: MeshRequest) -> None:
    if request.half:
        remedy = "Use space='3d', or give the link as a strip, an outline or a STEP file"
        raise DescriptionError(request.part, "the symmetry of a mesh file about its mid-plane is not known", remedy)
    _check_file(shape, request.part)


def _check_file(shape: StepPart | MeshPart, part: str) -> None:
    """Refuses a file that does not begin as its kind does; gmsh would guess its kind."""
    header, kind = ("ISO-10303-21", "STEP file") if isinstance(shape, StepPart) else ("$MeshFormat", "gmsh mesh file")
    path = shape.path
    try:
        with open(path, "rb") as file:
            start = file.read(len(header) + 64).lstrip()
    except OSError as failure:
        problem = f"the {kind} {str(path)!r} cannot be read ({failure.strerror})"
        raise MeshingError(part, problem, "Check the path") from failure
    if not start.startswith(header.encode()):
        problem = f"{str(path)!r} is not a {kind}: it does not begin with {header!r}"
        raise MeshingError(part, problem, f"Give the path of a {kind}")


@mesh_shape.register
def _(shape: StepPart, request: MeshRequest) -> LinkMesh:
    mesh = {2: _mesh_section, 3: _mesh_solid}[request.dim]
    with gmsh_session(request.part):
        return mesh(shape, _only_solid(shape.path, request), request)


def _only_solid(path: Path, request: MeshRequest) -> DimTag:
    """The one solid of the file, in mm."""
    solids = [entity for entity in gmsh.model.occ.importShapes(str(path), format="step") if entity[0] == 3]
    if len(solids) != 1:
        problem = f"the STEP file {str(path)!r} holds {len(solids) or 'no'} solids"
        raise MeshingError(request.part, problem, "Export exactly one solid body per link")
    return solids[0]


def plan_size(shape: StepPart | MeshPart, part: str) -> tuple[float, int]:
    """How much there is to mesh of a link from a file, before it is meshed.

    Args:
        shape: with its file.
        part: for messages.

    Returns:
        The mean section of a STEP file's solids along z, in mm², and the number of elements of a mesh file.

    Raises:
        MeshingError: the file cannot be read.
    """
    _check_file(shape, part)
    with gmsh_session(part):
        if isinstance(shape, MeshPart):
            gmsh.merge(str(shape.path))
            counts = [sum(map(len, gmsh.model.mesh.getElements(dim)[1])) for dim in (2, 3)]
            return 0.0, counts[1] or counts[0]
        occ, area = gmsh.model.occ, 0.0
        for dim, tag in occ.importShapes(str(shape.path), format="step"):
            if dim == 3:
                _, _, bottom, _, _, top = occ.getBoundingBox(dim, tag)
                area += abs(occ.getMass(dim, tag)) / (top - bottom)
    return area, 0


def _mesh_solid(shape: StepPart, solid: DimTag, request: MeshRequest) -> LinkMesh:
    solids = _upper_half(shape, solid, request) if request.half else [solid]
    cutters = [region_prism(site, solids) for site in request.sites]
    mesh = mesh_fragments(request, solids, cutters, size=request.size, sites=request.sites)
    if not request.half:
        return mesh
    points = mesh.points.copy()
    points[points[:, 2] < 1e-9 * points[:, 2].max(), 2] = 0.0  # the mid-plane, but for rounding
    return replace(mesh, points=points)


def _upper_half(shape: StepPart, solid: DimTag, request: MeshRequest) -> list[DimTag]:
    """The part of the solid above its centroid, which moves to z = 0.

    The halves are mirror images if their volumes, centroids and moments of inertia agree.
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
    # to 1e-6: modellers round
    if not all(np.abs(a - b).max() <= 1e-6 * np.abs(a).max() for a, b in zip(*halves, strict=True)):
        problem = f"the solid in {str(shape.path)!r} is not symmetric about its mid-plane"
        raise DescriptionError(request.part, problem, "Use space='3d'")
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
    """Meshes the section with the plane z = ``shape.section``."""
    faces = _section(shape, solid, request)
    cutters = [region_face(site, height=shape.section) for site in request.sites]
    return mesh_fragments(request, faces, cutters, size=request.size, sites=request.sites)


def _section(shape: StepPart, solid: DimTag, request: MeshRequest) -> list[DimTag]:
    """The faces that the solid has in common with the plane z = ``shape.section``."""
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
    return faces


@outer_loop.register
def _(shape: StepPart, request: MeshRequest) -> list[Curve]:
    with gmsh_session(request.part):
        faces = _section(shape, _only_solid(shape.path, request), request)
        gmsh.model.occ.synchronize()
        edges = [edge for _, edge in gmsh.model.getBoundary(faces, oriented=False)]
        x, y, _, right, far, _ = gmsh.model.getBoundingBox(-1, -1)
        extent = max(right - x, far - y)
        curves = [_curve(edge, _INTERPOLATED * extent) for edge in edges]
    return outermost(chained(curves, _TOLERANCE * extent), 1e-3 * extent)


def _curve(edge: int, tolerance: float) -> Curve:
    """An edge of the current gmsh model; one that is neither straight nor round to within ``tolerance``."""
    (low,), (high,) = gmsh.model.getParametrizationBounds(1, edge)

    def at(fractions: np.ndarray) -> np.ndarray:
        return gmsh.model.getValue(1, edge, low + (high - low) * fractions).reshape(-1, 3)[:, :2]

    start, via, end = at(np.array([0.0, 0.5, 1.0]))
    match gmsh.model.getType(1, edge):
        case "Line":
            return straight_line(start, end)
        case "Circle":
            if np.linalg.norm(end - start) > tolerance:
                return CircleArc.through(start, via, end)
            (x, y), centre = start - via, 0.5 * (start + via)
            return CircleArc(centre, 0.5 * math.hypot(x, y), math.atan2(y, x), 2.0 * math.pi)
    for parts in (16, 32, 64, 128, 256, 512):
        fractions = np.linspace(0.0, 1.0, 2 * parts + 1)
        fine = at(fractions)
        spline = make_interp_spline(fractions[::2], fine[::2], k=3)
        if np.linalg.norm(spline(fractions[1::2]) - fine[1::2], axis=1).max() <= tolerance:
            break
    return spline


@outer_loop.register
def _(shape: MeshPart, request: MeshRequest) -> list[Curve]:
    plan = plan_of(mesh_shape(shape, request)).mesh
    if plan.dim == 3:
        problem = f"the mesh in {str(shape.path)!r} is not the same all through its depth, so its outline is not known"
        raise MeshingError(request.part, problem, "Give the link as a STEP file")
    polygon = boundary_polygons(request.part, plan)[0]
    return [straight_line(*ends) for ends in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)]


@mesh_shape.register
def _(shape: MeshPart, request: MeshRequest) -> LinkMesh:
    with gmsh_session(request.part):
        gmsh.merge(str(shape.path))
        points, cells = _read(shape, request)
    return LinkMesh.from_cells(points, cells, _interface(points, cells, request))


def _read(shape: MeshPart, request: MeshRequest) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, dim) and simplices (m, dim + 1) of the current gmsh model, which holds no other cells."""
    dim = request.dim
    family, plural = {2: ("Triangle", "triangles"), 3: ("Tetrahedron", "tetrahedra")}[dim]
    kinds = {dimension: gmsh.model.mesh.getElements(dimension) for dimension in range(dim, 4)}
    present = [gmsh.model.mesh.getElementProperties(kind)[0] for types, _, _ in kinds.values() for kind in types]
    if not present or not all(name.startswith(family) for name in present):
        raise MeshingError(
            request.part,
            f"the mesh file {str(shape.path)!r} holds {', '.join(present) or 'no cells'}, not {plural} only",
            f"Save a mesh of {plural} for a {dim}D model",
        )
    points, row_of = mesh_nodes()
    simplices = []
    for kind, nodes in zip(kinds[dim][0], kinds[dim][2], strict=True):
        per_cell = gmsh.model.mesh.getElementProperties(kind)[3]
        # the corners come first; the nodes on edges and faces of curved cells are left out
        simplices.append(row_of[nodes.astype(np.int64)].reshape(-1, per_cell)[:, : dim + 1])
    cells = np.concatenate(simplices)
    heights = points[np.unique(cells), dim:]
    if heights.size and np.ptp(heights) > _TOLERANCE * np.ptp(points):
        raise MeshingError(
            request.part,
            f"the mesh in {str(shape.path)!r} extends from z = {heights.min():g} to {heights.max():g} in a 2D model",
            "Save a mesh in a plane z = constant",
        )
    return points[:, :dim], cells


def _interface(points: np.ndarray, cells: np.ndarray, request: MeshRequest) -> np.ndarray:
    """The site whose region contains all corners of each cell, or FREE."""
    tolerance = _TOLERANCE * float(np.ptp(points[np.unique(cells)], axis=0).max())
    interface = np.full(len(cells), FREE)
    for number, site in enumerate(request.sites):
        inside = site.contains(points, tolerance)[cells].all(axis=1)
        if (taken := interface[inside & (interface != FREE)]).size:
            raise request.overlap(int(taken[0]), number)
        interface[inside] = number
    return interface
