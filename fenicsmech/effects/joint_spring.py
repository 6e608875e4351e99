"""Elastic joints: linear springs in revolute and prismatic joints, and elastic pins.

A spring along the free coordinate φ of a joint:

    V = ½ k (φ − φ₀)² = ½ k φ² − k φ₀ φ + const.

The first term holds the mechanism from the start, the second grows with the load factor of constant
loads, which takes the rest position from 0 to φ₀. Displacements count from the equilibrium with the first term alone,
in which the links are strained where motors have wound the spring up.

Compliance c of a pin: a force λ across it moves its two ends apart by c λ. With the constraint C = x_b − x_a of a rigid
pin,

    C + c λ = 0,    V = ½ |C|² / c,

so that c enters the KKT matrix as −c on the diagonal of the multipliers, and c → 0 is the rigid pin.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from fenicsmech.errors import DescriptionError, expect, finite, positive, set_fields
from fenicsmech.mechanism import Effect, Joint
from fenicsmech.multibody import JointCoordinate, PosePotential


@dataclass(frozen=True)
class JointSpring(Effect):
    """A torsion spring on a revolute joint, or a spring along a prismatic one.

    The coordinate φ is that of a motor: the angle (rad) or travel of the joint's second link, zero as drawn. In the
    plane angles count full turns; in space they hold for |φ| < 2π, and paths that go beyond end with an error.

    Attributes:
        joint: a revolute or prismatic joint.
        stiffness: k; with N and mm in N mm/rad, or N/mm.
        rest: φ₀, where the spring is relaxed; rad or length.

    Raises:
        DescriptionError: this is not a joint, or a number is invalid.
    """

    joint: Joint
    stiffness: float
    rest: float = 0.0

    def __post_init__(self) -> None:
        expect("joint spring", self.joint, Joint, "a joint")
        set_fields(self, stiffness=positive(f"stiffness of {self._name}", self.stiffness))
        set_fields(self, rest=finite(f"rest position of {self._name}", self.rest))

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        if not self.joint.kind.motorised:
            raise DescriptionError(
                self._name,
                f"a {self.joint.kind.name} joint has no single free coordinate",
                "Put springs on revolute or prismatic joints",
            )
        if dim == 3 and not self.joint.kind.sliding and abs(self.rest) >= 2.0 * pi:
            raise DescriptionError(
                self._name,
                f"in 3D angles stay within a full turn, and the rest angle is {self.rest:g} rad",
                "Wind the spring up by less than 2π, or simulate in the plane",
            )

    def explain(self):
        relaxed = f", relaxed at {self.rest:g}" if self.rest else ""
        return f"spring of stiffness {self.stiffness:g} in {self.joint.name!r}{relaxed}"

    def pose_potentials(self, linkage):
        coordinate = JointCoordinate(linkage, self.joint)
        return [kind(coordinate, {"stiffness": self.stiffness, "rest": self.rest}) for kind in (_Stiffness, _Preload)]

    @property
    def _name(self) -> str:
        return f"spring in {self.joint.name!r}"


class _Stiffness(PosePotential):
    """½ k φ²."""

    holds = True

    def __init__(self, coordinate: JointCoordinate, numbers: dict[str, float]) -> None:
        self.bodies, self.numbers, self._coordinate = coordinate.bodies, numbers, coordinate

    def value(self, poses):
        return 0.5 * self.numbers["stiffness"] * self._coordinate.value(poses) ** 2

    def gradient(self, poses):
        return self.numbers["stiffness"] * self.gradient_by("stiffness", poses)

    def check_step(self, before, after):
        self._coordinate.check_step(before, after)

    def hessian(self, poses):
        slope, hessian = self._coordinate.gradient(poses), self._coordinate.hessian(poses)
        return self.numbers["stiffness"] * (np.outer(slope, slope) + self._coordinate.value(poses) * hessian)

    def gradient_by(self, name, poses):
        factor = self._coordinate.value(poses) if name == "stiffness" else 0.0
        return factor * self._coordinate.gradient(poses)

    def gradient_by_places(self, changes, poses):
        rate, slope_rate = self._coordinate.place_rates(changes, poses)
        slope = rate * self._coordinate.gradient(poses) + self._coordinate.value(poses) * slope_rate
        return self.numbers["stiffness"] * slope


class _Preload(PosePotential):
    """−k φ₀ φ."""

    def __init__(self, coordinate: JointCoordinate, numbers: dict[str, float]) -> None:
        self.bodies, self.numbers, self._coordinate = coordinate.bodies, numbers, coordinate

    def value(self, poses):
        return -self._moment * self._coordinate.value(poses)

    def gradient(self, poses):
        return -self._moment * self._coordinate.gradient(poses)

    def hessian(self, poses):
        return -self._moment * self._coordinate.hessian(poses)

    def gradient_by(self, name, poses):
        other = {"stiffness": "rest", "rest": "stiffness"}[name]
        return -self.numbers[other] * self._coordinate.gradient(poses)

    def gradient_by_places(self, changes, poses):
        return -self._moment * self._coordinate.place_rates(changes, poses)[1]

    @property
    def _moment(self) -> float:
        return self.numbers["stiffness"] * self.numbers["rest"]


@dataclass(frozen=True)
class JointCompliance(Effect):
    """Compliance of a joint at the shared point of its links, isotropic; its axis stays aligned.

    Two compliances of one joint act in series. The energy of the joint is not part of a frame's strain energy.

    Attributes:
        joint: a revolute, spherical, universal or weld joint.
        compliance: c; with N and mm in mm/N.

    Raises:
        DescriptionError: this is not a joint, or the compliance is not positive.
    """

    joint: Joint
    compliance: float

    def __post_init__(self) -> None:
        expect("joint compliance", self.joint, Joint, "a joint")
        set_fields(self, compliance=positive(f"compliance of {self.joint.name!r}", self.compliance))

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        if not self.joint.kind.shares_point:
            raise DescriptionError(
                f"compliance of {self.joint.name!r}",
                f"the links of a {self.joint.kind.name} joint share no point",
                "Soften revolute, spherical, universal or weld joints",
            )

    def explain(self):
        return f"compliance {self.compliance:g} of {self.joint.name!r}"

    def soften(self, linkage):
        rows = [row for row, name in enumerate(linkage.joints.row_names) if name == self.joint.name]
        return dict.fromkeys(rows[: linkage.dim], self.compliance)
