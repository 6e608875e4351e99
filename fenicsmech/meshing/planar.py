"""Links that are the same all through their depth: drawn, cut and meshed in the plane, then extruded.

CAD kernels compare lengths with absolute tolerances, so a link in metres would not be meshed like the same link
in millimetres. Shapes are therefore built in units of the element size, rounded to 1e-10 of it: descriptions that
differ by their unit only give the same numbers, and the same mesh but for rounding.

The layers of tetrahedra repeat the triangulation of the plan, as in a plane model. Fields that are the same all
through the depth are fields on the plan: on tetrahedra whose vertices stand on the three corners of a triangle such a
field has exactly no gradient along z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenicsmech.meshing.cutting import DimTag, mesh_fragments, region_face, region_prism
from fenicsmech.meshing.gmsh_session import gmsh, gmsh_session
from fenicsmech.meshing.link_mesh import CurvedEdges, LinkMesh
from fenicsmech.meshing.request import InterfaceSite, MeshRequest

Described = TypeVar("Described")


def in_units_of(described: Described, unit: float) -> Described:
    """``described`` (a length, a point, a region, a site or a shape) with its lengths divided by ``unit``."""
    return _in_units_of(described, unit)


def _in_units_of(described: Any, unit: float) -> Any:
    if is_dataclass(described) and not isinstance(described, type):
        lengths = [field.name for field in fields(described) if field.name not in ("angle", "axis", "name")]
        return replace(described, **{name: _in_units_of(getattr(described, name), unit) for name in lengths})
    if isinstance(described, tuple):
        return tuple(_in_units_of(item, unit) for item in described)
    return round(described / unit, 10)


@dataclass(frozen=True)
class PlaneDrawing:
    """The plan of a link as faces of the current gmsh model, in units of the element size.

    Attributes:
        faces: faces of the plane z = 0 that make up the link.
        sites: the sites, with the regions to be cut.
        corners: for each site the angles (rad) at which the outline of its disc has vertices.
        refinements: element sizes for small features, as gmsh expressions.
    """

    faces: list[DimTag]
    sites: tuple[InterfaceSite, ...]
    corners: tuple[tuple[float, ...], ...]
    refinements: tuple[str, ...] = ()


def mesh_planar(
    request: MeshRequest, depth: float, draw: Callable[[tuple[InterfaceSite, ...]], PlaneDrawing]
) -> LinkMesh:
    """Meshes a link of constant section: as a solid where a joint's axis is not along z, else in the plane.

    Args:
        request: the mesh wanted.
        depth: extent along z, symmetric about z = 0.
        draw: draws the link in the current gmsh model in units of the element size, given the sites in these units.

    Raises:
        MeshingError: the mesh cannot be made.
    """
    occ = gmsh.model.occ
    sites = in_units_of(request.sites, request.size)
    with gmsh_session(request.part):
        drawing = draw(sites)
        bodies = drawing.faces
        if all(site.is_planar for site in sites):
            cutters = [region_face(s, corners=c) for s, c in zip(drawing.sites, drawing.corners, strict=True)]
        else:
            height = in_units_of(depth, request.size)
            occ.translate(bodies, 0.0, 0.0, -0.5 * height)
            bodies = [entity for entity in occ.extrude(bodies, 0.0, 0.0, height) if entity[0] == 3]
            cutters = [region_prism(site, bodies) for site in drawing.sites]
        mesh = mesh_fragments(request, bodies, cutters, size=1.0, sites=drawing.sites, refinements=drawing.refinements)
    mesh = replace(mesh, points=mesh.points * request.size, curved=mesh.curved.times(request.size))
    if request.dim == mesh.dim:
        return mesh
    if request.half:
        return extrude_half(mesh, depth, request.layers or layer_count(0.5 * depth, request.size))
    return extrude(mesh, depth, request.layers or layer_count(depth, request.size))


def layer_count(depth: float, size: float) -> int:
    """Default number of layers through ``depth``: about twice as high as the triangles are wide."""
    return max(1, round(depth / (2.0 * size)))


def extrude(plan: LinkMesh, depth: float, layers: int) -> LinkMesh:
    """The tetrahedra over ``plan`` between z = −depth/2 and z = depth/2, in ``layers`` equal layers.

    A prism over the triangle a < b < c (numbers of its vertices in ``plan``), with a′, b′, c′ above them, is cut
    into abcc′, abb′c′ and aa′b′c′. The diagonal of a side then joins the lower number below with the higher above,
    in both of its neighbours. Layers above the middle are mirror images of those below, so with an
    even number of layers the mesh is symmetric about z = 0, and plane loads cause no motion out of the plane.

    Args:
        plan: the triangulation; its ``interface`` numbers pass on to the cells above.
        depth: extent along z.
        layers: number of layers, at least 1.
    """
    return _stack(plan, np.linspace(-0.5 * depth, 0.5 * depth, layers + 1), mirrored_from=(layers + 1) // 2)


def extrude_half(plan: LinkMesh, depth: float, layers: int) -> LinkMesh:
    """The upper half, z ≥ 0, of what ``extrude`` makes of twice as many ``layers``."""
    return _stack(plan, np.linspace(0.0, 0.5 * depth, layers + 1), mirrored_from=0)


def _stack(plan: LinkMesh, heights: np.ndarray, *, mirrored_from: int) -> LinkMesh:
    """Layers of tetrahedra between ``heights``; those from number ``mirrored_from`` on are cut upside down."""
    count, layers = len(plan.points), len(heights) - 1
    points = np.column_stack([np.tile(plan.points, (layers + 1, 1)), np.repeat(heights, count)])
    a, b, c = np.sort(plan.cells, axis=1).T
    sides = [(layer, layer + 1) if layer < mirrored_from else (layer + 1, layer) for layer in range(layers)]
    cells = []
    for near, far in sides:
        below, above = near * count, far * count
        cells += [
            np.column_stack([a + below, b + below, c + below, c + above]),
            np.column_stack([a + below, b + below, b + above, c + above]),
            np.column_stack([a + below, a + above, b + above, c + above]),
        ]
    return LinkMesh.from_cells(
        points, np.concatenate(cells), np.tile(plan.interface, 3 * layers), _walls(plan.curved, sides, count)
    )


def _walls(plan: CurvedEdges, sides: list[tuple[int, int]], count: int) -> CurvedEdges:
    """Curved edges of an extruded mesh: copies at every height, and the diagonals of the walls between them."""
    lower, upper = plan.ends.T
    ends = [plan.ends + height * count for height in range(len(sides) + 1)]
    ends += [np.column_stack([lower + near * count, upper + far * count]) for near, far in sides]
    bulges = np.column_stack([plan.bulges, np.zeros(len(plan.ends))])
    return CurvedEdges(np.sort(np.concatenate(ends), axis=1), np.tile(bulges, (len(ends), 1)))


@dataclass(frozen=True, eq=False)
class Plan:
    """The plane mesh of a link and the columns of vertices above it.

    Attributes:
        mesh: triangles; the link's own mesh if it is not extruded along z.
        column: vertex of ``mesh`` that stands for each vertex of the link, (n,).
    """

    mesh: LinkMesh
    column: np.ndarray


def plan_of(link: LinkMesh) -> Plan:
    """The plan of a link."""
    if link.dim == 3:
        flat = link.points[:, :2]
        same = 1e-8 * np.ptp(flat, axis=0).max()  # vertices this close in the plan stand on one column
        pairs = cKDTree(flat).query_pairs(same, output_type="ndarray")
        graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(flat),) * 2)
        count, column = connected_components(graph, directed=False)
        corners = np.sort(column[link.cells], axis=1)
        first = np.diff(corners, axis=1, prepend=-1) > 0
        if np.all(first.sum(axis=1) == 3):
            triangles, below = np.unique(corners[first].reshape(-1, 3), axis=0, return_index=True)
            points = np.empty((count, 2))
            points[column] = flat
            return Plan(LinkMesh.from_cells(points, triangles, link.interface[below]), column)
    return Plan(link, np.arange(len(link.points)))
