"""Nodes of the displacement field as functions of other unknowns.

Interface nodes follow body poses, u_i = t + (R − I)(X_i − c), X_i the node at rest. All nodes of the cells in an
interface are eliminated from the unknowns; each follows the pose of its body. Where bodies move in the plane while
the mesh is one half of the links in space, that is u_z = 0, as it is on the mid-plane z = 0.

Rest positions of all nodes follow the P1 design field d, d_i = Σ_k N_k(X_i) d_k.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from scipy.sparse import csr_matrix

from fenicsmech.compat import add_ghosts, cell_dofs, interpolation_matrix, owned_values
from fenicsmech.joints import RigidSpace
from fenicsmech.meshing import on_mid_plane


class InterfaceMap:
    """The nodes of each interface body on this rank.

    Args:
        u: displacement field.
        drawn: positions of its local nodes, (nodes, dim).
        cell_body: index of the body each local cell belongs to, −1 if it is free, (cells,).
        centres: reference centre of every body, (bodies, dim).
        space: rigid-body coordinates.

    Attributes:
        body: body of every local node of u, −1 if free, (owned + ghost nodes,); the same on all ranks.
        owned: number of owned nodes.
        block: displacements per node.
        unknown: whether each owned displacement is an unknown, (owned nodes, block).
        nodes: local eliminated nodes, owned and ghost, per body.
        offsets: X_i − c of these nodes.
    """

    def __init__(
        self, u: fem.Function, drawn: np.ndarray, cell_body: np.ndarray, centres: np.ndarray, space: RigidSpace
    ) -> None:
        self.space, self._u, self._cell_body, self._centres = space, u, cell_body, centres
        V = u.function_space
        self.block = V.dofmap.index_map_bs
        self.owned = V.dofmap.index_map.size_local
        self.body = self._mark_nodes(cell_body)
        bodies = np.unique(self.body[self.body >= 0])
        self.nodes = {int(b): np.flatnonzero(self.body == b) for b in bodies}
        positions = V.tabulate_dof_coordinates()
        self._drawn = {b: drawn[nodes, : space.dim] - centres[b] for b, nodes in self.nodes.items()}
        self.offsets = dict(self._drawn)
        self._mid_plane = np.zeros(len(positions), dtype=bool)
        if space.dim < self.block:
            self._mid_plane = on_mid_plane(positions, V.mesh.comm)
        self.unknown = np.tile(self.body[: self.owned, None] < 0, self.block)
        self.unknown[self._mid_plane[: self.owned], space.dim :] = False

    def on(self, u: fem.Function) -> InterfaceMap:
        """The same interfaces of a field of order 1, whose nodes are vertices."""
        drawn = u.function_space.tabulate_dof_coordinates()
        return InterfaceMap(u, drawn, self._cell_body, self._centres, self.space)

    def reshape(self, design: np.ndarray) -> None:
        """Takes the design at all local nodes, (nodes, dim): added to the drawn positions."""
        self.offsets = {b: self._drawn[b] + design[nodes, : self.space.dim] for b, nodes in self.nodes.items()}

    def _mark_nodes(self, cell_body: np.ndarray) -> np.ndarray:
        """Body of every local node; a node may touch an interface cell only on another rank."""
        V = self._u.function_space
        marker = fem.Function(V)
        local = marker.x.array.reshape(-1, self.block)
        cells = np.flatnonzero(cell_body >= 0)
        nodes = cell_dofs(V)[cells]
        local[nodes, 0] = cell_body[cells, None] + 1
        local[nodes, 1] = 1
        # sums over ranks of (body + 1) and of the number of ranks that marked the node
        add_ghosts(marker)
        marker.x.scatter_forward()
        marked = local[:, 1] > 0
        body = np.full(len(local), -1)
        body[marked] = np.rint(local[marked, 0] / local[marked, 1]).astype(int) - 1
        return body

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
    """Interpolation of the vector P1 field ``d`` at the nodes of the Lagrange field ``u`` on the same mesh."""

    def __init__(self, d: fem.Function, u: fem.Function) -> None:
        coarse, fine = d.function_space, u.function_space
        self._d, self._at_vertices, self._at_nodes = d, fem.Function(coarse), fem.Function(fine)
        index, dim = coarse.dofmap.index_map, coarse.dofmap.index_map_bs
        # every component alike
        weights = interpolation_matrix(coarse, fine)[::dim]
        vertices = index.local_to_global(np.arange(index.size_local + index.num_ghosts, dtype=np.int32))
        order = np.argsort(vertices)
        columns = order[np.searchsorted(vertices[order], weights.indices // dim)]
        self._matrix = csr_matrix((weights.data, columns, weights.indptr), shape=(weights.shape[0], len(vertices)))

    def values(self) -> np.ndarray:
        """d at all local nodes of u, (nodes, dim)."""
        dim = self._d.function_space.dofmap.index_map_bs
        owned_values(self._at_nodes)[:] = (self._matrix @ self._d.x.array.reshape(-1, dim)).ravel()
        self._at_nodes.x.scatter_forward()
        return self._at_nodes.x.array.reshape(-1, dim).copy()

    def transpose(self, nodal: np.ndarray) -> np.ndarray:
        """Nᵀ ``nodal`` ((owned nodes of u, dim)), this rank's owned values on the space of d, flat."""
        self._at_vertices.x.array[:] = (self._matrix.T @ nodal).ravel()
        add_ghosts(self._at_vertices)
        return owned_values(self._at_vertices).copy()
