"""Outlines of flexible links, at rest and loaded, as closed chains of nodes; smooth maxima over them.

The nodes are the vertices of the link's plan on its outer boundary and, where edges bend, their middles: exported parts
are drawn through them. In space it is the boundary of the face of greatest z.

    X = X₀ + c + d at rest,     x = X + u loaded

are linear in the design field d and in the displacement u.

A largest value over an outline has kinks, where its place jumps. Optimisers see the Kreisselmeier–Steinhauser function

    KS(v) = (s / ρ) ln Σ_i exp(ρ v_i / s),     max v ≤ KS(v) ≤ max v + (s / ρ) ln n,

with a typical size s of the v_i and the sharpness ρ, and −KS(−v) for a least value: an extreme beyond the true one, by
the more the more places come near it. What is missing is among the corrections that are added before values are
compared with targets, so that these hold for the true extreme. Source: G. Kreisselmeier, R. Steinhauser, Systematic
control design by optimizing a vector performance index (doi:10.1016/S1474-6670(17)65584-8).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from scipy.sparse import csr_matrix

from fenicsmech.compat import add_ghosts, interpolation_matrix, owned_values
from fenicsmech.errors import DescriptionError
from fenicsmech.export import corners_of
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.meshing import FREE, LinkMesh, boundary_loops, edge_rows, face_of, node_ends
from fenicsmech.model import MechanismModel
from fenicsmech.polygons import strip_width

SHARPNESS = 50.0
"""Default ρ: values within 2 % of their typical size from the largest one count."""


def smooth_maximum(values: np.ndarray, size: float, sharpness: float) -> tuple[float, np.ndarray]:
    """KS of ``values`` (n,) of typical ``size``, and its derivatives by them, (n,)."""
    largest = float(np.max(values))
    shares = np.exp((values - largest) * (sharpness / size))
    total = float(shares.sum())
    return largest + size / sharpness * float(np.log(total)), shares / total


def from_edges(
    points: np.ndarray, starts: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Distances (n,) of points from straight edges, all (n, 2), and their derivatives by each of the three."""
    edge = ends - starts
    share = np.clip(np.sum((points - starts) * edge, axis=1) / np.sum(edge**2, axis=1), 0.0, 1.0)[:, None]
    away = points - starts - share * edge
    distances = np.linalg.norm(away, axis=1)
    away /= np.maximum(distances, 1e-300)[:, None]
    return distances, (away, (share - 1.0) * away, -share * away)  # the nearest point is stationary


