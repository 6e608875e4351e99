"""The meshed links as plain arrays, with shape functions of their own.

Only numbers are taken from the simulation: where nodes are, which nodes a cell has, which link and body it belongs to.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import basix
import numpy as np

import fenicsmech as fm

from .strain_energy import REAL


@dataclass(frozen=True)
class LinksMesh:
    """All flexible links.

    Attributes:
        order: of the displacement, 1 or 2.
        nodes: where they are drawn, (n, dim).
        cells: corners first, then midpoints of the edges in the order of ``combinations``, (m, k).
        link: index of the flexible link of each cell, (m,).
        body: index of the body that holds each cell, −1 if none does, (m,).
    """

    order: int
    nodes: np.ndarray
    cells: np.ndarray
    link: np.ndarray
    body: np.ndarray

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return self.nodes.shape[1]

    @property
    def corners(self) -> np.ndarray:
        """(m, dim + 1, dim)."""
        return self.nodes[self.cells[:, : self.dim + 1]]

    @property
    def volumes(self) -> np.ndarray:
        """Area or volume of each cell, (m,)."""
        edges = self.corners[:, 1:] - self.corners[:, :1]
        return np.abs(np.linalg.det(edges)) / (2.0 if self.dim == 2 else 6.0)

    def gradients(self, barycentric: np.ndarray) -> np.ndarray:
        """∂N/∂X at points (q, dim + 1) of all cells, (m, q, k, dim)."""
        inner = _dual((self.corners[:, 1:] - self.corners[:, :1]).astype(REAL))
        slopes = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
        return np.einsum("qkb,mbd->mqkd", shape_slopes(barycentric, self.order), slopes)

    def locate(self, cells: np.ndarray, at: np.ndarray) -> tuple[int, np.ndarray]:
        """The one of ``cells`` that holds a point (or comes nearest), and its barycentric coordinates there."""
        corners = self.corners[cells]
        matrix = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(cells), 1, self.dim + 1))], axis=1)
        inside = np.linalg.solve(matrix, np.broadcast_to(np.append(at, 1.0), (len(cells), self.dim + 1))[..., None])
        best = int(np.argmax(inside[..., 0].min(axis=1)))
        return int(cells[best]), inside[best, :, 0]


def _dual(edges: np.ndarray) -> np.ndarray:
    """Rows g_a with g_a · e_b = δ_ab for the rows e_b of ``edges`` (m, dim, dim): ∇L of all corners but the first."""
    if edges.shape[-1] == 2:
        turned = np.stack([edges[:, 1, ::-1] * [1, -1], edges[:, 0, ::-1] * [-1, 1]], axis=1)
        return turned / (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])[:, None, None]
    normals = np.stack([np.cross(edges[:, (a + 1) % 3], edges[:, (a + 2) % 3]) for a in range(3)], axis=1)
    return normals / np.sum(normals[:, 0] * edges[:, 0], axis=-1)[:, None, None]


def shape_functions(barycentric: np.ndarray, order: int) -> np.ndarray:
    """N at points (q, dim + 1), (q, k):  L_a, or L_a (2 L_a − 1) and 4 L_a L_b."""
    if order == 1:
        return barycentric
    pairs = [4 * barycentric[:, a] * barycentric[:, b] for a, b in combinations(range(barycentric.shape[1]), 2)]
    return np.column_stack([barycentric * (2 * barycentric - 1), *pairs])


def shape_slopes(barycentric: np.ndarray, order: int) -> np.ndarray:
    """∂N/∂L_b at points (q, dim + 1), (q, k, dim + 1)."""
    count = barycentric.shape[1]
    unit = np.eye(count)
    if order == 1:
        return np.broadcast_to(unit, (len(barycentric), count, count))
    corner = [np.outer(4 * barycentric[:, a] - 1, unit[a]) for a in range(count)]
    edge = [
        4 * (np.outer(barycentric[:, b], unit[a]) + np.outer(barycentric[:, a], unit[b]))
        for a, b in combinations(range(count), 2)
    ]
    return np.stack([*corner, *edge], axis=1)


def quadrature(dim: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (q, dim + 1) and weights (q,) that sum to one.

    The rule is part of what a discrete energy is, so it is basix's, as the simulation's; a test integrates monomials.
    """
    shape = basix.CellType.triangle if dim == 2 else basix.CellType.tetrahedron
    points, weights = basix.make_quadrature(shape, degree)
    return np.column_stack([1.0 - points.sum(axis=1), points]), weights / weights.sum()


def gather(simulation: fm.Simulation) -> LinksMesh:
    """The mesh of a simulation on one process."""
    model = simulation.model
    space = model.elastic.u.function_space
    dim, order = model.linkage.dim, simulation.fidelity.order
    nodes = space.tabulate_dof_coordinates()[:, :dim].copy()
    count = len(model.mesh.link)
    dofs = np.array([space.dofmap.cell_dofs(cell) for cell in range(count)])
    body = np.where(model.mesh.interface >= 0, model.mesh.interface + len(model.mechanism.rigid_links), -1)
    cells = _ordered(nodes, dofs, dim, order)
    return LinksMesh(order, nodes, cells, np.asarray(model.mesh.link), body)


def _ordered(nodes: np.ndarray, dofs: np.ndarray, dim: int, order: int) -> np.ndarray:
    """Nodes of each cell in this module's order, told by where they are: midpoints lie between two corners."""
    if order == 1:
        return dofs
    at, count = nodes[dofs], dofs.shape[1]

    def halfway(pair: tuple[int, int], node: int) -> bool:
        """Whether ``node`` lies halfway between two others, in all cells."""
        gap = np.abs(at[:, node] - 0.5 * (at[:, pair[0]] + at[:, pair[1]])).max(axis=1)
        return bool(np.all(gap <= 1e-9 * np.ptp(at, axis=1).max(axis=1)))

    middle = {
        pair: node
        for pair in combinations(range(count), 2)
        for node in range(count)
        if node not in pair and halfway(pair, node)
    }
    corners = [node for node in range(count) if node not in middle.values()]
    assert len(corners) == dim + 1
    return dofs[:, [*corners, *(middle[pair] for pair in combinations(corners, 2))]]
