"""Material points that forces act on and displacements are read from.

    on a rigid link:     u(z) = t + (R − I)(P − c)
    on a flexible link:  u = Σ_i N_i(P) u_i

with the pose (t, R) and the centre c of a body, and the shape functions N_i of the cell that holds P.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from dolfinx import fem

from fenicsmech.errors import DescriptionError
from fenicsmech.joints import RigidSpace


class MaterialPoint(ABC):
    """A point that moves with the mechanism."""

    @abstractmethod
    def displacement(self, u: fem.Function, poses: np.ndarray) -> np.ndarray:
        """Displacement from the drawn configuration, (dim,)."""


@dataclass(frozen=True)
class BodyPoint(MaterialPoint):
    """A point at ``offset`` (dim,) from the centre of body ``body``."""

    body: int
    offset: np.ndarray
    space: RigidSpace

    def displacement(self, u, poses):
        return self.space.displace(poses[self.body], self.offset[None])[0]

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂u/∂z, (dim, pose_size)."""
        return self.space.displacement_gradient(poses[self.body], self.offset[None])[0]

    def hessian(self, poses: np.ndarray, force: np.ndarray) -> np.ndarray:
        """force · ∂²u/∂z², (pose_size, pose_size)."""
        return self.space.displacement_hessian(poses[self.body], np.outer(force, self.offset))


@dataclass(frozen=True)
class LinkPoint(MaterialPoint):
    """A point in a cell of a flexible link, which one rank owns.

    Attributes:
        owner: rank that holds the cell.
        nodes: local nodes of the cell on the owner, global nodes are in ``global_nodes``; (n,).
        global_nodes: the same nodes numbered over all ranks, on every rank, (n,).
        weights: N_i(P), on every rank, (n,).
    """

    owner: int
    nodes: np.ndarray
    global_nodes: np.ndarray
    weights: np.ndarray

    def displacement(self, u, poses):
        comm = u.function_space.mesh.comm
        here = None
        if comm.rank == self.owner:
            block = u.function_space.dofmap.index_map_bs
            here = self.weights @ u.x.array.reshape(-1, block)[self.nodes]
        return comm.bcast(here, root=self.owner)


def body_point(position: np.ndarray, body: int, centre: np.ndarray, space: RigidSpace) -> BodyPoint:
    """The point drawn at ``position`` on a body."""
    return BodyPoint(body, np.asarray(position) - np.asarray(centre), space)


def link_point(
    part: str, position: np.ndarray, u: fem.Function, cells: np.ndarray, vertices: np.ndarray, bulges: np.ndarray
) -> LinkPoint:
    """The point drawn at ``position`` on a flexible link.

    Args:
        part: for messages.
        position: (dim,).
        u: displacement field; its order fixes the interpolation.
        cells: owned cells of the link on this rank.
        vertices: their corner coordinates, (cells, dim + 1, dim).
        bulges: of their edges, pairs of corners in lexical order, (cells, pairs, dim).

    Raises:
        DescriptionError: the point lies outside the link by more than a hundredth of a cell.
    """
    comm = u.function_space.mesh.comm
    dim = len(position)
    barycentric = _barycentric(position, vertices, bulges) if len(cells) else np.full((1, dim + 1), -np.inf)
    k = int(np.argmax(barycentric.min(axis=1)))  # the cell that the point lies deepest in
    depth, owner = max((depth, -rank) for rank, depth in enumerate(comm.allgather(float(barycentric[k].min()))))
    owner = -owner
    if depth < -0.01:
        raise DescriptionError(
            part, f"the point {tuple(map(float, position))} is not on the link", "Move it onto the link"
        )
    found, nodes = None, np.zeros(0, dtype=np.int32)
    if comm.rank == owner:
        V = u.function_space
        nodes = V.dofmap.cell_dofs(cells[k])
        weights = _lagrange(barycentric[k], V.tabulate_dof_coordinates()[nodes, :dim], vertices[k])
        found = (V.dofmap.index_map.local_to_global(nodes.astype(np.int32)), weights)
    return LinkPoint(owner, nodes, *comm.bcast(found, root=owner))


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


def _lagrange(at: np.ndarray, nodes: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Lagrange basis on a simplex at barycentric coordinates ``at``, node positions decide the order."""
    inverse = np.linalg.inv(np.vstack([corners.T, np.ones(len(corners))]))
    barycentric = (inverse @ np.vstack([nodes.T, np.ones(len(nodes))])).T
    order = {len(at): 1, len(at) * (len(at) + 1) // 2: 2}.get(len(nodes), 3)
    powers = np.array([powers for powers in product(range(order + 1), repeat=len(at)) if sum(powers) == order])
    vandermonde = np.array([np.prod(point**powers, axis=1) for point in barycentric])
    return np.linalg.solve(vandermonde.T, np.prod(at**powers, axis=1))