class LinkOutline:
    """The outer boundary of one link of a model, counter-clockwise, the same on all ranks.

    Args:
        model: with the link.
        link: the link.
        part: what asks for it, for messages.

    Attributes:
        drawn: positions of the nodes as drawn, (n, 2).
        body: the interface that holds each node, ``FREE`` if none does, (n,).
        corner: which nodes are corners as drawn, (n,).
        width: of the drawn link, 2 A / P.

    Raises:
        DescriptionError: the link has no flat face of greatest z.
    """

    def __init__(self, model: MechanismModel, link: FlexibleLink, part: str) -> None:
        self._model, mesh = model, model.mesh
        cells = mesh.link_of_cell == model.mechanism.flexible_links.index(link)
        loop = _boundary(mesh.vertices, mesh.cells[cells], part)
        ends = loop[:, None, None].repeat(2, axis=2)
        if model.elastic.order > 1:
            middles = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
            ends = np.concatenate([ends, middles[:, None]], axis=1)
        ends = ends.reshape(-1, 2)
        space = model.elastic.shape.function_space
        # owned nodes of s on the outline, and their places there
        owned, order = node_ends(space)[: space.dofmap.index_map.size_local], np.lexsort(ends.T[::-1])
        rows = edge_rows(ends[order], owned)
        self._nodes = np.flatnonzero(rows >= 0)
        self._places, self._count = order[rows[self._nodes]], len(ends)
        self.drawn = self._summed(self._positions(model.elastic.drawn_shape))
        self.width = strip_width(self.drawn)
        body, held = np.full(len(mesh.vertices), FREE), mesh.interface_of_cell != FREE
        body[mesh.cells[held]] = mesh.interface_of_cell[held, None]
        first, last = body[ends].T
        self.body = np.where(first == last, first, FREE)
        self.corner = corners_of(self.drawn)

    def rest(self) -> np.ndarray:
        """X at the design that the model holds, (n, 2)."""
        return self._summed(self._positions(self._model.elastic.shape.x.array))

    def loaded(self) -> np.ndarray:
        """x at the design and the state that the model holds, (n, 2)."""
        elastic = self._model.elastic
        moved = self._motion @ elastic.u.x.array.reshape(-1, elastic.model.dim)[:, :2]
        return self._summed(self._positions(elastic.shape.x.array) + moved)

    def by_design(self, slopes: np.ndarray) -> np.ndarray:
        """∂Q/∂d, this rank's owned values, flat, from ∂Q/∂X or ∂Q/∂x, (n, 2)."""
        shape, dim = self._model.elastic.shape, self._model.elastic.model.dim
        found = np.zeros((len(owned_values(shape)) // dim, dim))
        found[self._nodes, :2] = slopes[self._places]
        return found.ravel()

    def by_state(self, slopes: np.ndarray) -> np.ndarray:
        """∂Q/∂(u, p), this rank's owned values, flat, from ∂Q/∂x (n, 2)."""
        u, *pressures = self._model.elastic.fields
        work = fem.Function(u.function_space)
        nodal = work.x.array.reshape(-1, self._model.elastic.model.dim)
        nodal[:, :2] = self._motion.T @ slopes[self._places]
        add_ghosts(work)
        return np.concatenate([owned_values(work), *(np.zeros(len(owned_values(p))) for p in pressures)])

    def _positions(self, shape: np.ndarray) -> np.ndarray:
        """X₀ + s at this rank's nodes, (k, 2), from all its values of s, flat."""
        dim, space = self._model.elastic.model.dim, self._model.elastic.shape.function_space
        return (space.tabulate_dof_coordinates()[:, :2] + shape.reshape(-1, dim)[:, :2])[self._nodes]

    def _summed(self, own: np.ndarray) -> np.ndarray:
        """Values of all nodes (n, 2) from this rank's (k, 2)."""
        total = np.zeros((self._count, 2))
        total[self._places] = own
        self._model.mesh.mesh.comm.Allreduce(MPI.IN_PLACE, total)
        return total

    @cached_property
    def _motion(self) -> csr_matrix:
        """Weights of the local nodes of u in it at this rank's nodes, (k, local nodes)."""
        u, dim = self._model.elastic.u.function_space, self._model.elastic.model.dim
        index = u.dofmap.index_map
        known = index.local_to_global(np.arange(index.size_local + index.num_ghosts, dtype=np.int32))
        order = np.argsort(known)
        # every component alike
        weights = interpolation_matrix(u, self._model.elastic.shape.function_space)[::dim][self._nodes].tocoo()
        columns = order[np.searchsorted(known[order], weights.col // dim)]
        return csr_matrix((weights.data, (weights.row, columns)), shape=(len(self._nodes), len(known)))


def _boundary(vertices: np.ndarray, cells: np.ndarray, part: str) -> np.ndarray:
    """The vertices on the outer boundary of a link's section, counter-clockwise, (k,)."""
    used = np.unique(cells)
    mesh = LinkMesh.from_cells(vertices, cells, np.full(len(cells), FREE))
    if mesh.dim == 3:
        z, mesh = vertices[used, 2], face_of(mesh, 1.0)
        used = used[z >= z.max() - 1e-6 * np.ptp(z)]
        if len(used) != len(mesh.points):
            raise DescriptionError(
                part, "the link has no flat face of greatest z", "Use links that are flat across their plane"
            )
    return used[boundary_loops(part, mesh)[0]]
