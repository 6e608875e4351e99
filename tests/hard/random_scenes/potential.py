"""The total potential of a scene at a state, from nodal displacements and places of bodies, by a route of its own.

Π = Σ_cells Σ_q w_q b W(F_q) − ∫ ρ b g · u + Σ ½ k (φ − φ₀)² + Σ ½ |gap|² / c − Σ f d · u(P)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, EffectPlan, ForcePlan, GravityPlan, LinkPlan, SpringPlan
from .closure import Closure, Place, place
from .links_mesh import LinksMesh, gather, quadrature, shape_functions
from .strain_energy import COMPLEX, REAL, energy_density


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
    """

    blueprint: Blueprint
    mesh: LinksMesh
    closure: Closure
    degree: int
    centres: np.ndarray
    fixed: tuple[bool, ...]
    rows: dict[str, int]

    @classmethod
    def of(cls, blueprint: Blueprint, simulation: fm.Simulation) -> Potential:
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
        )

    @cached_property
    def held(self) -> np.ndarray:
        """The body that each node moves with, −1 for free nodes, (n,)."""
        held = np.full(len(self.mesh.nodes), -1)
        for cell in np.flatnonzero(self.mesh.body >= 0):
            held[self.mesh.cells[cell]] = self.mesh.body[cell]
        return held

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

    def value(self, u: np.ndarray, places: Sequence[Place], magnitude: float) -> complex:
        """Π at nodal displacements u (n, dim) with ``magnitude`` of the force that changes."""
        value = self.strain_energy(u) + self.body_potential(u, places)
        for force, size in self.acting(magnitude):
            value -= size * self.travel(force, u, places)
        return value

    def strain_energy(self, u: np.ndarray) -> complex:
        """Σ_cells Σ_q w_q b W(F_q)."""
        _, weights = self._rule
        total = 0.0
        for link, cells in self._groups:
            there = u[self.mesh.cells[cells]].astype(COMPLEX if np.iscomplexobj(u) else REAL)
            F = np.eye(self.mesh.dim) + np.einsum("mki,mqkj->mqij", there, self._slopes[cells])
            density = energy_density(F, link.law, link.young, link.poisson, self.blueprint.space)
            depth = link.depth if self.mesh.dim == 2 else 1.0
            total = total + depth * np.einsum("mq,q,mq->", density, weights, self._volumes[cells])
        return total

    def tangents(self, u: np.ndarray, *, imaginary: float, real: float) -> Iterator[tuple[np.ndarray, ...]]:
        """∂²W/∂F∂F times b w at quadrature points of each link, by a real difference of imaginary ones.

        Yields:
            Cells (m,), ∂N/∂X (m, q, k, dim), and the tangents (m, q, dim, dim, dim, dim).
        """
        _, weights = self._rule
        dim = self.mesh.dim
        entries = [(i, j) for i in range(dim) for j in range(dim)]
        for link, cells in self._groups:
            slopes = self._slopes[cells]
            F = np.eye(dim) + np.einsum("mki,mqkj->mqij", u[self.mesh.cells[cells]].astype(REAL), slopes)
            tangent = np.zeros((*F.shape, dim, dim))

            def stress(G: np.ndarray, link: LinkPlan = link) -> np.ndarray:
                P = np.zeros(G.shape, dtype=REAL)
                for i, j in entries:
                    step = np.zeros((dim, dim), dtype=COMPLEX)
                    step[i, j] = 1j * imaginary
                    density = energy_density(G + step, link.law, link.young, link.poisson, self.blueprint.space)
                    P[..., i, j] = density.imag / imaginary
                return P

            for i, j in entries:
                step = np.zeros((dim, dim))
                step[i, j] = real
                tangent[..., i, j] = (stress(F + step) - stress(F - step)) / (2 * real)
            depth = link.depth if dim == 2 else 1.0
            size = depth * weights * self._volumes[cells]
            yield cells, slopes.astype(float), size[..., None, None, None, None] * tangent

    def body_potential(self, u: np.ndarray, places: Sequence[Place]) -> complex:
        """Of effects."""
        value = 0.0
        for plan in self.blueprint.effects:
            match plan:
                case SpringPlan(joint=name, stiffness=stiffness, rest=rest):
                    turn = self.closure.coordinate(self.blueprint.joint(name), places)
                    value = value + 0.5 * stiffness * (turn - rest) ** 2
                case GravityPlan():
                    value = value - self._weight(plan, u)
        for name, compliance in self.closure.soft.items():
            gap = self.closure.gap(self.blueprint.joint(name), places)
            value = value + 0.5 * (gap @ gap) / compliance
        return value

    def alone(self, effect: EffectPlan) -> Potential:
        """The same scene with no other effect."""
        blueprint = replace(self.blueprint, effects=(effect,))
        return replace(self, blueprint=blueprint, closure=replace(self.closure, blueprint=blueprint))

    def travel(self, force: ForcePlan, u: np.ndarray, places: Sequence[Place]) -> complex:
        """d · u(P), from the drawn configuration."""
        at, direction = (np.array((*v, 0.0)[: self.mesh.dim]) for v in (force.at, force.direction))
        direction = direction / np.linalg.norm(direction)
        if force.on not in self.rows:
            body = next(i for i, name in enumerate(self._names) if name == force.on)
            return direction @ places[body].displacement(at)
        cell, inside = self._located[force.name]
        return direction @ (shape_functions(inside[None], self.mesh.order)[0] @ u[self.mesh.cells[cell]])

    def acting(self, magnitude: float) -> list[tuple[ForcePlan, float]]:
        """All forces with their sizes."""
        first, *others = self.blueprint.forces
        return [(first, magnitude), *((plan, plan.magnitude) for plan in others)]

    @cached_property
    def weight(self) -> float:
        """Σ |ρ g| b ∫ dX, the weight of all links."""
        ones = np.ones((len(self.mesh.nodes), self.mesh.dim))
        plans = [plan for plan in self.blueprint.effects if isinstance(plan, GravityPlan)]
        return sum(self._weight(plan, ones * _unit(plan, self.mesh.dim)) for plan in plans)

    def _weight(self, plan: GravityPlan, u: np.ndarray) -> complex:
        # u of the mesh's order times the volume of a curved cell, of degree dim: exact
        points, weights = quadrature(self.mesh.dim, self.mesh.order + self.mesh.dim)
        N = shape_functions(points, self.mesh.order)
        sums = np.einsum("mq,q,qk,mki->mi", self.mesh.volumes(points), weights, N, u[self.mesh.cells])
        g = np.array((*plan.acceleration, 0.0)[: self.mesh.dim])
        depth = np.ones(len(self.mesh.cells))
        if self.mesh.dim == 2:
            for link, row in self.rows.items():
                depth[self.mesh.link == row] = self.blueprint.link(link).depth
        return plan.density * np.sum(depth[:, None] * sums * g)

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
