"""The mesh of one link as plain arrays: simplices, the interface that holds each, and edges that follow curves; the
meshes of all links as one distributed dolfinx mesh of disconnected components.

With barycentric coordinates λ a cell covers the points X₀ + c,

    X₀ = Σ λ_i x_i,     c = Σ 4 λ_i λ_j w_ij,

w_ij the bulge of the edge between corners i and j, from the middle of its chord to the curve. Without it a polygon
approximates the outline, an error that shrinks with the square of the element size whatever the order of the
elements. Source: Ciarlet & Raviart, Interpolation theory over curved elements (doi:10.1016/0045-7825(72)90018-0).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenicsmech.collective import from_one
from fenicsmech.compat import cell_dofs, cell_nodes, create_mesh, original_cells, original_nodes, vector_space
from fenicsmech.errors import MeshingError, point_text
from fenicsmech.polygons import edge_loops, signed_area

FREE = -1

_LEAST_VOLUME = 0.3  # least det ∂(X₀ + c)/∂X₀ in a cell


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A conforming simplex mesh of one link, in read-only arrays.

    Attributes:
        points: vertex coordinates, shape (n, dim), in the user's unit of length. Every vertex belongs to a cell.
        cells: vertex numbers, shape (m, dim + 1): triangles or tetrahedra of positive volume.
        interface: shape (m,): the index of the interface site that holds the cell, ``FREE`` (-1) if none does.
        curved: edges that follow a curve.
    """

    points: np.ndarray
    cells: np.ndarray
    interface: np.ndarray
    curved: CurvedEdges

    def __post_init__(self) -> None:
        for array in (self.points, self.cells, self.interface, self.curved.ends, self.curved.bulges):
            array.setflags(write=False)

    @property
    def dim(self) -> int:
        """Dimension of the space the link is meshed in."""
        return self.points.shape[1]

    @classmethod
    def from_cells(
        cls, points: np.ndarray, cells: np.ndarray, interface: np.ndarray, curved: CurvedEdges | None = None
    ) -> LinkMesh:
        """The mesh of ``cells`` (rows of ``points``), turned to positive orientation, without the points that no cell
        uses."""
        used, renumbered = np.unique(cells, return_inverse=True)
        numbers = np.full(len(points), -1)
        numbers[used] = np.arange(len(used))
        edges = (curved or CurvedEdges.none(points.shape[1])).renumbered(numbers)
        points = np.array(points[used], dtype=np.float64)
        cells = renumbered.reshape(cells.shape).astype(np.int64)
        turned = cell_measures(points, cells) < 0.0
        cells[turned, -2:] = cells[turned, :-3:-1]
        return cls(points, cells, np.array(interface, dtype=np.int32), edges.limited(points, cells))

    def cells_of(self, site: int) -> np.ndarray:
        """The cells (k, dim + 1) that the interface ``site`` holds; ``FREE`` gives the flexible ones."""
        return self.cells[self.interface == site]

    def quartered(self) -> LinkMesh:
        """Triangles, each cut in four at the middles of its edges, with the same outline.

        At a quarter of its way a curved edge bulges by ¾ w, half of w above the new chord: new edges bulge by ¼ w.
        """
        points, cells, count = self.points, self.cells, len(self.points)
        edges = _edges(cells)[:, ::-1]  # the k-th one lies opposite corner k
        unique, numbers = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        a, b, c = numbers.reshape(-1, 3).T + count
        parts = [(cells[:, 0], c, b), (cells[:, 1], a, c), (cells[:, 2], b, a), (a, b, c)]
        middles, rows = points[unique].mean(axis=1), edge_rows(unique, self.curved.ends)
        middles[rows] += self.curved.bulges
        ends = np.vstack([np.column_stack([end, rows + count]) for end in self.curved.ends.T])
        return LinkMesh.from_cells(
            np.vstack([points, middles]),
            np.vstack([np.column_stack(part) for part in parts]),
            np.tile(self.interface, 4),
            CurvedEdges(ends, np.tile(0.25 * self.curved.bulges, (2, 1))),
        )


