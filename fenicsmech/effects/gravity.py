"""Gravity: weight of flexible links by the density of their material, of rigid links by their mass.

    V = − Σ_links ∫ ρ g · u dV − Σ_rigid m g · u(centre of mass)

with the density ρ, the mass m of a rigid link and the acceleration g.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import ufl

from fenicsmech.errors import DescriptionError, expect, in_plane, point, positive, set_fields
from fenicsmech.mechanism import Effect, RigidLink, in_dimension
from fenicsmech.multibody import DeadForce


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
        set_fields(self, mass=positive("mass of a rigid link", self.mass))
        set_fields(self, at=point("centre of mass of a rigid link", self.at))


@dataclass(frozen=True, eq=False)
class Gravity(Effect):
    """Weight of flexible links whose material has a density, and of rigid links whose mass is given.

    Attributes:
        acceleration: g; 9810 mm/s² downwards is (0, −9810).
        masses: of rigid links.

    Raises:
        DescriptionError: the acceleration is not a vector, or a mass is not a ``Mass``; when it is simulated: nothing
            has weight, or a mass is given for something that is not a rigid link of the mechanism.
    """

    acceleration: tuple[float, ...]
    masses: Mapping[RigidLink, Mass] = field(default_factory=dict)

    def __post_init__(self) -> None:
        expect("gravity", self.masses, Mapping, "a mapping of rigid links", "Give masses={link: Mass(…)}")
        for link, mass in self.masses.items():
            expect(f"gravity on {getattr(link, 'name', link)!r}", mass, Mass, "a mass", "Give Mass(mass, at=…)")
        set_fields(self, acceleration=point("acceleration of gravity", self.acceleration))

    def check(self, mechanism, dim):
        if not self.masses and not any(link.material.density for link in mechanism.flexible_links):
            remedy = "Give a material its density=…, or masses of rigid links"
            raise DescriptionError("gravity", f"nothing of {mechanism.name!r} has weight", remedy)
        for link in self.masses:
            if link not in mechanism.rigid_links:
                raise DescriptionError("gravity", f"{link!r} is not a rigid link of {mechanism.name!r}", "Leave it out")
        in_plane("acceleration of gravity", self.acceleration, dim)

    def explain(self):
        return ", ".join(["weight of flexible links by their density", *(f"of {link.name}" for link in self.masses)])

    def link_energy(self, fields):
        densities = [link.material.density or 0.0 for link in fields.links]
        if not any(densities):
            return None
        g, density = ufl.as_vector(in_dimension(self.acceleration, fields.dim)), fields.cellwise(densities)
        return fields.integral(-density * ufl.dot(g, fields.u), degree=fields.order)

    def pose_potentials(self, linkage):
        g = np.array(in_dimension(self.acceleration, linkage.dim))
        return [DeadForce(linkage.point(link, mass.at), mass.mass * g) for link, mass in self.masses.items()]
