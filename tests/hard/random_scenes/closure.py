"""Joints as positions of pin centres: how far apart the two links of each joint are, and how far turned.

A link's place is a displacement of its centre and a rotation matrix. Both may be complex, and are as precise as
strains are (see ``strain_energy``): small rotations are the difference of matrices close to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, CompliancePlan, JointPlan
from .strain_energy import REAL


@dataclass(frozen=True)
class Place:
    """Place of a body: x = X + shift + (turn − 1) (X − centre); ``angle`` counts full turns (in the plane).

    Points drawn in space are displaced in the plane by bodies that move in it.
    """

    centre: np.ndarray
    shift: np.ndarray
    turn: np.ndarray
    angle: complex = 0.0

    def displacement(self, at: np.ndarray) -> np.ndarray:
        """Of points drawn at (…, dim)."""
        at, dim = np.asarray(at), len(self.centre)
        moved = self.shift + (at[..., :dim] - self.centre) @ (self.turn - np.eye(dim)).T
        return moved if at.shape[-1] == dim else np.concatenate([moved, np.zeros((*at.shape[:-1], 1))], axis=-1)

    def moved(self, velocity: np.ndarray) -> Place:
        """After an infinitesimal motion: velocity of the centre, then angular velocity; (3,) or (6,)."""
        dim = len(self.centre)
        if dim == 2:
            spin = velocity[2] * np.array([[0.0, -1.0], [1.0, 0.0]])
        else:
            x, y, z = velocity[3:]
            spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        # second order too, so that second differences are right
        turn = (np.eye(dim) + spin + 0.5 * spin @ spin) @ self.turn
        return Place(self.centre, self.shift + velocity[:dim], turn, self.angle + velocity[-1])


def place(centre: Sequence[float], pose: np.ndarray) -> Place:
    """The place that a pose stands for: (x, y, angle), or (x, y, z, quaternion w first)."""
    centre, pose = np.asarray(centre, dtype=REAL), np.asarray(pose, dtype=REAL)
    if len(centre) == 2:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return Place(centre, pose[:2], np.array([[c, -s], [s, c]]), pose[2])
    w, x, y, z = pose[3:] / np.sqrt(np.sum(pose[3:] ** 2))
    # Rodrigues' formula, written out
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return Place(centre, pose[:3], turn)


@dataclass(frozen=True)
class Closure:
    """The joints of a blueprint between bodies: rigid links, and the interfaces of flexible ones.

    Attributes:
        ends: bodies of each joint (a, b), as indices.
    """

    blueprint: Blueprint
    ends: dict[str, tuple[int, int]]

    @classmethod
    def of(cls, blueprint: Blueprint, simulation: fm.Simulation) -> Closure:
        """Finds the body of each end of each joint by its link's name and by where it is drawn."""
        bodies, dim = simulation.linkage.bodies, blueprint.dim

        def find(link: str, at) -> int:
            drawn = (*at, 0.0)[:dim]
            return next(
                i
                for i, body in enumerate(bodies)
                if body.link.name == link and (not blueprint.link(link).centreline or np.allclose(body.centre, drawn))
            )

        return cls(blueprint, {j.name: (find(j.a, j.at), find(j.b, j.at)) for j in blueprint.joints})

    @property
    def soft(self) -> dict[str, float]:
        """Compliance of the joints that give way."""
        return {plan.joint: plan.compliance for plan in self.blueprint.effects if isinstance(plan, CompliancePlan)}

    def gap(self, joint: JointPlan, places: Sequence[Place]) -> np.ndarray:
        """Vector from a's point to b's, (dim,)."""
        a, b = (places[i] for i in self.ends[joint.name])
        at = np.array((*joint.at, 0.0)[: self.blueprint.dim])
        return b.displacement(at) - a.displacement(at)

    def coordinate(self, joint: JointPlan, places: Sequence[Place]) -> complex:
        """The travel, or the angle, of b relative to a."""
        a, b = (places[i] for i in self.ends[joint.name])
        if joint.kind == "prismatic":
            axis = np.array((*joint.axis, 0.0)[: self.blueprint.dim])
            return self.gap(joint, places) @ (a.turn @ axis)
        if self.blueprint.dim == 2:
            return b.angle - a.angle
        relative, (e1, e2) = a.turn.T @ b.turn, _across(joint)
        sine, cosine = e2 @ relative @ e1 - e1 @ relative @ e2, e1 @ relative @ e1 + e2 @ relative @ e2
        angle = math.atan2(sine.real, cosine.real)
        # d atan2(y, x) = (x dy − y dx) / (x² + y²)
        size = sine.real**2 + cosine.real**2
        return angle + 1j * (cosine.real * sine.imag - sine.real * cosine.imag) / size

    def residual(self, places: Sequence[Place]) -> np.ndarray:
        """Residuals: gaps over the mechanism's length, and angles; compliant gaps left out, (rows,)."""
        length, dim = self.blueprint.length, self.blueprint.dim
        motors = {motor.joint: motor.position for motor in self.blueprint.motors}
        rows = []
        for joint in self.blueprint.joints:
            a, b = (places[i] for i in self.ends[joint.name])
            gap, relative = self.gap(joint, places) / length, a.turn.T @ b.turn
            lean = [] if dim == 2 else [across @ relative @ unit_axis(joint) for across in _across(joint)]
            turned = [b.angle - a.angle]
            if dim == 3:
                turned = [relative[0, 2], relative[1, 2], 0.5 * (relative[1, 0] - relative[0, 1])]
            match joint.kind:
                case "spherical":
                    rows += [] if joint.name in self.soft else [*gap]
                case "revolute":
                    rows += [*([] if joint.name in self.soft else gap), *lean]
                case "weld":
                    rows += [*([] if joint.name in self.soft else gap), *turned]
                case "prismatic":
                    x, y = joint.axis[:2]
                    normal = np.array((-y, x, 0.0)[:dim])
                    rows += [gap @ (a.turn @ normal), *([] if dim == 2 else [gap @ a.turn[:, 2]]), *turned]
            if joint.name in motors:
                scale = length if joint.kind == "prismatic" else 1.0
                rows.append((self.coordinate(joint, places) - motors[joint.name]) / scale)
        return np.array(rows)


def unit_axis(joint: JointPlan) -> np.ndarray:
    """Unit vector along the axis of a revolute joint in space; z by default."""
    axis = np.array((0.0, 0.0, 1.0) if joint.axis is None else (*joint.axis, 0.0)[:3])
    return axis / np.linalg.norm(axis)


def _across(joint: JointPlan) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across the axis, right-handed with it; x and y for z."""
    axis = unit_axis(joint)
    start = np.eye(3)[0] if abs(axis[0]) < 0.9 else np.eye(3)[1]
    first = start - (start @ axis) * axis
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)
