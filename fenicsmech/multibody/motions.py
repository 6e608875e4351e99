"""Motions that joints leave to a mechanism whose flexible links move as rigid bodies, however they are bent.

A link moves with the velocity v of a point x₀ and the spin ω, and takes its bodies along:

    ẋ_i = v + ω × (x_i − x₀),     ṙ_i = (∂r/∂ω)(r_i) ω,     A ż = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.multibody.build import Linkage
from fenicsmech.multibody.holding import RANK


@dataclass(frozen=True)
class Motion:
    """Velocities of all bodies.

    Attributes:
        z: of the pose unknowns, (size,).
        velocity: of the bodies' centres, (bodies, dim).
        spin: (bodies, 1 in the plane or 3).
    """

    z: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def at(self, body: int, offsets: np.ndarray) -> np.ndarray:
        """Velocities of points at ``offsets`` (n, dim) from the centre of a body, as placed now."""
        return self.velocity[body] + turned(self.spin[body], offsets)

    def fastest(self, length: float) -> float:
        """The largest velocity of a body's centre, or of what is ``length`` away from it."""
        spins = np.linalg.norm(self.spin, axis=1) * length
        return float(max(np.max(np.linalg.norm(self.velocity, axis=1)), np.max(spins)))


def turned(spin: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """ω × ``offsets`` (n, dim)."""
    if len(spin) == 1:
        return spin[0] * np.column_stack([-offsets[:, 1], offsets[:, 0]])
    return np.cross(spin, offsets)


def stiff_motions(linkage: Linkage, poses: np.ndarray, motors: np.ndarray) -> list[Motion]:
    """A basis of the motions that keep joints closed at ``poses`` (bodies, pose_size) and deform no link.

    Velocities are of the order of the mechanism's length or below, spins of the order of one.
    """
    joints, dim = linkage.joints, linkage.dim
    space, length = joints.space, linkage.length
    links = [(i,) for i, body in enumerate(linkage.bodies) if body.region is None and not body.fixed]
    links += list(linkage.interfaces.values())
    turns = space.freedoms - dim
    places = np.array([body.centre for body in linkage.bodies]) + poses[:, :dim]
    basis = []
    for bodies in links:
        for k in range(space.freedoms):
            z, velocity, spin = np.zeros(joints.size), np.zeros((len(poses), dim)), np.zeros((len(poses), turns))
            for body in bodies:
                twist = length * np.eye(dim)[k] if k < dim else np.zeros(dim)
                spin[body] = np.eye(turns)[k - dim] if k >= dim else 0.0
                velocity[body] = twist + turned(spin[body], (places[body] - places[bodies[0]])[None])[0]
                z[joints.columns[body]] = np.concatenate([velocity[body], space.turns(poses[body]) @ spin[body]])
            basis.append(Motion(z, velocity, spin))
    rates = joints.row_scale[:, None] * (joints.gradient(poses, motors) @ np.array([motion.z for motion in basis]).T)
    _, values, right = np.linalg.svd(rates, full_matrices=True)
    return [
        Motion(*(np.tensordot(shares, [getattr(m, name) for m in basis], 1) for name in ("z", "velocity", "spin")))
        for shares in right[int(np.sum(values > RANK)) :]
    ]
