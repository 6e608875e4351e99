"""Potentials V(z) of the poses of a few bodies, such as springs and weights, and the free coordinate of a joint.

Equilibrium needs ∂V/∂z and ∂²V/∂z², designs the derivatives of ∂V/∂z by numbers of V and by the places of joints.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from fenicsmech.errors import EquilibriumError
from fenicsmech.joints import coordinate_rate, free_coordinate
from fenicsmech.mechanism import Effect, Joint
from fenicsmech.multibody.linkage import Linkage
from fenicsmech.multibody.places import JointChange
from fenicsmech.multibody.points import BodyPoint


class PosePotential(ABC):
    """A potential V(z) of the poses of a few bodies.

    Attributes:
        bodies: indices of the bodies.
        holds: whether it acts in full from the start, as springs do, instead of growing with the load factor.
        numbers: that designs may change, by name; none by default.
    """

    bodies: tuple[int, ...]
    holds: bool = False
    numbers: dict[str, float] = MappingProxyType({})  # type: ignore[assignment]

    @abstractmethod
    def value(self, poses: np.ndarray) -> float:
        """V; ``poses`` are those of all bodies, (bodies, pose_size)."""

    @abstractmethod
    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂V/∂z of ``bodies``, one after the other, (n · pose_size,)."""

    @abstractmethod
    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z², (n · pose_size, n · pose_size)."""

    def factor(self, load_factor: float) -> float:
        """The factor that V counts with."""
        return 1.0 if self.holds else load_factor

    def check_step(self, before: np.ndarray, after: np.ndarray) -> None:
        """Checks that V is continuous between the poses (bodies, pose_size) of two points of a path, a step apart.

        Raises:
            EquilibriumError: the path leaves the poses that V holds for.
        """
        return

    def gradient_by(self, name: str, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z∂p of one of ``numbers``, (n · pose_size,)."""
        raise NotImplementedError(f"{type(self).__name__} has no numbers")

    def gradient_by_places(self, changes: Mapping[int, JointChange], poses: np.ndarray) -> np.ndarray | float:
        """∂²V/∂z∂p of a number p that changes the places of joints, (n · pose_size,).

        Zero by default, which is right where V refers to no joint. A potential that does overrides it, and reads
        places from ``JointSystem.places``, as ``JointCoordinate`` does; otherwise derivatives with respect to
        ``JointPosition`` and ``JointAxis`` are wrong.

        Args:
            changes: by a unit of p, by index of the connection (``Linkage.connection_of``).
            poses: of all bodies, (bodies, pose_size).
        """
        return 0.0


def spring_potentials(effects: Sequence[Effect], linkage: Linkage) -> tuple[PosePotential, ...]:
    """The potentials of ``effects`` that act in full from the start."""
    return tuple(found for effect in effects for found in effect.pose_potentials(linkage) if found.holds)


class DeadForce(PosePotential):
    """−F · u of a point that moves with a body."""

    def __init__(self, point: BodyPoint, force: np.ndarray) -> None:
        self.bodies, self._point, self._force = (point.body,), point, force

    def value(self, poses):
        return -float(self._force @ self._point.displacement(None, poses))

    def gradient(self, poses):
        return -self._force @ self._point.gradient(poses)

    def hessian(self, poses):
        return -self._point.hessian(poses, self._force)


class TravelSpring(PosePotential):
    """½ (w − d)², w = −V the work of dead forces of magnitude one: least where w is nearest to d."""

    def __init__(self, forces: Sequence[DeadForce], travel: float) -> None:
        self.bodies = tuple(sorted({body for force in forces for body in force.bodies}))
        self._forces, self._travel = forces, travel

    def value(self, poses):
        return 0.5 * self._short(poses) ** 2

    def gradient(self, poses):
        return self._short(poses) * sum(self._spread(force, force.gradient(poses)) for force in self._forces)

    def hessian(self, poses):
        slope = sum(self._spread(force, force.gradient(poses)) for force in self._forces)
        curvature = np.zeros((len(slope), len(slope)))
        for force in self._forces:
            own = self._own(force, poses)
            curvature[own, own] += force.hessian(poses)
        return np.outer(slope, slope) + self._short(poses) * curvature

    def _short(self, poses: np.ndarray) -> float:
        """d − w."""
        return self._travel + sum(force.value(poses) for force in self._forces)

    def _spread(self, force: DeadForce, slope: np.ndarray) -> np.ndarray:
        """A slope by the pose of one force's body, among those of all ``bodies``."""
        spread = np.zeros((len(self.bodies), len(slope)))
        spread[self.bodies.index(force.bodies[0])] = slope
        return spread.ravel()

    def _own(self, force: DeadForce, poses: np.ndarray) -> slice:
        first = poses.shape[1] * self.bodies.index(force.bodies[0])
        return slice(first, first + poses.shape[1])


class JointCoordinate:
    """φ, the free coordinate of a ``joint`` that can have a motor: the angle or travel of its second link.

    Attributes:
        bodies: indices of both bodies.
    """

    def __init__(self, linkage: Linkage, joint: Joint) -> None:
        self._k, self._places = linkage.connection_of(joint), linkage.joints.places
        connection = linkage.joints.connections[self._k]
        self.bodies = (connection.a, connection.b)
        self._joint, self._formula = joint, free_coordinate(joint.kind, linkage.dim)

    def value(self, poses: np.ndarray) -> float:
        """φ, zero as drawn, from the ``poses`` of all bodies, (bodies, pose_size)."""
        return float(self._formula.value(*self._point(poses))[0])

    def check_step(self, before: np.ndarray, after: np.ndarray) -> None:
        """Checks that φ does not jump between the poses (bodies, pose_size) of two points of a path, a step apart.

        Raises:
            EquilibriumError: an angle in space passes 2π or −2π, where its formula jumps by 4π.
        """
        start, end = self.value(before), self.value(after)
        if self._places.dim == 3 and not self._joint.kind.sliding and abs(end - start) > 2.0 * math.pi:
            limit = "2π" if start > 0.0 else "−2π"
            raise EquilibriumError(
                f"angle of {self._joint.name!r}",
                f"it passes {limit} rad, and in space angles stay within a full turn",
                "Turn the joint less far, or simulate in the plane, or with mid-plane symmetry",
            )

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂φ/∂z of ``bodies``, one after the other, (2 pose_size,)."""
        return self._formula.gradient(*self._point(poses))[0]

    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²φ/∂z², (2 pose_size, 2 pose_size)."""
        return self._formula.hessian(*self._point(poses), np.ones(1))

    def place_rates(self, changes: Mapping[int, JointChange], poses: np.ndarray) -> tuple[float, np.ndarray | float]:
        """Derivatives of φ, and of ∂φ/∂z (2 pose_size,), as the places of some connections change."""
        if self._k not in changes:
            return 0.0, 0.0
        formula, (variables, constants) = coordinate_rate(self._joint.kind, self._places.dim), self._point(poses)
        arguments = variables, np.concatenate([constants, self._places.rate(self._k, changes[self._k])])
        return float(formula.value(*arguments)[0]), formula.gradient(*arguments)[0]

    def _point(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return poses[list(self.bodies)].ravel(), self._places[self._k]
