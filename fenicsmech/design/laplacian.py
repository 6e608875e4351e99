"""Stiffness and lumped mass of linear elements on triangles and tetrahedra, with SciPy."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from fenicsmech.meshing import LinkMesh, cell_measures


def lumped_mass(mesh: LinkMesh) -> np.ndarray:
    """∫ N_i dx, (n,)."""
    share = np.abs(cell_measures(mesh.points, mesh.cells)) / (mesh.dim + 1)
    return np.bincount(mesh.cells.ravel(), np.repeat(share, mesh.dim + 1), minlength=len(mesh.points))


def stiffness(mesh: LinkMesh, *, axis: int | None = None) -> csr_matrix:
    """∫ ∇N_i · ∇N_j dx, (n, n); with the derivatives along one coordinate ``axis`` only if given."""
    corners = mesh.points[mesh.cells]
    edges = corners[:, 1:] - corners[:, :1]
    # rows of inverse(edges)ᵀ are ∇N_1 … ∇N_dim
    inner = np.linalg.inv(edges).transpose(0, 2, 1)
    gradients = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
    if axis is not None:
        gradients = gradients[..., [axis]]
    local = np.abs(cell_measures(mesh.points, mesh.cells))[:, None, None] * gradients @ gradients.transpose(0, 2, 1)
    k, count = mesh.cells.shape[1], len(mesh.points)
    rows, columns = np.repeat(mesh.cells, k, axis=1), np.tile(mesh.cells, (1, k))
    return csr_matrix(coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count)))
