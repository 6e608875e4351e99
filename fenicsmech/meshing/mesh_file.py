"""Links given as gmsh mesh files."""

from __future__ import annotations

import numpy as np

from fenicsmech.errors import DescriptionError, MeshingError
from fenicsmech.mechanism import MeshPart
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.holders import sole_holder
from fenicsmech.meshing.interface_site import across
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, mesh_shape
from fenicsmech.meshing.part_file import require_header
from fenicsmech.meshing.regions import contains

_HEADER = "$MeshFormat"
_TOLERANCE = 1e-6  # relative to the link's extent
_SIMPLICES = {2: ("Triangle", "triangles"), 3: ("Tetrahedron", "tetrahedra")}


@mesh_shape.register
def _(shape: MeshPart, request: MeshRequest) -> LinkMesh:
    with gmsh_session(request.part):
        gmsh.merge(str(shape.path))
        points, cells = _read(shape, request)
    return LinkMesh.from_cells(points, cells, _interface(points, cells, request))


@check_shape.register
def _(shape: MeshPart, request: MeshRequest) -> None:
    if request.half:
        raise DescriptionError(
            request.part,
            "a mesh file does not tell whether its cells are symmetric about a mid-plane",
            "Use space='3d', or give the link as a strip, an outline or a STEP file",
        )
    require_header(shape.path, _HEADER, kind="gmsh mesh file", part=request.part)


def _read(shape: MeshPart, request: MeshRequest) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, dim) and simplices (m, dim + 1) of the current gmsh model.

    Raises:
        MeshingError: there are cells of another kind, or none; the mesh of a plane model is not in the plane.
    """
    dim = request.dim
    family, plural = _SIMPLICES[dim]
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    kinds = {dimension: gmsh.model.mesh.getElements(dimension) for dimension in range(dim, 4)}
    present = [gmsh.model.mesh.getElementProperties(kind)[0] for types, _, _ in kinds.values() for kind in types]
    if not present or not all(name.startswith(family) for name in present):
        raise MeshingError(
            request.part,
            f"the mesh file {str(shape.path)!r} holds {', '.join(present) or 'no cells'}, not {plural} only",
            f"Save a mesh of {plural} for a {dim}D model",
        )
    row_of = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row_of[tags.astype(np.int64)] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    cells = []
    for kind, nodes in zip(kinds[dim][0], kinds[dim][2], strict=True):
        per_cell = gmsh.model.mesh.getElementProperties(kind)[3]
        # the corners come first; the nodes on edges and faces of curved cells are left out
        cells.append(row_of[nodes.astype(np.int64)].reshape(-1, per_cell)[:, : dim + 1])
    cells = np.concatenate(cells)
    heights = points[np.unique(cells), dim:]
    if heights.size and np.ptp(heights) > _TOLERANCE * np.ptp(points):
        raise MeshingError(
            request.part,
            f"the mesh in {str(shape.path)!r} extends from z = {heights.min():g} to {heights.max():g} in a 2D model",
            "Save a mesh in a plane z = constant",
        )
    return points[:, :dim], cells


def _interface(points: np.ndarray, cells: np.ndarray, request: MeshRequest) -> np.ndarray:
    """For each cell the site whose region contains all its corners, or FREE."""
    tolerance = _TOLERANCE * float(np.ptp(points[np.unique(cells)], axis=0).max())
    inside = [contains(site.region, across(site, points), tolerance)[cells].all(axis=1) for site in request.sites]
    holders = np.array(inside, dtype=bool).reshape(len(request.sites), len(cells))
    return np.array([sole_holder(request, np.flatnonzero(column)) for column in holders.T], dtype=np.int32)
