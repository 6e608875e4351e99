"""A link's CAD body in the current gmsh model: cut along its interface regions and meshed.

The element size is the requested one, finer only where small features need it: around pins, for enough segments of
the circle, and in narrow gaps.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.mechanism import Disc
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.link_mesh import CurvedEdges, LinkMesh
from fenicsmech.meshing.request import LEAST_SEGMENTS, InterfaceSite, MeshRequest

DimTag = tuple[int, int]


@dataclass(frozen=True)
class Grading:
    """Gradients of the element size over a link.

    Attributes:
        growth: of the element size per unit of distance from a small feature.
        gap_aspect: length over height of the elements in a narrow gap.
        least_gap_size: least element size in a gap over that next to it; bounds what a vanishing gap may cost.
    """

    growth: float = 1.0
    gap_aspect: float = 4.0
    least_gap_size: float = 0.25


GRADING = Grading()


def circle_segments(radius: float, size: float) -> int:
    """Number of segments of the polygon of a whole circle."""
    return max(LEAST_SEGMENTS, math.ceil(2.0 * math.pi * radius / size))


def gap_refinement(at: Sequence[float], gap: float, radius: float, widening: Sequence[Iterable[float]]) -> str:
    """Element size, as a gmsh expression, in the narrow gap around a disc. Lengths are in element sizes.

    Where the gap widens along straight sides, it has grown to gap + a²/(2 radius) at the distance a; the element
    size follows it, down to a least size, and grows with the distance from the gap.

    Args:
        at: centre of the disc.
        gap: width of the gap where it is narrowest.
        radius: radius of the disc.
        widening: unit vectors along which the gap widens; none if it goes evenly all around.
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
    """The site's region as a face of the plane z = ``height`` in the current gmsh model.

    Args:
        site: the site; its axis must be along z.
        corners: angles (rad) from x at which the outline of a disc has vertices.
        height: z of the face.
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
        cutters: one face or solid per site of the request; only what lies in the link counts.
        size: element size, in the model's unit of length.
        sites: whose pins refine the mesh, in the model's unit of length.
        refinements: further, smaller element sizes, as gmsh expressions.

    Returns:
        The mesh in the model's coordinates; ``interface`` counts the cutters.

    Raises:
        MeshingError: two cutters overlap in the link.
    """
    occ = gmsh.model.occ
    pieces, origins = occ.fragment(bodies, cutters) if cutters else (bodies, [[body] for body in bodies])
    link = sorted(set().union(*origins[: len(bodies)]))
    held = [set(origin) for origin in origins[len(bodies) :]]
    # parts of cutters outside the link go, with their boundaries; recursion spares entities of the link
    occ.remove(sorted(set(pieces) - set(link)), recursive=True)
    occ.synchronize()
    holders = [request.holder([k for k, origin in enumerate(held) if piece in origin]) for piece in link]
    _set_element_size(size, [*refinements, *_pin_refinements(sites, size, request.segments)])
    dim = bodies[0][0]
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(2)  # puts the middles of edges on the curves and surfaces they belong to
    return _collect(dim, link, holders)


def _set_element_size(size: float, refinements: Sequence[str]) -> None:
    """Makes the smallest of ``size`` and ``refinements`` the element size of the current gmsh model."""
    field = gmsh.model.mesh.field
    tag = field.add("MathEval")
    field.setString(tag, "F", f"min({', '.join([repr(float(size)), *refinements])})" if refinements else repr(size))
    field.setAsBackgroundMesh(tag)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)


def _pin_refinements(sites: Sequence[InterfaceSite], size: float, segments: int) -> list[str]:
    """Element sizes, as gmsh expressions, that give pins at least ``segments`` segments."""
    expressions = []
    for site in sites:
        if isinstance(site.region, Disc) and (longest := 2.0 * math.pi * site.region.radius / segments) < size:
            distance = _distance_from_axis(site)
            # just below the longest segment, whose number gmsh rounds
            fine = 0.999 * longest
            expressions.append(f"{fine!r} + {GRADING.growth} * max(0, {distance} - {site.region.radius!r})")
    return expressions


def _distance_from_axis(site: InterfaceSite) -> str:
    squares = []
    for row in site.frame[:2]:
        terms = zip(row, "xyz", site.centre, strict=True)
        squares.append("(" + " + ".join(f"({float(c)!r}) * ({x} - ({float(o)!r}))" for c, x, o in terms) + ")^2")
    return f"sqrt({' + '.join(squares)})"


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
