"""Nodes and material points as functions of body poses, nodal displacements and the design.

Interface nodes follow body poses, with the pose (t, R) and the centre c of a body and the node X_i at rest:

    u_i = t + (R − I)(X_i − c).

All nodes of the cells in an interface are eliminated from the unknowns; each follows the pose of its body. Where bodies
move in the plane while the mesh is one half of the links in space, this includes u_z = 0, which also holds on the
mid-plane z = 0.

Rest positions of all nodes follow the design field d, d_i = Σ_k N_k(X_i) d_k.

Material points that forces act on and displacements are read from:

    on a rigid link:     u(z) = t + (R − I)(P − c)
    on a flexible link:  u = Σ_i N_i(P) u_i

with the shape functions N_i of the cell that holds P, or their averages over a region.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, count
from math import comb

import basix
import numpy as np
from dolfinx import fem
from scipy.sparse import csr_matrix

from fenicsmech.compat import add_ghosts, cell_dofs, interpolation_matrix, owned_values
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import RigidSpace
from fenicsmech.meshing import on_mid_plane


class InterfaceMap:
    """The nodes of each interface body on this rank.

    Args:
        u: displacement field, whose local nodes are ``drawn`` at (nodes, dim).
        cell_body: index of the body each local cell belongs to, −1 if it is free, (cells,).
        centres: reference centre of every body, (bodies, dim).
        space: rigid-body coordinates.

    Attributes:
        body: body of every local node of u, −1 if free, (owned + ghost nodes,); the same on all ranks.
        owned: number of owned nodes.
        block: displacements per node.
        unknown: whether each owned displacement is an unknown, (owned nodes, block).
        positions: of all local nodes at the present rest shape, (nodes, dim).
        nodes: local eliminated nodes, owned and ghost, per body.
        offsets: X_i − c of these nodes.
    """

    def __init__(
        self, u: fem.Function, drawn: np.ndarray, cell_body: np.ndarray, centres: np.ndarray, space: RigidSpace
    ) -> None:
        self.space, self._u, self._cell_body, self._centres = space, u, cell_body, centres
        V = u.function_space
        self.block, self.owned = V.dofmap.index_map_bs, V.dofmap.index_map.size_local
        self.body = self._body_of_nodes()
        self.nodes = {int(b): np.flatnonzero(self.body == b) for b in np.unique(self.body[self.body >= 0])}
        self._drawn = self.positions = drawn[:, : space.dim]
        self.offsets = self._from_centres()
        self._mid_plane = np.zeros(len(self.body), dtype=bool)
        if space.dim < self.block:
            self._mid_plane = on_mid_plane(V.tabulate_dof_coordinates(), V.mesh.comm)
        self.unknown = np.tile(self.body[: self.owned, None] < 0, self.block)
        self.unknown[self._mid_plane[: self.owned], space.dim :] = False

    def on(self, u: fem.Function) -> InterfaceMap:
        """The same interfaces of a field of order 1, whose nodes are vertices."""
        drawn = u.function_space.tabulate_dof_coordinates()
        return InterfaceMap(u, drawn, self._cell_body, self._centres, self.space)

    def reshape(self, design: np.ndarray) -> None:
        """Takes the design at all local nodes, (nodes, dim): added to the drawn positions."""
        self.positions = self._drawn + design[:, : self.space.dim]
        self.offsets = self._from_centres()

    def _from_centres(self) -> dict[int, np.ndarray]:
        return {b: self.positions[nodes] - self._centres[b] for b, nodes in self.nodes.items()}

    def _body_of_nodes(self) -> np.ndarray:
        """Body of every local node; a node may touch an interface cell only on another rank."""
        marker = fem.Function(self._u.function_space)
        local = marker.x.array.reshape(-1, self.block)
        cells = np.flatnonzero(self._cell_body >= 0)
        nodes = cell_dofs(self._u.function_space)[cells]
        local[nodes, 0] = self._cell_body[cells, None] + 1
        local[nodes, 1] = 1
        # sums over ranks of (body + 1) and of the number of ranks that marked the node
        add_ghosts(marker)
        marker.x.scatter_forward()
        return np.rint(local[:, 0] / np.maximum(local[:, 1], 1.0)).astype(int) - 1

    def nodal(self, u: np.ndarray) -> np.ndarray:
        """A view of displacements ``u`` of owned nodes, flat, maybe followed by others: (owned nodes, dim)."""
        return u[: self.owned * self.block].reshape(-1, self.block)[:, : self.space.dim]

    def places(self, u: np.ndarray) -> np.ndarray:
        """Of the owned nodes, displaced by ``u``, (owned nodes, dim)."""
        return self.positions[: self.owned] + self.nodal(u)

    def place(self, poses: np.ndarray) -> None:
        """Sets the eliminated displacements from ``poses`` (bodies, pose_size)."""
        values, dim = self._u.x.array.reshape(-1, self.block), self.space.dim
        for body, nodes in self.nodes.items():
            values[nodes, :dim] = self.space.displace(poses[body], self.offsets[body])
            values[nodes, dim:] = 0.0
        values[self._mid_plane, dim:] = 0.0

    def gradient_rows(self, poses: np.ndarray, body: int) -> tuple[np.ndarray, np.ndarray]:
        """∂u/∂z for the owned nodes of ``body``: local nodes (n,) and (n, dim, pose_size), dim that of the space."""
        mine = self.nodes[body] < self.owned
        return self.nodes[body][mine], self.space.displacement_gradient(poses[body], self.offsets[body][mine])

    def moments(self, forces: np.ndarray) -> dict[int, np.ndarray]:
        """Σ f_i ⊗ (X_i − c) over the owned nodes of each body, from nodal ``forces`` (owned nodes, block)."""
        moments = {}
        for body, nodes in self.nodes.items():
            mine = nodes < self.owned
            moments[body] = forces[nodes[mine], : self.space.dim].T @ self.offsets[body][mine]
        return moments


class DesignAtNodes:
    """Interpolation of design fields, vectors on the space ``coarse``, at the nodes of the Lagrange space ``fine``."""

    def __init__(self, coarse: fem.FunctionSpace, fine: fem.FunctionSpace) -> None:
        self._at_vertices, self._at_nodes = fem.Function(coarse), fem.Function(fine)
        index, self._dim = coarse.dofmap.index_map, coarse.dofmap.index_map_bs
        # every component alike
        weights = interpolation_matrix(coarse, fine)[:: self._dim]
        vertices = index.local_to_global(np.arange(index.size_local + index.num_ghosts, dtype=np.int32))
        order = np.argsort(vertices)
        columns = order[np.searchsorted(vertices[order], weights.indices // self._dim)]
        self._matrix = csr_matrix((weights.data, columns, weights.indptr), shape=(weights.shape[0], len(vertices)))

    def values(self, design: np.ndarray) -> np.ndarray:
        """A field at all local nodes of ``fine``, (nodes, dim), from this rank's values with ghosts, flat."""
        owned_values(self._at_nodes)[:] = (self._matrix @ design.reshape(-1, self._dim)).ravel()
        self._at_nodes.x.scatter_forward()
        return self._at_nodes.x.array.reshape(-1, self._dim).copy()

    def transpose(self, nodal: np.ndarray) -> np.ndarray:
        """Nᵀ ``nodal`` ((owned nodes of ``fine``, dim)), this rank's owned values on ``coarse``, flat."""
        self._at_vertices.x.array[:] = (self._matrix.T @ nodal).ravel()
        add_ghosts(self._at_vertices)
        return owned_values(self._at_vertices).copy()