@dataclass(frozen=True, eq=False)
class CurvedEdges:
    """The curved edges of a mesh; all others are straight.

    Attributes:
        ends: vertex numbers of each, the lower one first, (k, 2).
        bulges: w, (k, dim).
    """

    ends: np.ndarray
    bulges: np.ndarray

    @classmethod
    def none(cls, dim: int) -> CurvedEdges:
        """No edge of a mesh in ``dim`` dimensions."""
        return cls(np.zeros((0, 2), np.int64), np.zeros((0, dim)))

    @classmethod
    def through(cls, points: np.ndarray, ends: np.ndarray, middles: np.ndarray) -> CurvedEdges:
        """The edges whose ``middles`` (m, dim) lie off the chords between their ``ends`` (m, 2) in ``points``.

        Edges may be given once for every cell they belong to.
        """
        ends, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
        a, b = points[ends[:, 0]], points[ends[:, 1]]
        bulges = middles[first] - 0.5 * (a + b)
        # less than 1e-6 of the chord is the rounding of the CAD kernel
        curved = np.linalg.norm(bulges, axis=1) > 1e-6 * np.linalg.norm(b - a, axis=1)
        return cls(ends[curved], bulges[curved])

    def renumbered(self, numbers: np.ndarray) -> CurvedEdges:
        """The same edges when vertex i is called ``numbers[i]``; those with an end called −1 are left out."""
        ends = numbers[self.ends]
        kept = (ends >= 0).all(axis=1)
        return CurvedEdges(np.sort(ends[kept], axis=1), self.bulges[kept])

    def times(self, factor: float) -> CurvedEdges:
        """The edges of the mesh whose lengths are all ``factor`` times these."""
        return CurvedEdges(self.ends, factor * self.bulges)

    def of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Bulges of the edges of ``cells`` (m, n), pairs of corners in lexical order, (m, n (n − 1) / 2, dim)."""
        rows = edge_rows(self.ends, _edges(cells))
        found = np.zeros((*rows.shape, self.bulges.shape[1]))
        found[rows >= 0] = self.bulges[rows[rows >= 0]]
        return found

    def limited(self, points: np.ndarray, cells: np.ndarray) -> CurvedEdges:
        """These edges, less curved (halved up to six times, straight at last) where they squeeze a cell too much."""
        edges = self
        for factor in (*[0.5] * 6, 0.0) if len(self.ends) else ():
            squeezed = edges._squeezed(points, cells)
            if not squeezed.any():
                break
            edges = edges._scaled(cells[squeezed], factor)
        return edges

    def _squeezed(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Mask (m,) of cells that the map compresses below the least volume at a corner or the middle of an edge."""
        return least_stretches(points[cells], self.of_cells(cells)) < _LEAST_VOLUME

    def _scaled(self, cells: np.ndarray, factor: float) -> CurvedEdges:
        """The bulges of the edges of ``cells`` times ``factor``."""
        touched = edge_rows(_edges(cells).reshape(-1, 2), self.ends) >= 0
        return CurvedEdges(self.ends, np.where(touched[:, None], factor, 1.0) * self.bulges)


def _edges(cells: np.ndarray) -> np.ndarray:
    """Edges of ``cells`` (m, n), pairs of corners in lexical order, the lower vertex first, (m, n (n − 1) / 2, 2)."""
    return np.sort(cells[:, list(combinations(range(cells.shape[1]), 2))], axis=2)


