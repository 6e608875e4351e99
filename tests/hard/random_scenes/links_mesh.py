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

_CORRECTIONS = 30  # of a point's place in a curved cell


@dataclass(frozen=True)
class LinksMesh:
    """All flexible links.

    Attributes:
        order: of the displacement, 1 or 2.
        nodes: where they are drawn, (n, dim); edges with a midpoint are parabolas through it.
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

    def volumes(self, barycentric: np.ndarray) -> np.ndarray:
        """Area or volume of each cell if it were everywhere as at points (q, dim + 1), (m, q)."""
        return np.abs(np.linalg.det(self._edges(barycentric))) / (2.0 if self.dim == 2 else 6.0)

    def gradients(self, barycentric: np.ndarray) -> np.ndarray:
        """∂N/∂X at points (q, dim + 1) of all cells, (m, q, k, dim)."""
        edges = self._edges(barycentric).astype(REAL)
        inner = _dual(edges.reshape(-1, self.dim, self.dim)).reshape(edges.shape)
        slopes = shape_slopes(barycentric, self.order)
        return np.einsum("qka,mqad->mqkd", slopes[:, :, 1:] - slopes[:, :, :1], inner)

    def _edges(self, barycentric: np.ndarray) -> np.ndarray:
        """∂X/∂L_a − ∂X/∂L₀, X = Σ N_k X_k, at points (q, dim + 1) of all cells, (m, q, dim, dim)."""
        slopes = shape_slopes(barycentric, self.order)
        return np.einsum("qka,mki->mqai", slopes[:, :, 1:] - slopes[:, :, :1], self.nodes[self.cells])

    def locate(self, cells: np.ndarray, at: np.ndarray) -> tuple[int, np.ndarray]:
        """The one of ``cells`` that holds a point (or comes nearest), and its barycentric coordinates there."""
        found = np.array([self._inside(cell, at) for cell in cells])
        best = int(np.argmax(found.min(axis=1)))
        return int(cells[best]), found[best]

    def _inside(self, cell: int, at: np.ndarray) -> np.ndarray:
        """Barycentric coordinates of a point in a cell, by Newton's method from its middle."""
        inside = np.full(self.dim + 1, 1.0 / (self.dim + 1))
        one = LinksMesh(self.order, self.nodes, self.cells[[cell]], self.link[[cell]], self.body[[cell]])
        for _ in range(_CORRECTIONS):
            gap = at - shape_functions(inside[None], self.order)[0] @ self.nodes[self.cells[cell]]
            change = np.linalg.solve(one._edges(inside[None])[0, 0].T, gap)
            change = change / max(1.0, np.abs(change).max())
            inside = inside + np.append(-change.sum(), change)
        return inside


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
    return LinksMesh(order, model.elastic.drawn_nodes.copy(), cells, np.asarray(model.mesh.link), body)


def _ordered(nodes: np.ndarray, dofs: np.ndarray, dim: int, order: int) -> np.ndarray:
    """Nodes of each cell in this module's order, known by where they are: midpoints lie between two corners."""
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