@dataclass(frozen=True)
class BodyPoint:
    """A point at ``offset`` (dim,) from the centre of body ``body``."""

    body: int
    offset: np.ndarray
    space: RigidSpace

    def displacement(self, u: fem.Function | None, poses: np.ndarray) -> np.ndarray:
        """u from the drawn configuration, (dim,)."""
        return self.space.displace(poses[self.body], self.offset[None])[0]

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂u/∂z, (dim, pose_size)."""
        return self.space.displacement_gradient(poses[self.body], self.offset[None])[0]

    def hessian(self, poses: np.ndarray, force: np.ndarray) -> np.ndarray:
        """force · ∂²u/∂z², (pose_size, pose_size)."""
        return self.space.displacement_hessian(poses[self.body], np.outer(force, self.offset))


@dataclass(frozen=True)
class LinkPoint:
    """A point of a flexible link, or the average over a region of it.

    ``global_nodes`` are numbered over all ranks, ``weights`` are N_i(P), or the averages of N_i, on every rank, (n,).
    """

    global_nodes: np.ndarray
    weights: np.ndarray

    def displacement(self, u: fem.Function, poses: np.ndarray) -> np.ndarray:
        """As that of ``BodyPoint``."""
        V = u.function_space
        own = self.global_nodes - V.dofmap.index_map.local_range[0]
        mine = (own >= 0) & (own < V.dofmap.index_map.size_local)
        here = self.weights[mine] @ u.x.array.reshape(-1, V.dofmap.index_map_bs)[own[mine]]
        return V.mesh.comm.allreduce(here)


@dataclass(frozen=True, eq=False)
class PlacedPoint:
    """A material point of a flexible link, or the average over a region of it, in another shape than the drawn one.

        u = Σ_k w_k u(Y_k)

    Attributes:
        positions: Y_k in this shape, (n, dim).
        weights: w_k, (n,).
    """

    positions: np.ndarray
    weights: np.ndarray


_OFF = 0.01  # largest distance of a drawn point from its link, in cells
_OFF_OUTLINE = 0.25  # of one placed on the outline, which another mesh replaces by other curves


def link_point(
    part: str,
    position: np.ndarray,
    u: fem.Function,
    cells: np.ndarray,
    vertices: np.ndarray,
    bulges: np.ndarray,
    *,
    placed: bool = False,
) -> LinkPoint:
    """The point at ``position`` on a flexible link.

    Args:
        part: for messages.
        position: (dim,).
        u: displacement field.
        cells: owned cells of the link on this rank.
        vertices: their corner coordinates, (cells, dim + 1, dim).
        bulges: of their edges, pairs of corners in lexical order, (cells, pairs, dim).
        placed: whether the point was drawn on another mesh.

    Raises:
        DescriptionError: the point lies outside the link by more than a hundredth of a cell, a placed one by more than
            a quarter.
    """
    V, comm, corners = u.function_space, u.function_space.mesh.comm, len(position) + 1
    low, high = vertices.min(axis=1), vertices.max(axis=1)
    margin = 0.5 * (high - low).max(axis=1, keepdims=True) + np.abs(bulges).max(axis=(1, 2), initial=0.0)[:, None]
    near = np.all((low - margin <= position) & (position <= high + margin), axis=1)
    cells, vertices, bulges = cells[near], vertices[near], bulges[near]
    barycentric = _barycentric(position, vertices, bulges) if len(cells) else np.full((1, corners), -np.inf)
    k = int(np.argmax(barycentric.min(axis=1)))  # the cell that the point lies deepest in
    depths = comm.allgather(float(barycentric[k].min()))
    owner = int(np.argmax(depths))
    if depths[owner] < -(_OFF_OUTLINE if placed else _OFF):
        raise DescriptionError(
            part, f"the point {tuple(map(float, position))} is not on the link", "Move it onto the link"
        )
    found = None
    if comm.rank == owner:
        nodes = V.dofmap.cell_dofs(cells[k])
        (weights,) = shape_functions(barycentric[k][None], len(nodes))
        found = (V.dofmap.index_map.local_to_global(nodes.astype(np.int32)), weights)
    return LinkPoint(*comm.bcast(found, root=owner))


def shape_functions(barycentric: np.ndarray, nodes: int) -> np.ndarray:
    """N_i of the Lagrange element with ``nodes`` at barycentric coordinates (n, dim + 1), (n, nodes)."""
    corners = barycentric.shape[1]
    order = next(k for k in count(1) if comb(k + corners - 1, k) == nodes)
    shape = basix.CellType.triangle if corners == 3 else basix.CellType.tetrahedron
    element = basix.create_element(basix.ElementFamily.P, shape, order, basix.LagrangeVariant.gll_warped)
    return element.tabulate(0, np.ascontiguousarray(barycentric[:, 1:]))[0, :, :, 0]


def _barycentric(position: np.ndarray, vertices: np.ndarray, bulges: np.ndarray) -> np.ndarray:
    """Barycentric coordinates λ of ``position`` in each cell, X₀(λ) + c(λ) = position, (cells, dim + 1)."""
    inverse = np.linalg.inv((vertices[:, 1:] - vertices[:, :1]).transpose(0, 2, 1))
    i, j = np.transpose(list(combinations(range(vertices.shape[1]), 2)))

    def in_straight_cells(target: np.ndarray) -> np.ndarray:
        rest = np.einsum("kij,kj->ki", inverse, target - vertices[:, 0])
        return np.column_stack([1.0 - rest.sum(axis=1), rest])

    found = in_straight_cells(np.broadcast_to(position, (len(vertices), len(position))))
    # each of these corrections at least halves the error
    for _ in range(59 if bulges.any() else 0):
        within = np.clip(found, 0.0, 1.0)  # a cell's map is defined inside it
        found = in_straight_cells(position - np.einsum("ke,ked->kd", 4.0 * within[:, i] * within[:, j], bulges))
    return found
