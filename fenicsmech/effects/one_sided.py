"""One-sided constraints g(x) ≥ 0 on the boundary of flexible links, at the points of a quadrature of its energy.

Between gap g and pressure p the compliance c of the constraint stands:

    p ≥ 0,     g + c p ≥ 0,     p (g + c p) = 0,

which is p = ⟨−g⟩ / c, and the energy of the constraint is ∫ ½ ⟨−g⟩² / c dA over the boundary at rest. That energy is a
form like any other. Here its points are at hand, for Newton steps that find those that touch (see ``active_set``):

    forces     −Σ w p ∇g,     stiffness     Σ w (D ∇g ⊗ ∇g − p ∇²g),     D = −∂p/∂g.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import basix
import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import bsr_matrix, csr_matrix, identity, kron

from fenicsmech.compat import add_ghosts, cell_dofs, cell_nodes, owned_values
from fenicsmech.effects.link_fields import Boundary, LinkFields

_FACETS = {2: basix.CellType.interval, 3: basix.CellType.triangle}
_CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}


class OneSided(ABC):
    """Constraints at the points of a boundary, n on this rank.

    Args:
        fields: of the links.
        boundary: with the points.
        degree: of the quadrature.

    Attributes:
        compliances: c, (n,).
        weights: areas that points stand for, of the links at rest, their depth included, (n,).
        gaps: g, (n,), as ``weights`` of the last ``update``.
    """

    compliances: np.ndarray

    def __init__(self, fields: LinkFields, boundary: Boundary, *, degree: int) -> None:
        self._body, self._boundary, dim = fields.body, boundary, fields.dim
        points, self._weights = basix.make_quadrature(_FACETS[dim], degree)
        self._points = np.column_stack([1.0 - points.sum(axis=1), points])
        self._nodes = self._tabulated(fields.u, 0)[0]
        self._shape, *self._along = self._tabulated(fields.body.shape, 1)
        space = fields.u.function_space
        self._motion = fem.Function(space)
        count = self._nodes.shape[1]
        self._global = space.dofmap.index_map.local_to_global(np.arange(count, dtype=np.int32)).astype(np.int64)

    @abstractmethod
    def gap(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, ∇g and ∇²g at places (n, dim): (n,), (n, dim), (n, dim, dim)."""

    def at_points(self, by_facet: np.ndarray) -> np.ndarray:
        """Values of points, (n,), from those of their facets."""
        return np.repeat(by_facet, len(self._points))

    def heights(self) -> np.ndarray:
        """Heights of the cells over their facets, as meshed, (facets,)."""
        dim, mesh = self._body.model.dim, self._body.mesh
        cells = mesh.geometry.x[cell_nodes(mesh)[self._boundary.cells]][..., :dim]
        volume = np.abs(np.linalg.det(cells[:, 1:] - cells[:, :1]))
        edges = self._boundary.places[:, 1:] - self._boundary.places[:, :1]
        area = np.linalg.norm(edges[:, 0] if dim == 2 else np.cross(edges[:, 0], edges[:, 1]), axis=1)
        return volume / area

    def update(self) -> None:
        """Takes the rest shape and the displacements that the fields hold. Local."""
        places, dim = self._boundary.places, self._body.model.dim
        shape = self._body.shape.x.array.reshape(-1, dim)
        rest = (self._points @ places).reshape(-1, dim) + self._shape @ shape
        edges = [np.repeat(places[:, k] - places[:, 0], len(self._points), axis=0) for k in range(1, dim)]
        edges = [edge + along @ shape for edge, along in zip(edges, self._along, strict=True)]
        area = edges[0] if dim == 2 else np.cross(edges[0], edges[1])
        depth = self._body.model.multiplier(self._body.depth.x.array[self._boundary.cells])
        weights = np.outer(depth * np.ones(len(places)), self._weights).ravel()
        self.weights = weights * np.linalg.norm(area, axis=1)
        moved = rest + self._nodes @ self._body.u.x.array.reshape(-1, dim)
        self.gaps, self._normals, self._curvatures = self.gap(moved)

    def rates(self, motion: np.ndarray) -> np.ndarray:
        """∇g · δu at the points, (n,), from δu of this rank's owned nodes, flat."""
        owned_values(self._motion)[:] = motion
        self._motion.x.scatter_forward()
        moved = self._nodes @ self._motion.x.array.reshape(self._nodes.shape[1], -1)
        return np.einsum("ni,ni->n", self._normals, moved)

    def forces(self, pressures: np.ndarray) -> np.ndarray:
        """−Σ w p ∇g, the gradient of the energy where p are the ``pressures``, this rank's owned values, flat."""
        values = -(self.weights * pressures)[:, None] * self._normals
        self._motion.x.array[:] = (self._nodes.T @ values).ravel()
        add_ghosts(self._motion)
        return owned_values(self._motion).copy()

    def add_stiffness(
        self,
        matrix: PETSc.Mat,
        rows_of: Callable[[np.ndarray], np.ndarray],
        stiffness: np.ndarray,
        pressures: np.ndarray,
    ) -> None:
        """Adds Σ w (D ∇g ⊗ ∇g − p ∇²g) into ``matrix`` and leaves it unassembled.

        ``rows_of`` gives the matrix's rows of nodes, numbered over all ranks, ``stiffness`` is D, ``pressures`` p.
        """
        points = np.flatnonzero((stiffness != 0.0) | (pressures != 0.0))
        normals, count = self._normals[points], len(points)
        if not count:
            return
        blocks = stiffness[points, None, None] * normals[:, :, None] * normals[:, None, :]
        blocks = self.weights[points, None, None] * (blocks - pressures[points, None, None] * self._curvatures[points])
        shape = self._nodes[points]
        used = np.unique(shape.indices)
        nodes = kron(shape[:, used], identity(normals.shape[1]), format="csr")
        diagonal = bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=2 * (nodes.shape[0],))
        found = (nodes.T @ diagonal @ nodes).tocsr()
        rows = rows_of(self._global[used]).astype(PETSc.IntType)
        matrix.setValuesIJV(found.indptr.astype(PETSc.IntType), rows[found.indices], found.data, addv=True, rowmap=rows)

    def _tabulated(self, field: fem.Function, order: int) -> list[csr_matrix]:
        """The basis functions of a field's space at the points, (n, local nodes), and for ``order`` 1 their derivatives
        along the facets' edges from the first corner to each other one."""
        space, sides = field.function_space, self._boundary.sides
        dim, dofs = self._body.model.dim, cell_dofs(space)[self._boundary.cells]
        element = basix.create_element(
            basix.ElementFamily.P, _CELLS[dim], self._degree(dofs.shape[1]), basix.LagrangeVariant.gll_warped
        )
        corners = np.vstack([np.zeros(dim), np.eye(dim)])
        values = np.zeros((1 + order * (dim - 1), len(sides), len(self._points), dofs.shape[1]))
        for own in np.unique(sides, axis=0):
            table = element.tabulate(order, self._points @ corners[own])[..., 0]
            here = (sides == own).all(axis=1)
            values[0, here] = table[0]
            for k in range(1, len(values)):
                edge = corners[own[k]] - corners[own[0]]
                values[k, here] = np.einsum("d,dqn->qn", edge, table[1:])
        values[np.abs(values) < 1e-13] = 0.0
        columns = np.broadcast_to(dofs[:, None, :], values.shape[1:]).ravel()
        starts = np.arange(0, columns.size + 1, dofs.shape[1])
        shape, found = (len(starts) - 1, len(field.x.array) // dim), []
        for table in values:
            found.append(csr_matrix((table.ravel(), columns, starts), shape=shape, copy=True))
            found[-1].eliminate_zeros()  # in its own arrays
        return found

    def _degree(self, nodes: int) -> int:
        """The degree of the element with as many nodes."""
        by_nodes = {2: {3: 1, 6: 2, 10: 3}, 3: {4: 1, 10: 2, 20: 3}}
        return by_nodes[self._body.model.dim][nodes]
