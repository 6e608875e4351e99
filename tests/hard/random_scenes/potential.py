"""The total potential of a scene at a state, from nodal displacements and places of bodies, by a route of its own.

Π = Σ_cells Σ_q w_q b W(F F_p⁻¹) det F_p − ∫ ρ b g · u + p ∫ b det F + V_contact
    + Σ ½ k (φ − φ₀)² + Σ ½ |gap|² / c − Σ f d · u(P)

The work of a pressure p on the whole boundary of a link is p times the change of its volume: no boundary is needed.
Loads, pressures, contact, the preload of springs and prestrain F_p grow with a load factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

import fenicsmech as fm

from .blueprint import (
    Blueprint,
    ContactPlan,
    EffectPlan,
    ForcePlan,
    GravityPlan,
    LinkPlan,
    PressurePlan,
    PrestrainPlan,
    SpringPlan,
)
from .closure import Closure, Place, place
from .links_mesh import LinksMesh, gather, quadrature
from .obstacles import Touch, pushed
from .strain_energy import COMPLEX, REAL, determinant, energy_density


@dataclass(frozen=True)
class Potential:
    """Π of a blueprint on the mesh of its simulation.

    Attributes:
        blueprint: what is simulated.
        mesh: of the flexible links.
        closure: its joints.
        degree: of the quadrature.
        centres: drawn centre of each body, (bodies, dim).
        fixed: whether each body is part of the ground.
        rows: which link of the mesh each flexible link is.
        load_factor: of constant loads and effects.
    """

    blueprint: Blueprint
    mesh: LinksMesh
    closure: Closure
    degree: int
    centres: np.ndarray
    fixed: tuple[bool, ...]
    rows: dict[str, int]
    load_factor: float = 1.0

    @classmethod
    def of(cls, blueprint: Blueprint, simulation: fm.Simulation, load_factor: float = 1.0) -> Potential:
        """Gathers the data of a simulation on one process."""
        bodies = simulation.linkage.bodies
        return cls(
            blueprint,
            gather(simulation),
            Closure.of(blueprint, simulation),
            simulation.fidelity.quadrature.degree,
            np.array([body.centre for body in bodies]),
            tuple(body.fixed for body in bodies),
            {link.name: i for i, link in enumerate(simulation.scene.mechanism.flexible_links)},
            load_factor,
        )

    @cached_property
    def held(self) -> np.ndarray:
        """The body that each node moves with, −1 for free nodes, (n,)."""
        held = np.full(len(self.mesh.nodes), -1)
        for cell in np.flatnonzero(self.mesh.body >= 0):
            held[self.mesh.cells[cell]] = self.mesh.body[cell]
        return held

    @cached_property
    def free(self) -> np.ndarray:
        """Which displacements are free: of nodes that no body holds; those on a mid-plane stay in it, (n, dim)."""
        free = np.repeat((self.held < 0)[:, None], self.mesh.dim, axis=1)
        if self.blueprint.half:
            free[np.abs(self.mesh.nodes[:, 2]) < 1e-9 * np.ptp(self.mesh.nodes[:, 2]), 2] = False
        return free

    @cached_property
    def free_pressures(self) -> np.ndarray:
        """Nodes of pressures that count: those of cells that can deform, of links in u–p form."""
        if self.mesh.pressures is None:
            return np.zeros(0, dtype=int)
        rows = [row for name, row in self.rows.items() if self.blueprint.mixed(self.blueprint.link(name))]
        return np.unique(self.mesh.pressures[(self.mesh.body < 0) & np.isin(self.mesh.link, rows)])

    def fields(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n, dim) and pressures (l,) of a state's ``u``, flat."""
        count = self.mesh.nodes.size
        return np.array(u[:count]).reshape(self.mesh.nodes.shape), np.array(u[count:])

    def places(self, poses: np.ndarray) -> list[Place]:
        """Places of all bodies."""
        return [place(centre, pose) for centre, pose in zip(self.centres, poses, strict=True)]

    def nodal(self, free: np.ndarray, places: Sequence[Place]) -> np.ndarray:
        """Displacement of all nodes, (n, dim): ``free`` where nothing holds them, with their bodies elsewhere."""
        u = np.array(free, dtype=np.result_type(free, *(body.shift for body in places)))
        for body in np.unique(self.held[self.held >= 0]):
            nodes = self.held == body
            u[nodes] = places[body].displacement(self.mesh.nodes[nodes])
        return u

    def value(self, u: np.ndarray, places: Sequence[Place], magnitude: float, p: np.ndarray | None) -> complex:
        """Π at nodal displacements u (n, dim) and pressures p with ``magnitude`` of the force that changes."""
        value = self.strain_energy(u, p) + self.effect_energy(u, places)
        for force, size in self.acting(magnitude):
            value -= size * self.travel(force, u, places)
        return value

    def strain_energy(self, u: np.ndarray, p: np.ndarray | None) -> complex:
        """Σ_cells Σ_q w_q b W(F_q F_p⁻¹) det F_p; Π in place of W where links have pressures p, unless None."""
        total = 0.0
        for link, cells in self._groups:
            density = self._density(link, self._gradient(u, cells), self._pressure(link, p, cells))
            total = total + self._integral(link, density, cells)
        return total

    def _gradient(self, u: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """F at the quadrature points of cells, (m, q, dim, dim)."""
        there = u[self.mesh.cells[cells]].astype(COMPLEX if np.iscomplexobj(u) else REAL)
        return np.eye(self.mesh.dim) + np.einsum("mki,mqkj->mqij", there, self._slopes[cells])

    def _pressure(self, link: LinkPlan, p: np.ndarray | None, cells: np.ndarray) -> np.ndarray | None:
        """p at the quadrature points of cells, (m, q); None where the link has none."""
        if p is None or not self.blueprint.mixed(link):
            return None
        N = self.mesh.lower.values(self._rule[0])
        return np.einsum("qk,mk->mq", N, p[self.mesh.pressures[cells]])

    def _density(self, link: LinkPlan, F: np.ndarray, p: np.ndarray | None) -> np.ndarray:
        """Elastic energy per drawn volume, the third dimension left out."""
        volume = REAL(1.0)
        for plan in self.blueprint.effects:
            if isinstance(plan, PrestrainPlan) and plan.link == link.name:
                stretch = 1 + REAL(self.load_factor) * (REAL(plan.stretch) - 1)
                if plan.along is None:
                    F, volume = F / stretch, stretch**3
                else:
                    e = np.array((*plan.along, 0.0)[: self.mesh.dim], dtype=REAL)
                    e = e / np.sqrt(e @ e)
                    F, volume = F @ (np.eye(self.mesh.dim) - (1 - 1 / stretch) * np.outer(e, e)), stretch
        return volume * energy_density(F, link.law, link.young, link.poisson, self.blueprint.space, p)

    def _integral(self, link: LinkPlan, density: np.ndarray, cells: np.ndarray) -> complex:
        """∫ b density dX over cells."""
        return self.factor(link) * np.einsum("mq,q,mq->", density, self._rule[1], self._volumes[cells])

    def rounding(self, link: LinkPlan) -> tuple[float, float]:
        """Norms of the nodal forces of a link of unit modulus, stress ∇u, from independent errors of one.

        Returns:
            By errors of the displacements of nodes, the Frobenius norm of K = ∫ b ∇N · ∇N dX; and by those of ∇u at
            quadrature points.
        """
        cells = np.flatnonzero(self.mesh.link == self.rows[link.name])
        slopes = self._slopes[cells].astype(float)
        size = self.factor(link) * self._rule[1] * self._volumes[cells]
        blocks = np.einsum("mq,mqkd,mqld->mkl", size, slopes, slopes, optimize=True)
        rows, columns = np.broadcast_arrays(self.mesh.cells[cells][:, :, None], self.mesh.cells[cells][:, None])
        stiffness = sparse.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        by_node = float(np.sqrt(self.mesh.dim * stiffness.multiply(stiffness).sum()))
        return by_node, float(np.sqrt(self.mesh.dim * np.sum((size[..., None, None] * slopes) ** 2)))

    def factor(self, link: LinkPlan) -> float:
        """From integrals over the mesh to those over the link: depth in the plane, 2 where half is meshed."""
        return link.depth if self.mesh.dim == 2 else 2.0 if self.blueprint.half else 1.0

    def tangents(self, u: np.ndarray, *, imaginary: float, real: float) -> Iterator[tuple[np.ndarray, ...]]:
        """∂²(W + p det F)/∂F∂F times b w at quadrature points of each link, by a real difference of imaginary ones.

        Yields:
            Cells (m,), ∂N/∂X (m, q, k, dim), and the tangents (m, q, dim, dim, dim, dim).
        """
        _, weights = self._rule
        dim = self.mesh.dim
        entries = [(i, j) for i in range(dim) for j in range(dim)]
        for link, cells in self._groups:
            slopes, pressure = self._slopes[cells], self._pressure_on(link)
            F = self._gradient(u.real, cells)
            tangent = np.zeros((*F.shape, dim, dim))

            def stress(G: np.ndarray, link: LinkPlan = link, pressure: float = pressure) -> np.ndarray:
                P = np.zeros(G.shape, dtype=REAL)
                for i, j in entries:
                    step = np.zeros((dim, dim), dtype=COMPLEX)
                    step[i, j] = 1j * imaginary
                    density = self._density(link, G + step, None) + pressure * determinant(G + step)
                    P[..., i, j] = density.imag / imaginary
                return P

            for i, j in entries:
                step = np.zeros((dim, dim))
                step[i, j] = real
                tangent[..., i, j] = (stress(F + step) - stress(F - step)) / (2 * real)
            size = self.factor(link) * weights * self._volumes[cells]
            yield cells, slopes.astype(float), size[..., None, None, None, None] * tangent

    def effect_energy(self, u: np.ndarray, places: Sequence[Place]) -> complex:
        """Of all effects but prestrain, which changes the strain energy."""
        return self.link_energy(u) + self.body_energy(places)

    def strained(self, u: np.ndarray, stretch: float) -> tuple[float, float]:
        """Share of the volume with a principal stretch, or the inverse of one, above ``stretch`` in a state's ``u``,
        flat; and the least det F."""
        volume, strained, least = 0.0, 0.0, np.inf
        for link, cells in self._groups:
            F = self._gradient(self.fields(u)[0], cells).astype(float)
            stretches = np.linalg.svd(F, compute_uv=False)
            above = np.maximum(stretches.max(axis=-1), 1.0 / stretches.min(axis=-1)) > stretch
            volume += float(self._integral(link, np.ones(above.shape), cells))
            strained += float(self._integral(link, above.astype(float), cells))
            least = min(least, float(np.linalg.det(F).min()))
        return strained / volume, least

    def link_energy(self, u: np.ndarray) -> complex:
        """Of effects on flexible links: weight, contact, pressure."""
        value = 0.0
        for plan in self.blueprint.effects:
            if isinstance(plan, GravityPlan):
                value = value - self.load_factor * self._weight(plan, u)
        for touch in self.touches:
            value = value + self.load_factor * touch.energy(self.mesh, u)
        for link, cells in self._groups:
            if pressure := self._pressure_on(link):
                value = value + pressure * self._integral(link, determinant(self._gradient(u, cells)), cells)
        return value

    def body_energy(self, places: Sequence[Place]) -> complex:
        """Of springs, joints that give way, and obstacles that rigid links touch."""
        value, share = 0.0, self.load_factor
        for plan in self.blueprint.effects:
            match plan:
                case SpringPlan(joint=name, stiffness=stiffness, rest=rest):
                    turn = self.closure.coordinate(self.blueprint.joint(name), places)
                    value = value + 0.5 * stiffness * (turn - share * rest) ** 2
                case ContactPlan(points=points) if points:
                    at = np.array([(*point, 0.0)[: self.blueprint.dim] for point in points])
                    x = at + places[self._names.index(plan.link)].displacement(at)
                    value = value + share * plan.stiffness * np.sum(pushed(plan.obstacle, x))
        for name, compliance in self.closure.soft.items():
            gap = self.closure.gap(self.blueprint.joint(name), places)
            value = value + 0.5 * (gap @ gap) / compliance
        return value

    def alone(self, effect: EffectPlan) -> Potential:
        """The same scene with no other effect."""
        blueprint = replace(self.blueprint, effects=(effect,))
        return replace(self, blueprint=blueprint, closure=replace(self.closure, blueprint=blueprint))

    def _pressure_on(self, link: LinkPlan) -> float:
        plans = [plan for plan in self.blueprint.effects if isinstance(plan, PressurePlan)]
        return self.load_factor * sum(plan.pressure for plan in plans if plan.link == link.name)

    @cached_property
    def touches(self) -> list[Touch]:
        """Boundaries of flexible links that may touch an obstacle."""
        found = []
        for plan in self.blueprint.effects:
            if isinstance(plan, ContactPlan) and not plan.points:
                link, row = self.blueprint.link(plan.link), self.rows[plan.link]
                found.append(Touch.of(plan, link, row, self.mesh, self.factor(link), half=self.blueprint.half))
        return found

    def travel(self, force: ForcePlan, u: np.ndarray, places: Sequence[Place]) -> complex:
        """d · u(P), from the drawn configuration."""
        at, direction = (np.array((*v, 0.0)[: self.mesh.dim]) for v in (force.at, force.direction))
        direction = direction / np.linalg.norm(direction)
        if force.on not in self.rows:
            return direction @ places[self._names.index(force.on)].displacement(at)
        return direction @ self.moved(force, u)

    def moved(self, force: ForcePlan, u: np.ndarray) -> np.ndarray:
        """u(P) of a force on a flexible link, (dim,)."""
        cell, inside = self._located[force.name]
        return self.mesh.elements.values(inside[None])[0] @ u[self.mesh.cells[cell]]

    def led_travel(self, u: np.ndarray, places: Sequence[Place]) -> complex:
        """Σ ratio d · u(P) of the forces that change."""
        led = zip(self.blueprint.ratios, self.blueprint.forces, strict=False)
        return sum(ratio * self.travel(force, u, places) for ratio, force in led)

    def led_slope(self) -> np.ndarray:
        """∂(Σ ratio d · u(P))/∂u at the nodes of links, (n, dim)."""
        slope = np.zeros(self.mesh.nodes.shape)
        for ratio, force in zip(self.blueprint.ratios, self.blueprint.forces, strict=False):
            if force.on in self.rows:
                cell, inside = self._located[force.name]
                direction = np.array((*force.direction, 0.0)[: self.mesh.dim])
                shares = self.mesh.elements.values(inside[None])[0]
                slope[self.mesh.cells[cell]] += ratio * np.outer(shares, direction / np.linalg.norm(direction))
        return slope

    def acting(self, magnitude: float) -> list[tuple[ForcePlan, float]]:
        """All forces with their sizes."""
        ratios, forces = self.blueprint.ratios, self.blueprint.forces
        led = [(force, ratio * magnitude) for ratio, force in zip(ratios, forces, strict=False)]
        return [*led, *((plan, self.load_factor * plan.magnitude) for plan in forces[len(ratios) :])]

    @cached_property
    def weight(self) -> float:
        """Σ |ρ g| b ∫ dX, the weight of all links."""
        ones = np.ones((len(self.mesh.nodes), self.mesh.dim))
        plans = [plan for plan in self.blueprint.effects if isinstance(plan, GravityPlan)]
        return sum(self._weight(plan, ones * _unit(plan, self.mesh.dim)) for plan in plans)

    def _weight(self, plan: GravityPlan, u: np.ndarray) -> complex:
        g = np.array((*plan.acceleration, 0.0)[: self.mesh.dim])
        return plan.density * np.sum(self._shares[..., None] * u[self.mesh.cells] * g)

    @cached_property
    def _shares(self) -> np.ndarray:
        """b ∫ N_k dX of the functions N_k of all cells, (m, k)."""
        # u of the mesh's order times the volume of a curved cell: exact
        points, weights = quadrature(self.mesh.dim, self.mesh.order + self.mesh.dim * (self.mesh.order - 1))
        depth = np.ones(len(self.mesh.cells))
        for link, row in self.rows.items():
            depth[self.mesh.link == row] = self.factor(self.blueprint.link(link))
        return depth[:, None] * ((self.mesh.volumes(points) * weights) @ self.mesh.elements.values(points))

    @cached_property
    def _names(self) -> list[str]:
        """Link of each rigid body, in the order the package lists them: rigid links as described, first."""
        return [link.name for link in self.blueprint.links if not link.centreline]

    @cached_property
    def _rule(self) -> tuple[np.ndarray, np.ndarray]:
        return quadrature(self.mesh.dim, self.degree)

    @cached_property
    def volume(self) -> float:
        """∫ dX of all links."""
        return float(np.sum(self._volumes @ self._rule[1]))

    @cached_property
    def _volumes(self) -> np.ndarray:
        return self.mesh.volumes(self._rule[0])

    @cached_property
    def _slopes(self) -> np.ndarray:
        return self.mesh.gradients(self._rule[0])

    @cached_property
    def _groups(self):
        """(link, cells that can deform) pairs."""
        free = self.mesh.body < 0
        return [
            (self.blueprint.link(name), np.flatnonzero(free & (self.mesh.link == row)))
            for name, row in self.rows.items()
        ]

    @cached_property
    def _located(self) -> dict[str, tuple[int, np.ndarray]]:
        """Cell and barycentric coordinates of the forces on flexible links."""
        found = {}
        for force in self.blueprint.forces:
            if force.on in self.rows:
                cells = np.flatnonzero(self.mesh.link == self.rows[force.on])
                at = np.array((*force.at, 0.0)[: self.mesh.dim])
                found[force.name] = self.mesh.locate(cells, at)
        return found


def _unit(plan: GravityPlan, dim: int) -> np.ndarray:
    g = np.array((*plan.acceleration, 0.0)[:dim])
    return g / np.linalg.norm(g)
