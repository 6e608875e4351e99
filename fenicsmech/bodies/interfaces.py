"""Interface nodes as functions of body poses: u_i = t + (R − I)(X_i − c), X_i = X₀_i + d_i.

All nodes of the cells in an interface are eliminated from the unknowns; each follows the pose of its body.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from fenicsmech.compat import petsc_vector
from fenicsmech.kinematics import RigidSpace


class InterfaceMap:
    """The nodes of each interface body on this rank.

    Args:
        u: displacement field.
        cell_body: index of the body each local cell belongs to, −1 if it is free, (cells,).
        centres: reference centre of every body, (bodies, dim).
        space: rigid-body coordinates.

    Attributes:
        body: body of every local node of u, −1 if free, (owned + ghost nodes,); the same on all ranks.
        owned: number of owned nodes.
        nodes: local eliminated nodes, owned and ghost, per body.
        offsets: X_i − c of these nodes.
    """

    def __init__(self, u: fem.Function, cell_body: np.ndarray, centres: np.ndarray, space: RigidSpace) -> None:
        self.space, self._u, self._cell_body, self._centres = space, u, cell_body, centres
        V = u.function_space
        self.block = V.dofmap.index_map_bs
        self.owned = V.dofmap.index_map.size_local
        self.body = self._mark_nodes(cell_body)
        bodies = np.unique(self.body[self.body >= 0])
        self.nodes = {int(b): np.flatnonzero(self.body == b) for b in bodies}
        positions = V.tabulate_dof_coordinates()[:, : self.block]
        self._drawn = {b: positions[nodes] - centres[b] for b, nodes in self.nodes.items()}
        self.offsets = dict(self._drawn)

    def on(self, u: fem.Function) -> InterfaceMap:
        """The same interfaces, as drawn, of another field on the same mesh (collective)."""
        return InterfaceMap(u, self._cell_body, self._centres, self.space)

    def reshape(self, design: np.ndarray) -> None:
        """Takes the design at all local nodes, (nodes, dim): offsets become X₀ + d − c."""
        self.offsets = {b: self._drawn[b] + design[nodes] for b, nodes in self.nodes.items()}

    def _mark_nodes(self, cell_body: np.ndarray) -> np.ndarray:
        """Body of every local node; a node may touch an interface cell only on another rank."""
        V = self._u.function_space
        marker = fem.Function(V)
        local = marker.x.array.reshape(-1, self.block)
        for cell in np.flatnonzero(cell_body >= 0):
            local[V.dofmap.cell_dofs(cell), 0] = cell_body[cell] + 1
            local[V.dofmap.cell_dofs(cell), 1] = 1
        # sum over ranks of (body + 1) and of the number of ranks that said so
        vector = petsc_vector(marker)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        marked = local[:, 1] > 0
        body = np.full(len(local), -1)
        body[marked] = np.rint(local[marked, 0] / local[marked, 1]).astype(int) - 1
        return body

    def place(self, poses: np.ndarray) -> None:
        """Sets u at all eliminated nodes from ``poses`` (bodies, pose_size)."""
        values = self._u.x.array.reshape(-1, self.block)
        for body, nodes in self.nodes.items():
            values[nodes] = self.space.displace(poses[body], self.offsets[body])

    def gradient_rows(self, poses: np.ndarray, body: int) -> tuple[np.ndarray, np.ndarray]:
        """∂u/∂z for the owned nodes of ``body``: local nodes (n,) and (n, dim, pose_size)."""
        mine = self.nodes[body] < self.owned
        return self.nodes[body][mine], self.space.displacement_gradient(poses[body], self.offsets[body][mine])

    def moments(self, forces: np.ndarray) -> dict[int, np.ndarray]:
        """Σ f_i ⊗ (X_i − c) over the owned nodes of each body, from nodal ``forces`` (owned nodes, dim)."""
        moments = {}
        for body, nodes in self.nodes.items():
            mine = nodes < self.owned
            moments[body] = forces[nodes[mine]].T @ self.offsets[body][mine]
        return moments
