"""The mesh of one link as plain arrays: simplices, the interface that holds each, and edges that follow curves.

With barycentric coordinates λ a cell covers the points X₀ + c,

    X₀ = Σ λ_i x_i,     c = Σ 4 λ_i λ_j w_ij,

w_ij the bulge of the edge between corners i and j, from the middle of its chord to the curve. Without it a polygon
approximates the outline, an error that shrinks with the square of the element size whatever the order of the
elements. Source: Ciarlet & Raviart, Interpolation theory over curved elements (doi:10.1016/0045-7825(72)90018-0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fenicsmech.checks import point_text
from fenicsmech.errors import MeshingError
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
        """The mesh of ``cells``, turned to positive orientation, without the points that no cell uses.

        Args:
            points: (n, dim) coordinates; cells: (m, dim + 1) rows of ``points``; interface: (m,) site numbers;
                curved: edges between rows of ``points`` that bulge.
        """
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
        pairs = _edges(cells)
        found = np.zeros((*pairs.shape[:2], self.bulges.shape[1]))
        if len(self.ends):
            count = int(max(cells.max(initial=0), self.ends.max())) + 1
            keys, wanted = self.ends @ (count, 1), pairs @ (count, 1)
            order = np.argsort(keys)
            place = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
            hit = keys[place] == wanted
            found[hit] = self.bulges[place[hit]]
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
        dim = points.shape[1]
        bulges, corners = self.of_cells(cells), points[cells]
        bent = np.flatnonzero(np.any(bulges != 0.0, axis=(1, 2)))
        # ∇λ_1 … ∇λ_dim are the rows of the inverse of the edges from corner 0, (cells, corners, dim)
        inverse = np.linalg.inv((corners[bent, 1:] - corners[bent, :1]).transpose(0, 2, 1))
        slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        pairs = list(combinations(range(dim + 1), 2))
        places = np.vstack([np.eye(dim + 1), [(np.eye(dim + 1)[i] + np.eye(dim + 1)[j]) / 2 for i, j in pairs]])
        squeezed = np.zeros(len(cells), dtype=bool)
        for place in places:
            gradient = np.tile(np.eye(dim), (len(bent), 1, 1))
            for number, (i, j) in enumerate(pairs):
                slope = 4.0 * (place[i] * slopes[:, j] + place[j] * slopes[:, i])
                gradient += bulges[bent, number, :, None] * slope[:, None, :]
            squeezed[bent] |= np.linalg.det(gradient) < _LEAST_VOLUME
        return squeezed

    def _scaled(self, cells: np.ndarray, factor: float) -> CurvedEdges:
        """The bulges of the edges of ``cells`` times ``factor``."""
        count = int(max(cells.max(initial=0), self.ends.max(initial=0))) + 1
        touched = np.isin(self.ends @ (count, 1), _edges(cells) @ (count, 1))
        return CurvedEdges(self.ends, np.where(touched[:, None], factor, 1.0) * self.bulges)


def _edges(cells: np.ndarray) -> np.ndarray:
    """Edges of ``cells`` (m, n), pairs of corners in lexical order, the lower vertex first, (m, n (n − 1) / 2, 2)."""
    return np.sort(cells[:, list(combinations(range(cells.shape[1]), 2))], axis=2)


def cell_measures(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed areas or volumes det(x₁ − x₀, …, x_d − x₀) / d! of ``cells`` ((m, d + 1)), shape (m,)."""
    corners = points[cells]
    edges = corners[:, 1:] - corners[:, :1]
    return np.linalg.det(edges) / math.factorial(points.shape[1])


def radius_ratios(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Inradius over circumradius times dim: 1 for the equilateral cell, towards 0 for a sliver.

    Args:
        points: (n, dim) coordinates.
        cells: (m, dim + 1) vertex numbers.

    Returns:
        (m,) values in [0, 1].
    """
    dim = points.shape[1]
    corners = points[cells]
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
    cell = np.tile(np.arange(len(cells)), vertices)
    facet = facet.reshape(-1) + len(cells)
    total = int(facet.max()) + 1
    graph = coo_matrix((np.ones(len(cell)), (cell, facet)), shape=(total, total))
    return connected_components(graph, directed=False)[0]


def boundary_loops(part: str, mesh: LinkMesh) -> tuple[np.ndarray, ...]:
    """The closed polygons that bound a link in the plane.

    Args:
        part: what the mesh belongs to, for messages.
        mesh: triangles.

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
        raise MeshingError(
            part,
            f"the link touches itself in the single point {point_text(mesh.points[vertices[np.argmax(visits)]])}",
            "Give its shape some width there",
        )
    loops = edge_loops(mesh.cells)
    areas = [signed_area(mesh.points[loop]) for loop in loops]
    outlines = sum(area > 0.0 for area in areas)
    if outlines > 1:
        raise MeshingError(
            part, f"the link falls into {outlines} separate pieces", "Describe each piece as a link of its own"
        )
    return tuple(loops[k] for k in sorted(range(len(loops)), key=lambda k: -areas[k]))


def _turned_over(part: str, mesh: LinkMesh, cell: int, count: int) -> MeshingError:
    return MeshingError(
        part,
        f"{count} of its {len(mesh.cells)} triangles are turned over or lie on others, one of them near "
        f"{point_text(mesh.points[mesh.cells[cell]].mean(axis=0))}",
        "Choose a design that deforms the mesh less",
    )
