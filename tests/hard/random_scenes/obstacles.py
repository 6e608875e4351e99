"""Contact with rigid obstacles: ∫ ½ κ ⟨−g(x)⟩² dA over the boundary of a link as drawn, g the gap.

The points of ∫ are those of the simulation's rule, at which ⟨·⟩ has kinks: the rule is part of what the discrete energy
is. Gaps may be complex, see ``strain_energy``; which points touch is decided by their real part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .blueprint import ContactPlan, CylinderPlan, LinkPlan, PlanePlan
from .links_mesh import LinksMesh, quadrature

_SOFT = 0.1  # the default κ is this share of the stiffness of a layer of elements


def gap(obstacle: PlanePlan | CylinderPlan, x: np.ndarray) -> np.ndarray:
    """Of points x (…, dim): distance from the obstacle, negative inside it."""
    match obstacle:
        case PlanePlan(point=point, normal=normal):
            n = np.array((*normal, 0.0)[: x.shape[-1]])
            return (x - np.array((*point, 0.0)[: x.shape[-1]])) @ (n / np.linalg.norm(n))
        case CylinderPlan(centre=(a, b), radius=radius):
            return np.sqrt((x[..., 0] - a) ** 2 + (x[..., 1] - b) ** 2) - radius


def pushed(obstacle: PlanePlan | CylinderPlan, x: np.ndarray) -> np.ndarray:
    """½ ⟨−g⟩² of points x (…, dim)."""
    g = gap(obstacle, x)
    return np.where(g.real < 0.0, 0.5 * g**2, 0.0)


@dataclass(frozen=True)
class Touch:
    """The boundary of a link that may touch an obstacle, by the corner of its cells opposite.

    Attributes:
        plan: the contact.
        groups: cells (m,), N (q, k) at points of their facets, and κ dA there with the factor of the link, (m, q).
    """

    plan: ContactPlan
    groups: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]

    @classmethod
    def of(cls, plan: ContactPlan, link: LinkPlan, row: int, mesh: LinksMesh, factor: float, *, half: bool) -> Touch:
        """That of a ``link``, the one with index ``row``; ``half`` models end at a mid-plane, which is no boundary."""
        points, weights = quadrature(mesh.dim - 1, 2 * mesh.order)
        groups = []
        for opposite, cells in mesh.boundary(row):
            inside = np.insert(points, opposite, 0.0, axis=1)
            corners = mesh.nodes[mesh.cells[cells, : mesh.dim + 1]]
            facets = np.delete(corners, opposite, axis=1)
            if half:
                outside = np.abs(facets[:, :, 2]).max(axis=1) > 1e-9 * np.ptp(mesh.nodes[:, 2])
                cells, corners, facets = cells[outside], corners[outside], facets[outside]
            if not len(cells):
                continue
            # κ = 0.1 E / h with the height h of the straight cell on its facet
            ends = corners[:, [opposite]], facets
            height = mesh.dim * _size(np.concatenate(ends, axis=1)) / _size(facets)
            stiffness = _SOFT * link.young / height if plan.stiffness is None else np.full(len(cells), plan.stiffness)
            tangents = np.delete(np.insert(mesh.edges(inside), 0, 0.0, axis=2), opposite, axis=2)[cells]
            area = _size(tangents)
            size = factor * stiffness[:, None] * weights * area
            groups.append((cells, mesh.elements.values(inside), size))
        return cls(plan, tuple(groups))

    def energy(self, mesh: LinksMesh, u: np.ndarray) -> complex:
        """V at nodal displacements (n, dim), real or complex."""
        return sum(
            np.sum(size * pushed(self.plan.obstacle, np.einsum("qk,mki->mqi", N, (mesh.nodes + u)[mesh.cells[cells]])))
            for cells, N, size in self.groups
        )

    def tangents(self, mesh: LinksMesh, u: np.ndarray, *, imaginary: float, real: float):
        """∂²V/∂u∂u of the nodes of each cell: cells (m,), and blocks (m, k, dim, k, dim)."""
        for cells, N, size in self.groups:
            x = np.einsum("qk,mki->mqi", N, (mesh.nodes + u)[mesh.cells[cells]])
            second = _second(lambda at: pushed(self.plan.obstacle, at), x, imaginary, real)
            yield cells, np.einsum("mq,qk,ql,mqij->mkilj", size, N, N, second, optimize=True)


def _size(corners: np.ndarray) -> np.ndarray:
    """Length, area or volume of simplices with these corners, (…, corners, dim) → (…,)."""
    edges = corners[..., 1:, :] - corners[..., :1, :]
    gram = edges @ np.swapaxes(edges, -1, -2)
    return np.sqrt(np.linalg.det(gram)) / (1.0, 1.0, 2.0, 6.0)[edges.shape[-2]]


def _second(value: Callable[[np.ndarray], np.ndarray], x: np.ndarray, imaginary: float, real: float) -> np.ndarray:
    """∂²/∂x∂x of a function of points (…, dim), (…, dim, dim), by a real difference of imaginary ones."""
    axes, second = np.eye(x.shape[-1]), np.zeros((*x.shape, x.shape[-1]))

    def slope(at: np.ndarray) -> np.ndarray:
        return np.stack([value(at + 1j * imaginary * axis).imag / imaginary for axis in axes], axis=-1)

    for j, axis in enumerate(axes):
        second[..., j] = (slope(x + real * axis) - slope(x - real * axis)) / (2 * real)
    return second
