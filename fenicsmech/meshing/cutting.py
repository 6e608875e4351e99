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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
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
        notch_segments: of a whole circle where the outline is concave, as at holes, notches and fillets, by dimension
            of the mesh. There stress is largest, and quadratic elements get it to about 1 % (benchmarks/stress.py).
        notch_radius: radius of curvature of splines, ellipses and tori over the element size, below which they count as
            notches; arcs, cylinders and spheres always do.
        notch_growth: of the element size per unit of distance from there.
        least_notch_size: least element size there over that of the link; bounds the number of elements.
    """

    growth: float = 1.0
    gap_aspect: float = 4.0
    least_gap_size: float = 0.25
    notch_segments: Mapping[int, int] = field(default_factory=lambda: {2: 40, 3: 40})
    notch_radius: float = 2.0
    notch_growth: Mapping[int, float] = field(default_factory=lambda: {2: 0.35, 3: 0.7})
    least_notch_size: float = 0.02


GRADING = Grading()
_PARTS = {2: 16, 3: 8}  # of curves, or surfaces along each parameter, whose curvature varies


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
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    dim, free = bodies[0][0], [piece for piece, numbers in zip(link, holders, strict=True) if not numbers]
    refinements = [
        *refinements, *_pin_refinements(sites, size, request.segments), *_notch_refinements(link, free, size)
    ]  # fmt: skip
    sizes = gmsh.model.mesh.field
    tag = sizes.add("MathEval")
    sizes.setString(tag, "F", f"min({', '.join([repr(float(size)), *refinements])})" if refinements else repr(size))
    sizes.setAsBackgroundMesh(tag)
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


@dataclass(frozen=True, eq=False)
class _Round:
    """An arc, or a part of a cylinder or a sphere, on the boundary, or the one that osculates a part of it.

    Attributes:
        at: a point of it, (3,).
        bend: from there to the centre, over the square of the radius, (3,).
        axis: unit vector, zero for a sphere, (3,).
        middle: of its points, (3,).
        reach: to the farthest of them.
    """

    at: np.ndarray
    bend: np.ndarray
    axis: np.ndarray
    middle: np.ndarray
    reach: float

    @classmethod
    def of(cls, dim: int, tag: int, size: float) -> list[_Round]:
        """Those of an entity of the boundary of a link of dimension ``dim``, meshed with elements of some ``size``.

        Arcs, cylinders and spheres are round as wholes. Of other curves and surfaces, as ellipses, splines and tori,
        the parts between lines of constant parameters count where they are sharp, a surface by its sharper curvature.
        """
        model, kind = gmsh.model, gmsh.model.getType(dim - 1, tag)
        if kind in ("Line", "Plane"):
            return []
        low, high = (np.array(ends) for ends in model.getParametrizationBounds(dim - 1, tag))
        grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 2 * _PARTS[dim] + 1)] * (dim - 1), indexing="ij"), -1)
        flat = (low + (high - low) * grid).ravel().tolist()
        points = np.reshape(model.getValue(dim - 1, tag, flat), (*grid.shape[:-1], 3))
        slopes = np.reshape(model.getDerivative(dim - 1, tag, flat), (*grid.shape, 3))
        seconds = np.reshape(model.getSecondDerivative(dim - 1, tag, flat), (*grid.shape[:-1], -1, 3))
        seconds = seconds[..., : dim - 1, :]
        # curvature along each parameter: the part of C'' along the normal, over |C'|²; none where these are singular
        squares = np.einsum("...c,...c->...", slopes, slopes)[..., None]
        if dim == 2:
            normals = np.cross([0.0, 0.0, 1.0], slopes[..., 0, :])
        else:
            normals = np.cross(slopes[..., 0, :], slopes[..., 1, :])
        sizes = np.linalg.norm(normals, axis=-1)
        singular = sizes <= 1e-9 * sizes.max()
        squares[singular], sizes[singular] = np.nan, np.nan
        normals /= sizes[..., None]
        bends = np.einsum("...ac,...c->...a", seconds, normals)[..., None] * normals[..., None, :] / squares
        curvatures = np.linalg.norm(bends, axis=-1)

        def osculating(k: tuple[int, ...], around: int, own: np.ndarray) -> _Round:
            axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else slopes[k][1 - around]
            axis = np.zeros(3) if kind == "Sphere" else axis / np.linalg.norm(axis)
            middle = 0.5 * (own.min(axis=0) + own.max(axis=0))
            return cls(points[k], bends[k][around], axis, middle, float(np.linalg.norm(own - middle, axis=1).max()))

        least, largest = (pick(curvatures.reshape(-1, dim - 1), axis=0) for pick in (np.nanmin, np.nanmax))
        rounder = int(np.argmax(least))
        even = 0.0 < largest[rounder] <= (1.0 + 1e-6) * least[rounder]
        if even and (dim == 2 or kind == "Sphere" or largest[1 - rounder] <= 1e-6 * largest[rounder]):
            return [osculating((_PARTS[dim],) * (dim - 1), rounder, points.reshape(-1, 3))]
        found = []
        for part in np.ndindex(*(_PARTS[dim],) * (dim - 1)):
            own = tuple(slice(2 * k, 2 * k + 3) for k in part)
            *sharpest, around = np.unravel_index(np.nanargmax(curvatures[own]), curvatures[own].shape)
            k = tuple(2 * first + int(more) for first, more in zip(part, sharpest, strict=True))
            if curvatures[k][around] * GRADING.notch_radius * size > 1.0:
                found.append(osculating(k, int(around), points[own].reshape(-1, 3)))
        return found

    @property
    def radius(self) -> float:
        return 1.0 / float(np.linalg.norm(self.bend))

    def is_concave(self, facets: np.ndarray, boundary: np.ndarray) -> bool:
        """Whether its centre is not on the side of the link.

        Args:
            facets: corners of the segments or triangles that it is meshed with, (n, dim, 3).
            boundary: those of the whole boundary, (m, dim, 3).
        """
        dim = boundary.shape[1]
        own = facets[np.argmin(np.linalg.norm(facets.mean(axis=1) - self.at, axis=1))]
        length = float(np.linalg.norm(np.ptp(own, axis=0)))
        start = own.mean(axis=0) + 1e-3 * length * self.radius * self.bend
        # a ray from inside crosses the boundary an odd number of times: start + t d = a + Σ u_k e_k
        edges = (boundary[:, 1:] - boundary[:, :1])[..., :dim]
        ray = np.array([0.6180339887, 0.7548776662, 0.5698402910])[:dim]
        matrices = np.concatenate([np.broadcast_to(-ray, (len(edges), 1, dim)), edges], axis=1).transpose(0, 2, 1)
        regular = np.abs(np.linalg.det(matrices)) > 1e-12 * length ** (dim - 1)
        found = np.linalg.solve(matrices[regular], (start - boundary[regular, 0])[:, :dim, None])[..., 0]
        crossed = (found > 0.0).all(axis=1) & (found[:, 1:].sum(axis=1) < 1.0)
        return np.count_nonzero(crossed) % 2 == 0

    @property
    def away(self) -> str:
        """A lower bound of the distance from it, as a gmsh expression."""
        centre = self.at + self.bend * self.radius**2
        along = " + ".join(
            f"({float(a)!r}) * ({x} - ({float(c)!r}))" for a, x, c in zip(self.axis, "xyz", centre, strict=True)
        )
        return (
            f"max(abs(sqrt(max(0, {_square_to(centre)} - ({along})^2)) - {self.radius!r}), "
            f"sqrt({_square_to(self.middle)}) - {self.reach!r})"
        )


def _square_to(at: np.ndarray) -> str:
    """The squared distance from a point, as a gmsh expression."""
    return " + ".join(f"({x} - ({float(c)!r}))^2" for x, c in zip("xyz", at, strict=True))


def _notch_refinements(link: Sequence[DimTag], free: Sequence[DimTag], size: float) -> list[str]:
    """Element sizes, as gmsh expressions, at concave curves and surfaces on the boundary of what can deform."""
    dim = link[0][0]
    outer = sorted({abs(tag) for _, tag in gmsh.model.getBoundary(link, combined=True, oriented=False)})
    own = {tag for _, tag in gmsh.model.getBoundary(free, combined=False, oriented=False)}
    share, least = 2.0 * math.pi / GRADING.notch_segments[dim], size * GRADING.least_notch_size
    rounds = [(tag, found) for tag in outer if tag in own for found in _Round.of(dim, tag, size)]
    small = [(tag, found) for tag, found in rounds if share * found.radius < size]
    if not small:
        return []
    gmsh.model.mesh.generate(dim - 1)
    points, row_of = mesh_nodes()
    facets = {}
    for tag in outer:
        _, _, (nodes,) = gmsh.model.mesh.getElements(dim - 1, tag)
        facets[tag] = points[row_of[nodes.astype(np.int64)].reshape(-1, dim)]
    gmsh.model.mesh.clear()
    boundary = np.concatenate(list(facets.values()))
    return [
        f"{max(share * found.radius, least)!r} + {GRADING.notch_growth[dim]} * {found.away}"
        for tag, found in small
        if found.is_concave(facets[tag], boundary)
    ]


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
