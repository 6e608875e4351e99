"""The meshed links as plain arrays, with shape functions of their own.

Only numbers are taken from the simulation: where nodes are, which nodes a cell has, which link and body it belongs to.
Shape functions are combinations of products Π L_a^{α_a} of barycentric coordinates, Σ α_a the order, each one at its
own node and zero at all others.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import basix
import numpy as np

import fenicsmech as fm

from .strain_energy import REAL

_CORRECTIONS = 30  # of a point's place in a curved cell
_ARRIVED = 1e-6  # largest last correction, in barycentric coordinates, of a place that was found


@dataclass(frozen=True)
class Elements:
    """Lagrange elements on simplices.

    Attributes:
        order: of the polynomials.
        places: barycentric coordinates of the nodes of a cell, in the order of ``exponents``, (k, dim + 1).
    """

    order: int
    places: np.ndarray

    @classmethod
    def regular(cls, dim: int, order: int) -> Elements:
        """Elements with nodes at equal distances."""
        return cls(order, exponents(dim, order) / order)

    def values(self, barycentric: np.ndarray) -> np.ndarray:
        """N at points (q, dim + 1), (q, k)."""
        return self._monomials(barycentric) @ self._coefficients.astype(float)

    def slopes(self, barycentric: np.ndarray) -> np.ndarray:
        """∂N/∂L_b at points (q, dim + 1), (q, k, dim + 1)."""
        powers, slopes = self._powers, []
        for b in range(powers.shape[1]):
            lower = np.maximum(powers - np.eye(powers.shape[1], dtype=int)[b], 0)
            grown = powers[:, b] * np.prod(barycentric[:, None].astype(REAL) ** lower, axis=-1)
            slopes.append(grown @ self._coefficients)
        return np.stack(slopes, axis=-1)

    @cached_property
    def _powers(self) -> np.ndarray:
        return exponents(self.places.shape[1] - 1, self.order)

    def _monomials(self, barycentric: np.ndarray) -> np.ndarray:
        return np.prod(barycentric[:, None] ** self._powers, axis=-1)

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """Of the monomials in each N, (k, k), in extended precision."""
        at_nodes = self._monomials(self.places.astype(REAL))
        inverse = np.linalg.inv(at_nodes.astype(float)).astype(REAL)
        for _ in range(2):
            inverse = inverse @ (2 * np.eye(len(inverse), dtype=REAL) - at_nodes @ inverse)
        return inverse


def exponents(dim: int, order: int) -> np.ndarray:
    """The powers α of each node's place, corners first, then edges, then faces, (k, dim + 1)."""
    found = []
    for count in range(1, min(dim + 1, order) + 1):
        shares = sorted((s for s in product(range(1, order + 1), repeat=count) if sum(s) == order), reverse=True)
        for corners in combinations(range(dim + 1), count):
            for share in shares:
                powers = np.zeros(dim + 1, dtype=int)
                powers[list(corners)] = share
                found.append(powers)
    return np.array(found)


