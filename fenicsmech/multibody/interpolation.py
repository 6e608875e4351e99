"""The P1 design field at the nodes of the displacement field, d_i = Σ_k N_k(X_i) d_k, and its transpose."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from scipy.sparse import csr_matrix

from fenicsmech.compat import add_ghosts, cell_dofs, owned_values


class DesignAtNodes:
    """Interpolation of the vector P1 field ``d`` at the nodes of the Lagrange field ``u`` on the same mesh.

    Args:
        d: design field.
        u: displacement field.

    Attributes:
        matrix: N_k(X_i), (local nodes of u, local nodes of d).
        owned: number of owned nodes of u.
    """

    def __init__(self, d: fem.Function, u: fem.Function) -> None:
        self._d, coarse, fine = d, d.function_space, u.function_space
        self._pulled = fem.Function(coarse)
        dim = coarse.dofmap.index_map_bs
        self.owned = fine.dofmap.index_map.size_local
        corners, nodes = cell_dofs(coarse), cell_dofs(fine)
        corner_at = coarse.tabulate_dof_coordinates()[:, :dim][corners]
        offset = fine.tabulate_dof_coordinates()[:, :dim][nodes] - corner_at[:, :1]
        # barycentric coordinates of every node in its cell
        edges = (corner_at[:, 1:] - corner_at[:, :1]).transpose(0, 2, 1)
        inner = np.linalg.solve(edges, offset.transpose(0, 2, 1)).transpose(0, 2, 1)
        weights = np.concatenate([1.0 - inner.sum(axis=2, keepdims=True), inner], axis=2)
        shape = (len(u.x.array) // dim, len(d.x.array) // dim)
        rows = np.repeat(nodes, dim + 1, axis=1).ravel()
        columns = np.tile(corners, (1, nodes.shape[1])).ravel()
        # cells that share a node give it the same values: keep one
        _, first = np.unique(rows.astype(np.int64) * shape[1] + columns, return_index=True)
        self.matrix = csr_matrix((weights.ravel()[first], (rows[first], columns[first])), shape=shape)
        self.matrix.data[np.abs(self.matrix.data) < 1e-12] = 0.0

    def values(self) -> np.ndarray:
        """d at all local nodes of u, (nodes, dim)."""
        dim = self._d.function_space.dofmap.index_map_bs
        return self.matrix @ self._d.x.array.reshape(-1, dim)

    def transpose(self, nodal: np.ndarray) -> np.ndarray:
        """Nᵀ ``nodal`` ((owned nodes of u, dim)), this rank's owned values on the space of d, flat (collective)."""
        self._pulled.x.array[:] = (self.matrix[: self.owned].T @ nodal).ravel()
        add_ghosts(self._pulled)
        return owned_values(self._pulled).copy()
