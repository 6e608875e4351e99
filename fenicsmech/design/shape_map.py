"""From spline parameters and handle positions to the design field on the distributed mesh, and back.

    d_i = Σ_j w_ij T_j(p, θ_j) (X_i − X_j, 1),     d linear in the maps T_j (2 × 3) of the handles.

With r_ij = w_ij (X_i − X_j, 1), the transpose takes a field g to the moments ∂/∂T_j = Σ_i g_i ⊗ r_ij of each handle,
and from there to ∂/∂p and ∂/∂θ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import cell_dofs, cell_nodes, original_nodes
from fenicsmech.design.link_shape import LinkShape
from fenicsmech.meshing import MechanismMesh


class ShapeMap:
    """The shape of some links as a function of parameters p and handle positions θ, both link after link.

    Fields are arrays (local nodes, dim), nodes as in ``design.x.array``, ghosts last. Everything else is the same on
    all ranks. Links without a shape keep d = 0.

    Args:
        mesh: the mechanism's mesh.
        design: the design field d, vector P1.
        shapes: the links that change, the same on all ranks.

    Attributes:
        owned: number of owned nodes.
        original: vertex of the whole mesh of every local node, (nodes,).
        vertices: per link, its vertices in the whole mesh, (n,).
        reach: per link, r_ij at ``vertices``, (n, handles, 3).
        initial, initial_theta: p (parameters,) and θ (handles,) of the initial design.
    """

    def __init__(self, mesh: MechanismMesh, design: fem.Function, shapes: Sequence[LinkShape]) -> None:
        self.mesh, self.design, self.shapes = mesh, design, tuple(shapes)
        self.original = _original_vertices(design)
        self.owned = design.function_space.dofmap.index_map.size_local
        self.vertices = [np.unique(mesh.cells[mesh.link_of_cell == shape.link]) for shape in shapes]
        self.reach = [_reach(mesh.vertices[v], shape) for v, shape in zip(self.vertices, shapes, strict=True)]
        self._nodes, self._local_reach = [], []
        for vertices, reach in zip(self.vertices, self.reach, strict=True):
            nodes = np.flatnonzero(np.isin(self.original, vertices))
            self._nodes.append(nodes)
            self._local_reach.append(reach[np.searchsorted(vertices, self.original[nodes])])
        handles = [shape.handles for shape in shapes]
        self.initial = np.concatenate([h.spline.initial for h in handles])
        self.initial_theta = np.concatenate([h.initial for h in handles])
        self._p_ends = np.cumsum([h.spline.size for h in handles])[:-1]
        self._theta_ends = np.cumsum([len(h) for h in handles])[:-1]

    def parameters(self, p: np.ndarray) -> list[np.ndarray]:
        """``p`` (…, parameters) link by link."""
        return np.split(p, self._p_ends, axis=-1)

    def positions(self, theta: np.ndarray) -> list[np.ndarray]:
        """``theta`` (…, handles) link by link."""
        return np.split(theta, self._theta_ends, axis=-1)

    def field(self, p: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """d, (nodes, dim)."""
        return self._spread(
            [shape.handles.transforms(p_link, theta_link) for shape, p_link, theta_link in self._links(p, theta)]
        )

    def apply(self, p: np.ndarray, theta: np.ndarray) -> None:
        """Makes the design field hold d(p, θ)."""
        self.design.x.array[:] = self.field(p, theta).ravel()

    def push(self, p: np.ndarray, theta: np.ndarray, dp: np.ndarray, dtheta: np.ndarray) -> np.ndarray:
        """∂d/∂p dp + ∂d/∂θ dθ, (nodes, dim)."""
        changes = []
        for (shape, *point), dp_link, dtheta_link in zip(
            self._links(p, theta), self.parameters(dp), self.positions(dtheta), strict=True
        ):
            by_p, by_theta = shape.handles.gradients(*point)
            changes.append(by_p @ dp_link + by_theta * dtheta_link[:, None, None])
        return self._spread(changes)

    def pull(self, p: np.ndarray, theta: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The transpose of ``push``: g · ∂d/∂p (…, parameters) and g · ∂d/∂θ (…, handles) (collective).

        g: (…, nodes or owned nodes, dim), of which the owned nodes count; summed over all ranks.
        """
        by_p, by_theta = [], []
        for (shape, *point), moments in zip(self._links(p, theta), self.moments(g), strict=True):
            p_slope, theta_slope = shape.handles.gradients(*point)
            by_p.append(np.einsum("...jak,jakp->...p", moments, p_slope))
            by_theta.append(np.einsum("...jak,jak->...j", moments, theta_slope))
        return np.concatenate(by_p, axis=-1), np.concatenate(by_theta, axis=-1)

    def moments(self, g: np.ndarray) -> list[np.ndarray]:
        """Σ_i g_i ⊗ r_ij of each handle, per link (…, handles, 2, 3), summed over all ranks (collective)."""
        parts = []
        for nodes, reach in zip(self._nodes, self._local_reach, strict=True):
            mine = nodes < self.owned
            parts.append(np.einsum("...ia,ijk->...jak", g[..., nodes[mine], :2], reach[mine]))
        return self.sum_over_ranks(parts)

    def sum_over_ranks(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The sums over all ranks of arrays of any shapes, in one message (collective)."""
        total = np.concatenate([part.ravel() for part in parts])
        self.mesh.mesh.comm.Allreduce(MPI.IN_PLACE, total)
        ends = np.cumsum([part.size for part in parts])[:-1]
        return [piece.reshape(part.shape) for piece, part in zip(np.split(total, ends), parts, strict=True)]

    def _links(self, p: np.ndarray, theta: np.ndarray):
        return zip(self.shapes, self.parameters(p), self.positions(theta), strict=True)

    def _spread(self, transforms: Sequence[np.ndarray]) -> np.ndarray:
        """Σ_j r_ij T_j, (nodes, dim)."""
        d = np.zeros((len(self.original), self.mesh.vertices.shape[1]))
        for nodes, reach, T in zip(self._nodes, self._local_reach, transforms, strict=True):
            d[nodes, :2] = np.einsum("ijk,jak->ia", reach, T, optimize=True)
        return d


def _reach(points: np.ndarray, shape: LinkShape) -> np.ndarray:
    """r_ij = w_ij (X_i − X_j, 1), (n, handles, 3)."""
    arms = points[:, None, :2] - shape.handles.centre
    return shape.weights[..., None] * np.concatenate([arms, np.ones((*arms.shape[:2], 1))], axis=2)


def _original_vertices(design: fem.Function) -> np.ndarray:
    """The vertex of the whole mesh of every local node of a P1 field, (nodes,)."""
    V = design.function_space
    nodes = cell_nodes(V.mesh)
    original = np.empty(len(design.x.array) // V.dofmap.index_map_bs, dtype=np.int64)
    original[cell_dofs(V)] = nodes
    return original_nodes(V.mesh)[original]