@dataclass(frozen=True)
class LinksMesh:
    """All flexible links.

    Attributes:
        elements: of the displacement.
        nodes: where they are drawn, (n, dim); curved edges are polynomials through their nodes.
        cells: nodes of each, in the order of ``exponents``, (m, k).
        link: index of the flexible link of each cell, (m,).
        body: index of the body that holds each cell, −1 if none does, (m,).
        pressures: nodes of the pressure, one order lower, of each cell, (m, l); None where no link has one.
        lower: elements of the pressure.
    """

    elements: Elements
    nodes: np.ndarray
    cells: np.ndarray
    link: np.ndarray
    body: np.ndarray
    pressures: np.ndarray | None = None
    lower: Elements | None = None

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return self.nodes.shape[1]

    @property
    def order(self) -> int:
        """Of the displacement."""
        return self.elements.order

    def volumes(self, barycentric: np.ndarray) -> np.ndarray:
        """Area or volume of each cell if it were everywhere as at points (q, dim + 1), (m, q)."""
        return np.abs(np.linalg.det(self.edges(barycentric))) / (2.0 if self.dim == 2 else 6.0)

    def gradients(self, barycentric: np.ndarray) -> np.ndarray:
        """∂N/∂X at points (q, dim + 1) of all cells, (m, q, k, dim)."""
        edges = self.edges(barycentric).astype(REAL)
        inner = _dual(edges.reshape(-1, self.dim, self.dim)).reshape(edges.shape)
        slopes = self.elements.slopes(barycentric)
        return np.einsum("qka,mqad->mqkd", slopes[:, :, 1:] - slopes[:, :, :1], inner)

    def edges(self, barycentric: np.ndarray) -> np.ndarray:
        """∂X/∂L_a − ∂X/∂L₀, X = Σ N_k X_k, at points (q, dim + 1) of all cells, (m, q, dim, dim)."""
        slopes = self.elements.slopes(barycentric).astype(float)
        return np.einsum("qka,mki->mqai", slopes[:, :, 1:] - slopes[:, :, :1], self.nodes[self.cells])

    def boundary(self, link: int) -> list[tuple[int, np.ndarray]]:
        """Facets on the boundary of a link: the corner opposite, and the cells (…,) that have one there."""
        cells = np.flatnonzero(self.link == link)
        corners = self.cells[cells, : self.dim + 1]
        sides = [np.sort(np.delete(corners, opposite, axis=1), axis=1) for opposite in range(self.dim + 1)]
        count = Counter(tuple(side) for found in sides for side in found.tolist())
        return [
            (opposite, cells[[count[tuple(side)] == 1 for side in found.tolist()]])
            for opposite, found in enumerate(sides)
        ]

    def locate(self, cells: np.ndarray, at: np.ndarray) -> tuple[int, np.ndarray]:
        """The one of ``cells`` that holds a point (or comes nearest), and its barycentric coordinates there."""
        inside = self._inside(cells, at)
        best = int(np.argmax(inside.min(axis=1)))
        return int(cells[best]), inside[best]

    def _inside(self, cells: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Barycentric coordinates of a point in each of ``cells``, by Newton's method from its middle, (m, dim + 1);
        −∞ where it does not get to the point, as in curved cells far off."""
        inside, nodes = np.full((len(cells), self.dim + 1), 1.0 / (self.dim + 1)), self.nodes[self.cells[cells]]
        for _ in range(_CORRECTIONS):
            slopes = self.elements.slopes(inside).astype(float)
            edges = np.einsum("mka,mki->mai", slopes[:, :, 1:] - slopes[:, :, :1], nodes)
            gap = at - np.einsum("mk,mki->mi", self.elements.values(inside), nodes)
            change = np.linalg.solve(np.swapaxes(edges, 1, 2), gap[..., None])[..., 0]
            change /= np.maximum(1.0, np.abs(change).max(axis=1, keepdims=True))
            inside += np.column_stack([-change.sum(axis=1), change])
        inside[np.abs(change).max(axis=1) > _ARRIVED] = -np.inf
        return inside


def _dual(edges: np.ndarray) -> np.ndarray:
    """Rows g_a with g_a · e_b = δ_ab for the rows e_b of ``edges`` (m, dim, dim): ∇L of all corners but the first."""
    if edges.shape[-1] == 2:
        turned = np.stack([edges[:, 1, ::-1] * [1, -1], edges[:, 0, ::-1] * [-1, 1]], axis=1)
        return turned / (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])[:, None, None]
    normals = np.stack([np.cross(edges[:, (a + 1) % 3], edges[:, (a + 2) % 3]) for a in range(3)], axis=1)
    return normals / np.sum(normals[:, 0] * edges[:, 0], axis=-1)[:, None, None]


def quadrature(dim: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (q, dim + 1) and weights (q,) that sum to one.

    The rule is part of what a discrete energy is, so it is basix's, as the simulation's; a test integrates monomials.
    """
    shape = {1: basix.CellType.interval, 2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[dim]
    points, weights = basix.make_quadrature(shape, degree)
    return np.column_stack([1.0 - points.sum(axis=1), points]), weights / weights.sum()


def gather(simulation: fm.Simulation) -> LinksMesh:
    """The mesh of a simulation on one process."""
    model, order = simulation.model, simulation.fidelity.order
    body = np.where(model.mesh.interface >= 0, model.mesh.interface + len(model.mechanism.rigid_links), -1)
    elements, cells = _ordered(model.elastic.u.function_space, order, len(body))
    lower, pressures = None, None
    if model.elastic.pressure is not None:
        lower, pressures = _ordered(model.elastic.pressure.p.function_space, order - 1, len(body))
    nodes, link = model.elastic.drawn_nodes.copy(), np.asarray(model.mesh.link)
    return LinksMesh(elements, nodes, cells, link, body, pressures, lower)


def _ordered(space, order: int, count: int) -> tuple[Elements, np.ndarray]:
    """Elements and the nodes of each cell in this module's order, known by where they are in the straight cell."""
    dim = space.mesh.geometry.dim
    nodes = space.tabulate_dof_coordinates()[:, :dim]
    dofs = np.array([space.dofmap.cell_dofs(cell) for cell in range(count)])
    at = nodes[dofs]
    corners = at[:, : dim + 1]
    inner = np.linalg.solve(
        np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)[:, None], (at - corners[:, :1])[..., None]
    )[..., 0]
    inside = np.concatenate([1.0 - inner.sum(axis=-1, keepdims=True), inner], axis=-1)
    wanted, powers = exponents(dim, order), np.rint(order * inside).astype(int)
    assert powers.shape[1] == len(wanted)
    match = np.all(powers[:, None] == wanted[None, :, None], axis=-1)
    assert np.all(match.sum(axis=2) == 1)
    order_in_cell = np.argmax(match, axis=2)
    places = np.take_along_axis(inside, order_in_cell[..., None], axis=1).mean(axis=0).astype(REAL)
    places = places / places.sum(axis=1, keepdims=True)  # N sum to one as precisely as strains are
    if order < 3:
        places = wanted / order
    return Elements(order, places), np.take_along_axis(dofs, order_in_cell, axis=1)
