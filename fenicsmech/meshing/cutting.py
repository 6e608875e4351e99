"""A link's CAD body in the current gmsh model: cut along its interface regions and meshed.

The element size is the requested one, finer only where small features need it: around pins, for enough segments of
the circle, and in narrow gaps.

Links that are the same all through their depth are drawn, cut and meshed in the plane, then extruded. CAD kernels
compare lengths with absolute tolerances, so a link in metres would not be meshed like the same link in millimetres.
Their shapes are therefore built in units of the element size, rounded to 1e-10 of it: descriptions that differ by their
unit only give the same numbers, and the same mesh but for rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from fenicsmech.mechanism import Disc
from fenicsmech.meshing.link_mesh import FREE, CurvedEdges, LinkMesh, extrude
from fenicsmech.meshing.link_mesher import LEAST_SEGMENTS, InterfaceSite, MeshRequest
from fenicsmech.meshing.session import gmsh, gmsh_session

DimTag = tuple[int, int]


@dataclass(frozen=True)
class Grading:
    """Gradients of the element size over a link.

    Attributes:
        growth: of the element size per unit of distance from a small feature.
        gap_aspect: length over height of the elements in a narrow gap.
        least_gap_size: least element size in a gap over that next to it; bounds the number of elements there.
    """

    growth: float = 1.0
    gap_aspect: float = 4.0
    least_gap_size: float = 0.25


GRADING = Grading()


def circle_segments(radius: float, size: float) -> int:
    """Number of segments of the polygon of a whole circle."""
    return max(LEAST_SEGMENTS, math.ceil(2.0 * math.pi * radius / size))


def gap_refinement(at: Sequence[float], gap: float, radius: float, widening: Sequence[Iterable[float]]) -> str:
    """Element size, as a gmsh expression, in the narrow ``gap`` around a disc. Lengths are in element sizes.

    Where the gap widens along straight sides, it has grown to gap + a²/(2 radius) at the distance a along the unit
    vectors ``widening`` (none if it goes evenly all around); the element size follows it, down to a least size, and
    grows with the distance from the gap.
    """
    dx, dy = (f"({name} - ({float(c)!r}))" for name, c in zip("xy", at, strict=True))
    widened = "".join(
        f" + max(0, ({float(u)!r}) * {dx} + ({float(v)!r}) * {dy})^2 / {2.0 * radius!r}" for u, v in widening
    )
    least = GRADING.least_gap_size * min(1.0, 2.0 * math.pi * radius / LEAST_SEGMENTS)
    narrow = f"max({least!r}, {GRADING.gap_aspect!r} * ({gap!r}{widened}))"
    away = f"max(0, abs(sqrt({dx}^2 + {dy}^2) - {radius + 0.5 * gap!r}) - {0.5 * gap!r})"
    return f"{narrow} + {GRADING.growth!r} * {away}"


def region_face(site: InterfaceSite, *, corners: Sequence[float] = (0.0,), height: float = 0.0) -> DimTag:
    """The region of a site with its axis along z, as a face of the plane z = ``height`` in the current gmsh model.

    The outline of a disc has vertices at the angles (rad) ``corners`` from x.
    """
    occ, region = gmsh.model.occ, site.region
    if isinstance(region, Disc):
        radius = region.radius
        face = 2, occ.addDisk(0.0, 0.0, 0.0, radius, radius)
        occ.rotate([face], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, corners[0])
        points = [(0, occ.addPoint(radius * math.cos(a), radius * math.sin(a), 0.0)) for a in corners[1:]]
        if points:
            face = next(piece for piece in occ.fragment([face], points)[0] if piece[0] == 2)
    else:
        face = 2, occ.addRectangle(-0.5 * region.length, -0.5 * region.width, 0.0, region.length, region.width)
        occ.rotate([face], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, region.angle)
    x, y, _ = site.centre
    occ.translate([face], x, y, height)
    return face


def region_prism(site: InterfaceSite, solids: Sequence[DimTag]) -> DimTag:
    """The site's region swept along its axis all through ``solids``, in the current gmsh model."""
    occ, region = gmsh.model.occ, site.region
    boxes = np.array([occ.getBoundingBox(*solid) for solid in solids]).reshape(-1, 2, 3)
    reach = 1.1 * float(np.linalg.norm(np.abs(boxes - site.centre).max(axis=(0, 1))))
    if isinstance(region, Disc):
        prism = 3, occ.addCylinder(0.0, 0.0, -reach, 0.0, 0.0, 2.0 * reach, region.radius)
    else:
        corner = -0.5 * region.length, -0.5 * region.width, -reach
        prism = 3, occ.addBox(*corner, region.length, region.width, 2.0 * reach)
        occ.rotate([prism], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, region.angle)
    x, y, z = site.frame[2]
    # rotation e_z → axis about e_z × axis
    occ.rotate([prism], 0.0, 0.0, 0.0, -y, x, 0.0 if (x or y) else 1.0, math.acos(min(z, 1.0)))
    occ.translate([prism], *site.centre)
    return prism