def edge_rows(known: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The first row of ``known`` edges (k, 2) that each of the ``wanted`` (…, 2) is, −1 where none is, (…,).

    Edges are pairs of vertex numbers, the lower one first.
    """
    if not len(known):
        return np.full(wanted.shape[:-1], -1)
    count = int(max(known.max(), wanted.max(initial=0))) + 1
    keys, sought = known @ (count, 1), wanted @ (count, 1)
    order = np.argsort(keys, kind="stable")
    rows = order[np.minimum(np.searchsorted(keys, sought, sorter=order), len(keys) - 1)]
    return np.where(keys[rows] == sought, rows, -1)


def edge_corners(corners: int) -> np.ndarray:
    """Corners at the ends of the edges of a cell with so many, in the order of its quadratic nodes, (edges, 2).

    Edges of the reference simplex are numbered by the corners that they do not touch, from the last pair to the first.
    """
    return np.array(list(combinations(range(corners), 2)))[::-1]


def node_ends(space: fem.FunctionSpace) -> np.ndarray:
    """Vertices of the whole mesh at the ends of the edge of every local node of linear or quadratic fields, (nodes, 2).

    The lower one is first; nodes at vertices have theirs twice.
    """
    numbers, nodes = original_nodes(space.mesh)[cell_nodes(space.mesh)], cell_dofs(space)
    index, corners = space.dofmap.index_map, numbers.shape[1]
    ends = np.empty((index.size_local + index.num_ghosts, 2), dtype=np.int64)
    ends[nodes[:, :corners]] = numbers[..., None]
    if nodes.shape[1] > corners:
        ends[nodes[:, corners:]] = np.sort(numbers[:, edge_corners(corners)], axis=2)
    return ends


def least_stretches(corners: np.ndarray, bulges: np.ndarray) -> np.ndarray:
    """The least det ∂(X₀ + c)/∂X₀ at corners and middles of edges of each cell, (m,).

    Args:
        corners: X₀ of the cells' corners, (m, dim + 1, dim).
        bulges: of their edges, pairs of corners in lexical order, (m, pairs, dim).
    """
    dim = corners.shape[2]
    bent = np.flatnonzero(np.any(bulges != 0.0, axis=(1, 2)))
    # ∇λ_1 … ∇λ_dim are the rows of the inverse of the edges from corner 0, (cells, corners, dim)
    inverse = np.linalg.inv((corners[bent, 1:] - corners[bent, :1]).transpose(0, 2, 1))
    slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    corner, (i, j) = np.eye(dim + 1), np.transpose(list(combinations(range(dim + 1), 2)))
    places = np.vstack([corner, 0.5 * (corner[i] + corner[j])])
    # ∇(4 λ_i λ_j) = Σ_c weight_c ∇λ_c at each place
    weights = 4.0 * (places[:, i, None] * corner[j] + places[:, j, None] * corner[i])
    gradient = np.eye(dim) + bulges[bent].transpose(0, 2, 1)[:, None] @ (weights @ slopes[:, None])
    least = np.ones(len(corners))
    least[bent] = np.linalg.det(gradient).min(axis=1)
    return least


def cell_measures(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed areas or volumes det(x₁ − x₀, …, x_d − x₀) / d! of ``cells`` ((m, d + 1)), shape (m,)."""
    corners = points[cells]
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / math.factorial(points.shape[1])


def radius_ratios(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Inradius over circumradius times dim of ``cells`` (m, dim + 1): 1 where equilateral, towards 0 for a sliver."""
    dim, corners = points.shape[1], points[cells]
    facets = sum(_facet_measures(corners[:, list(kept)]) for kept in combinations(range(dim + 1), dim))
    inradius = dim * np.abs(cell_measures(points, cells)) / facets
    # circumcentre c (relative to the first corner): 2 e_k · c = e_k · e_k for every edge e_k from that corner
    edges = corners[:, 1:] - corners[:, :1]
    squares = np.einsum("mkd,mkd->mk", edges, edges)
    circumcentre = np.linalg.solve(2.0 * edges, squares[..., None])[..., 0]
    return dim * inradius / np.linalg.norm(circumcentre, axis=1)


def _facet_measures(corners: np.ndarray) -> np.ndarray:
    """Lengths of edges (m, 2, 2) or areas of triangles (m, 3, 3) from the Gram determinant."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    return np.sqrt(np.linalg.det(gram)) / (corners.shape[1] - 1)


def count_pieces(cells: np.ndarray) -> int:
    """Number of parts of the mesh that no edge (of triangles) or face (of tetrahedra) connects."""
    vertices = cells.shape[1]
    facets = np.concatenate([cells[:, list(kept)] for kept in combinations(range(vertices), vertices - 1)])
    _, facet = np.unique(np.sort(facets, axis=1), axis=0, return_inverse=True)
    return int(parts_of(facet.reshape(vertices, -1).T).max()) + 1


def parts_of(entities: np.ndarray) -> np.ndarray:
    """The part of each entity, (k,), from 0 on, of entities (k, n) that hang together where they share a number."""
    known, number = np.unique(entities, return_inverse=True)
    count, rows = len(entities), np.repeat(np.arange(len(entities)), entities.shape[1])
    graph = coo_matrix((np.ones(len(rows)), (rows, count + number.reshape(-1))), shape=(count + len(known),) * 2)
    return connected_components(graph, directed=False)[1][:count]


def boundary_loops(part: str, mesh: LinkMesh) -> tuple[np.ndarray, ...]:
    """The closed polygons that bound the triangles ``mesh`` of ``part``.

    Returns:
        Vertex numbers (k,) of each polygon, the first not repeated at the end: the outline, counter-clockwise, then
        the holes, clockwise, so that the link lies to the left of every edge.

    Raises:
        MeshingError: a triangle is turned over, the link falls apart or touches itself in a point.
    """
    measures = cell_measures(mesh.points, mesh.cells)
    if np.any(measures <= 0.0):
        raise _turned_over(part, mesh, int(np.argmin(measures)), np.count_nonzero(measures <= 0.0))
    # with all triangles counter-clockwise every edge inside is run through once in each direction
    edges = mesh.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    count = len(mesh.points)
    forth, back = edges @ (count, 1), edges[:, ::-1] @ (count, 1)
    _, first, repeats = np.unique(forth, return_index=True, return_counts=True)
    if np.any(repeats > 1):
        raise _turned_over(part, mesh, int(first[np.argmax(repeats)]) // 3, np.count_nonzero(repeats > 1))
    vertices, visits = np.unique(edges[~np.isin(forth, back), 0], return_counts=True)
    if np.any(visits > 1):
        where = point_text(mesh.points[vertices[np.argmax(visits)]])
        problem = f"the link touches itself in the single point {where}"
        raise MeshingError(part, problem, "Give its shape some width there")
    loops = edge_loops(mesh.cells)
    areas = [signed_area(mesh.points[loop]) for loop in loops]
    outlines = sum(area > 0.0 for area in areas)
    if outlines > 1:
        problem = f"the link falls into {outlines} separate pieces"
        raise MeshingError(part, problem, "Describe each piece as a link of its own")
    return tuple(loops[k] for k in sorted(range(len(loops)), key=lambda k: -areas[k]))


def boundary_polygons(part: str, mesh: LinkMesh) -> list[np.ndarray]:
    """The polygons (k, 2) of ``boundary_loops``, with the middles of curved edges between their ends."""
    polygons = []
    for loop in boundary_loops(part, mesh):
        points, bulges = mesh.points[loop], mesh.curved.of_cells(np.column_stack([loop, np.roll(loop, -1)]))[:, 0]
        middles = 0.5 * (points + np.roll(points, -1, axis=0)) + bulges
        shown = np.column_stack([np.ones(len(loop), dtype=bool), np.any(bulges != 0.0, axis=1)])
        polygons.append(np.stack([points, middles], axis=1)[shown])
    return polygons


def _turned_over(part: str, mesh: LinkMesh, cell: int, count: int) -> MeshingError:
    return MeshingError(
        part,
        f"triangles are turned over or lie on others: {count} of {len(mesh.cells)}, for example near "
        f"{point_text(mesh.points[mesh.cells[cell]].mean(axis=0))}",
        "Choose a design that deforms the mesh less",
    )


def extrude(plan: LinkMesh, depth: float, layers: int, *, half: bool = False) -> LinkMesh:
    """The tetrahedra over ``plan`` between z = −depth/2 and z = depth/2, in ``layers`` equal layers.

    Fields that are the same all through the depth are fields on the plan: on tetrahedra whose vertices stand on the
    three corners of a triangle such a field has exactly no gradient along z.

    A prism over the triangle a < b < c (numbers of its vertices in ``plan``), with a′, b′, c′ above them, is cut into
    abcc′, abb′c′ and aa′b′c′. The diagonal of a side then joins the lower number below with the higher above, in both
    of its neighbours. Layers above the middle are mirror images of those below, so with an even number of layers the
    mesh is symmetric about z = 0, and plane loads cause no motion out of the plane.

    Args:
        plan: the triangulation; its ``interface`` numbers pass on to the cells above.
        depth: extent along z.
        layers: number of layers, at least 1.
        half: only the upper half, z ≥ 0, of the mesh with twice as many layers.
    """
    heights = np.linspace(0.0 if half else -0.5 * depth, 0.5 * depth, layers + 1)
    count, middle = len(plan.points), 0 if half else (layers + 1) // 2
    points = np.column_stack([np.tile(plan.points, (layers + 1, 1)), np.repeat(heights, count)])
    a, b, c = np.sort(plan.cells, axis=1).T
    sides = [(layer, layer + 1) if layer < middle else (layer + 1, layer) for layer in range(layers)]
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
            ends = column[link.curved.ends]
            middles = points[ends].mean(axis=1) + link.curved.bulges[:, :2]
            curved = CurvedEdges.through(points, ends, middles)
            return Plan(LinkMesh.from_cells(points, triangles, link.interface[below], curved), column)
    return Plan(link, np.arange(len(link.points)))


def section_of(link: LinkMesh) -> LinkMesh:
    """The triangles of a link's plan; of a solid that is not extruded those of its face of greatest z."""
    plan = plan_of(link).mesh
    return plan if plan.dim == 2 else face_of(link, 1.0)


def face_of(solid: LinkMesh, side: float) -> LinkMesh:
    """The triangles of a solid's face of greatest z, or of least z with ``side`` −1."""
    z = side * solid.points[:, 2]
    on_face = z >= z.max() - 1e-6 * np.ptp(z)
    facets = np.concatenate([np.delete(solid.cells, corner, axis=1) for corner in range(4)])
    triangles = np.unique(np.sort(facets[on_face[facets].all(axis=1)], axis=1), axis=0)
    curved = CurvedEdges(solid.curved.ends, solid.curved.bulges[:, :2])
    return LinkMesh.from_cells(solid.points[:, :2], triangles, np.full(len(triangles), FREE), curved)


@dataclass(frozen=True)
class MechanismMesh:
    """The reference mesh of all flexible links.

    Attributes:
        mesh: the distributed mesh; its coordinates change only while a file of the links at rest is written.
        link: index of the flexible link of each cell on this rank (ghosts last), (cells,).
        interface: index among all interfaces of the mechanism, −1 in free cells, (cells,).
        vertices, cells: the whole mesh as one array each, on every rank: (n, dim), (m, dim + 1).
        link_of_cell, interface_of_cell: as ``link`` and ``interface`` of each of ``cells``, (m,).
        curved: edges of the whole mesh that follow curves, on every rank.
        comm: the communicator; the mesh itself keeps a duplicate.
    """

    mesh: dmesh.Mesh
    link: np.ndarray
    interface: np.ndarray
    vertices: np.ndarray
    cells: np.ndarray
    link_of_cell: np.ndarray
    interface_of_cell: np.ndarray
    curved: CurvedEdges
    comm: MPI.Comm

    def on(self, comm: MPI.Comm) -> MechanismMesh:
        """The same mesh, distributed over ``comm``."""
        whole = self.vertices, self.cells, self.link_of_cell, self.interface_of_cell, self.curved
        return _distributed(comm, *whole)

    def quartered(self) -> MechanismMesh:
        """Its triangles, each cut in four, see ``LinkMesh.quartered``, distributed over the same processes."""
        whole = LinkMesh(self.vertices, self.cells, self.interface_of_cell, self.curved).quartered()
        link = np.tile(self.link_of_cell, 4)
        return _distributed(self.comm, whole.points, whole.cells, link, whole.interface, whole.curved)

    def corners(self, cells: np.ndarray) -> np.ndarray:
        """Corner coordinates of local ``cells``, (cells, dim + 1, dim)."""
        return self.mesh.geometry.x[cell_nodes(self.mesh)[cells]][..., : self.vertices.shape[1]]


def distribute(comm: MPI.Comm, link_meshes: Sequence[LinkMesh] | None) -> MechanismMesh:
    """Distributes ``link_meshes`` (given on rank 0 only) over ``comm``; interfaces are numbered link after link."""
    return _distributed(comm, *from_one(comm, lambda: _joined(link_meshes or ())))


def _distributed(
    comm: MPI.Comm,
    vertices: np.ndarray,
    cells: np.ndarray,
    link: np.ndarray,
    interface: np.ndarray,
    curved: CurvedEdges,
) -> MechanismMesh:
    """The whole mesh, known on every rank, distributed over ``comm``."""
    here = slice(None) if comm.rank == 0 else slice(0)
    mesh = create_mesh(comm, cells[here], vertices[here])
    own = original_cells(mesh)
    return MechanismMesh(mesh, link[own], interface[own], vertices, cells, link, interface, curved, comm)


def _joined(meshes: Sequence[LinkMesh]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, CurvedEdges]:
    """Vertices, cells, link and interface of each cell, and curved edges of all ``meshes``."""
    nodes = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    sites = np.cumsum([0, *(int(mesh.interface.max(initial=-1)) + 1 for mesh in meshes)])
    return (
        np.concatenate([mesh.points for mesh in meshes]),
        np.concatenate([mesh.cells + first for mesh, first in zip(meshes, nodes, strict=False)]).astype(np.int64),
        np.repeat(np.arange(len(meshes)), [len(mesh.cells) for mesh in meshes]),
        np.concatenate(
            [np.where(m.interface >= 0, m.interface + k, FREE) for m, k in zip(meshes, sites, strict=False)]
        ),
        CurvedEdges(
            np.concatenate([mesh.curved.ends + first for mesh, first in zip(meshes, nodes, strict=False)]),
            np.concatenate([mesh.curved.bulges for mesh in meshes]),
        ),
    )


def bulge_field(mesh: MechanismMesh) -> fem.Function | None:
    """c of curved cells (see ``link_mesh``) as a quadratic vector field; None if all edges are straight."""
    if not len(mesh.curved.ends):
        return None
    bulge = fem.Function(vector_space(mesh.mesh, 2), name="bulge")
    dim = mesh.vertices.shape[1]
    values, nodes = bulge.x.array.reshape(-1, dim), cell_dofs(bulge.function_space)
    found = mesh.curved.of_cells(original_nodes(mesh.mesh)[cell_nodes(mesh.mesh)])
    curved = np.flatnonzero(np.any(found != 0.0, axis=(1, 2)))
    values[nodes[curved, dim + 1 :]] = found[curved][:, ::-1]  # see ``edge_corners``
    return bulge


def on_mid_plane(points: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Mask (n,) of this rank's ``points`` (n, 3) of half links that lie on their mid-plane."""
    height = comm.allreduce(float(points[:, 2].max(initial=0.0)), op=MPI.MAX)
    return points[:, 2] <= 1e-9 * height  # but for rounding
