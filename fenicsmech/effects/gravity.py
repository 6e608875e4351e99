"""Gravity: weight of flexible links by the density of their material, of rigid links by their mass.

    V = − Σ_links ∫ ρ g · u dV − Σ_rigid m g · u(centre of mass)

with the density ρ, the mass m of a rigid link and the acceleration g.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import ufl

from fenicsmech.checks import point, positive
from fenicsmech.effects.energies import PosePotential
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import RigidSpace
from fenicsmech.mechanism import Effect, Material, RigidLink, in_dimension


@dataclass(frozen=True)
class Mass:
    """Mass of a rigid link.

    Attributes:
        mass: with forces in N and lengths in mm, in tonnes (1 g = 1e-6).
        at: its centre as drawn.

    Raises:
        DescriptionError: the mass is not positive, or the centre is not a point.
    """

    mass: float
    at: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive("mass of a rigid link", self.mass))
        object.__setattr__(self, "at", point("centre of mass of a rigid link", self.at))


@dataclass(frozen=True, eq=False)
class Gravity(Effect):
    """Weight of all links whose density or mass is given.

    Attributes:
        acceleration: g, (9810 mm/s² downwards: (0, −9810)).
        densities: of materials; with N and mm in t/mm³ (water: 1e-9).
        masses: of rigid links.

    Raises:
        DescriptionError: a number makes no sense, or nothing has weight.
    """

    acceleration: tuple[float, ...]
    densities: Mapping[Material, float] = field(default_factory=dict)
    masses: Mapping[RigidLink, Mass] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceleration", point("acceleration of gravity", self.acceleration))
        densities = {m: positive(f"density of {m.name!r}", value) for m, value in self.densities.items()}
        object.__setattr__(self, "densities", densities)
        if not self.densities and not self.masses:
            raise DescriptionError("gravity", "nothing has weight", "Give densities of materials or masses of links")

    def check(self, mechanism, dim):
        used = {link.material for link in mechanism.flexible_links}
        for material in self.densities:
            if material not in used:
                raise DescriptionError(
                    "gravity", f"no link of {mechanism.name!r} is made of {material.name!r}", "Leave it out"
                )
        for link in self.masses:
            if link not in mechanism.rigid_links:
                raise DescriptionError("gravity", f"{link!r} is not a rigid link of {mechanism.name!r}", "Leave it out")
        if dim == 2 and in_dimension(self.acceleration, 3)[2] != 0.0:
            raise DescriptionError(
                "gravity", f"{self.acceleration} leaves the plane", "Simulate in space, or give two coordinates"
            )

    def explain(self):
        heavy = [material.name for material in self.densities] + [link.name for link in self.masses]
        return f"weight of {', '.join(heavy)}"

    def link_energy(self, fields):
        if not self.densities:
            return None
        g = ufl.as_vector(in_dimension(self.acceleration, fields.dim))
        density = fields.cellwise([self.densities.get(link.material, 0.0) for link in fields.links])
        return fields.integral(-density * ufl.dot(g, fields.u), degree=fields.order)

    def pose_potentials(self, linkage):
        g, space = np.array(in_dimension(self.acceleration, linkage.dim)), linkage.joints.space
        found = []
        for link, mass in self.masses.items():
            body = linkage.body_of(link)
            offset = np.array(in_dimension(mass.at, linkage.dim)) - np.array(linkage.bodies[body].centre)
            found.append(_Weight(body, mass.mass * g, offset, space))
        return found


class _Weight(PosePotential):
    """−m g · u of one body's centre of mass."""

    def __init__(self, body: int, weight: np.ndarray, offset: np.ndarray, space: RigidSpace) -> None:
        self.bodies, self._weight, self._offset, self._space = (body,), weight, offset, space

    def value(self, poses):
        return -float(self._weight @ self._space.displace(poses[self.bodies[0]], self._offset[None])[0])

    def gradient(self, poses):
        return -self._weight @ self._space.displacement_gradient(poses[self.bodies[0]], self._offset[None])[0]

    def hessian(self, poses):
        return -self._space.displacement_hessian(poses[self.bodies[0]], np.outer(self._weight, self._offset))