def mesh_fragments(
    request: MeshRequest,
    bodies: Sequence[DimTag],
    cutters: Sequence[DimTag],
    *,
    size: float,
    sites: Sequence[InterfaceSite] = (),
    refinements: Sequence[str] = (),
) -> LinkMesh:
    """Meshes ``bodies``, conforming to ``cutters``, in the current gmsh model.

    Args:
        bodies: faces or solids of the link.
        cutters: one face or solid per site of the request, which may overlap outside the link only.
        size: element size; lengths are in the model's unit.
        sites: whose pins refine the mesh.
        refinements: further, smaller element sizes, as gmsh expressions.
    """
    occ = gmsh.model.occ
    pieces, origins = occ.fragment(bodies, cutters) if cutters else (bodies, [[body] for body in bodies])
    link = sorted(set().union(*origins[: len(bodies)]))
    held = [set(origin) for origin in origins[len(bodies) :]]
    # parts of cutters outside the link go, with their boundaries; recursion spares entities of the link
    occ.remove(sorted(set(pieces) - set(link)), recursive=True)
    occ.synchronize()
    holders = [[k for k, origin in enumerate(held) if piece in origin] for piece in link]
    if double := [numbers for numbers in holders if len(numbers) > 1]:
        raise request.overlap(*double[0][:2])
    refinements = [*refinements, *_pin_refinements(sites, size, request.segments)]
    field, dim = gmsh.model.mesh.field, bodies[0][0]
    tag = field.add("MathEval")
    field.setString(tag, "F", f"min({', '.join([repr(float(size)), *refinements])})" if refinements else repr(size))
    field.setAsBackgroundMesh(tag)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(2)  # puts the middles of edges on the curves and surfaces they belong to
    return _collect(dim, link, [numbers[0] if numbers else FREE for numbers in holders])


def _pin_refinements(sites: Sequence[InterfaceSite], size: float, segments: int) -> list[str]:
    """Element sizes, as gmsh expressions, that give pins at least ``segments`` segments."""
    expressions = []
    for site in sites:
        if not isinstance(site.region, Disc) or (longest := 2.0 * math.pi * site.region.radius / segments) >= size:
            continue
        squares = []
        for row in site.frame[:2]:
            terms = zip(row, "xyz", site.centre, strict=True)
            squares.append("(" + " + ".join(f"({float(c)!r}) * ({x} - ({float(o)!r}))" for c, x, o in terms) + ")^2")
        away = f"max(0, sqrt({' + '.join(squares)}) - {site.region.radius!r})"
        # just below the longest segment, whose number gmsh rounds
        expressions.append(f"{0.999 * longest!r} + {GRADING.growth} * {away}")
    return expressions


def _collect(dim: int, link: Sequence[DimTag], holders: Sequence[int]) -> LinkMesh:
    """The simplices of the entities ``link``, each with the number of the site that holds it."""
    # corners between which gmsh's cells of second order have their further nodes, in order
    edges = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]}[dim]
    points, row_of = mesh_nodes()
    nodes_of, interface = [], []
    for piece, holder in zip(link, holders, strict=True):
        _, _, (nodes,) = gmsh.model.mesh.getElements(*piece)
        nodes_of.append(row_of[nodes.astype(np.int64)].reshape(-1, dim + 1 + len(edges)))
        interface.append(np.full(len(nodes_of[-1]), holder))
    points, rows = points[:, :dim], np.concatenate(nodes_of)
    cells, ends, middles = rows[:, : dim + 1], rows[:, edges], rows[:, dim + 1 :]
    curved = CurvedEdges.through(points, ends.reshape(-1, 2), points[middles.ravel()])
    return LinkMesh.from_cells(points, cells, np.concatenate(interface), curved)


def mesh_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) of the mesh in the current gmsh model, and the row of each by its tag."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row_of = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row_of[tags.astype(np.int64)] = np.arange(len(tags))
    return coordinates.reshape(-1, 3), row_of


def in_units_of(described: Any, unit: float) -> Any:
    """``described`` (a length, a point, a region, a site or a shape) with its lengths divided by ``unit``."""
    if is_dataclass(described) and not isinstance(described, type):
        lengths = [field.name for field in fields(described) if field.name not in ("angle", "axis", "name")]
        return replace(described, **{name: in_units_of(getattr(described, name), unit) for name in lengths})
    if isinstance(described, tuple):
        return tuple(in_units_of(item, unit) for item in described)
    return round(described / unit, 10)


@dataclass(frozen=True)
class PlaneDrawing:
    """The plan of a link as faces of the plane z = 0 in the current gmsh model, in units of the element size.

    Attributes:
        faces: that make up the link.
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
    # by default layers are about twice as high as the triangles are wide
    layers = request.layers or max(1, round((0.5 if request.half else 1.0) * depth / (2.0 * request.size)))
    return extrude(mesh, depth, layers, half=request.half)
