"""Motions that joints and locked motors leave, and constraints that depend on each other, from the rank of A = ∂C/∂z.

Flexible links taken as rigid,

    mobility = unknowns − rank A,     redundancy = rows − rank A.

Motions without effect (a two-ball link spinning about itself) count as mobility, dependent equations (a planar loop
of spatial hinges) as redundancy.

Springs are potentials V(z). Along the null space N of A they have the slope and the curvature

    Nᵀ ∂V/∂z,     Nᵀ (∂²V/∂z² − Σ λ_k ∂²C_k/∂z²) N,     Aᵀλ = ∂V/∂z,

and hold the motions along which this curvature is not zero. The others are the zero-energy modes.

Where flexible links are bent, but move as rigid bodies, a link with the velocity v of a point x₀ and the spin ω takes
its bodies along:

    ẋ_i = v + ω × (x_i − x₀),     ṙ_i = (∂r/∂ω)(r_i) ω,     A ż = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fenicsmech.multibody.constraints import JointSystem
from fenicsmech.multibody.linkage import Linkage

_RANK = 1e-9  # singular values of A below this are zero: rows and unknowns are scaled to one


class SpringPotential(Protocol):
    """A potential V(z) of the poses of a few ``bodies`` (indices)."""

    bodies: tuple[int, ...]

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂V/∂z of ``bodies``, one after the other; ``poses`` are those of all bodies, (bodies, pose_size)."""

    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z², (n · pose_size, n · pose_size)."""


@dataclass(frozen=True)
class FreeMotions:
    """The potential of springs along the motions that joints and motors leave, in units of ``JointSystem.pose_scale``.

    Attributes:
        motions: N as rows, orthonormal, (n, size).
        slope: (n,).
        curvature: (n, n).
    """

    motions: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True)
class Freedom:
    """Mobility and redundancy of one configuration.

    Attributes:
        mobility: number of free directions left.
        mobile: names of the links that can move.
        zero_energy: names of the links that move in zero-energy modes; empty if springs hold all.
        redundancy: number of dependent constraint equations.
        redundant: names of the joints whose equations depend on each other.
    """

    mobility: int
    mobile: tuple[str, ...]
    zero_energy: tuple[str, ...]
    redundancy: int
    redundant: tuple[str, ...]


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
        return self.velocity[body] + _cross(self.spin[body], offsets)

    def fastest(self, length: float) -> float:
        """The largest velocity of a body's centre, or of a point at the distance ``length`` from it."""
        spins = np.linalg.norm(self.spin, axis=1) * length
        return float(max(np.max(np.linalg.norm(self.velocity, axis=1)), np.max(spins)))


def count_freedom(
    system: JointSystem, poses: np.ndarray, motors: np.ndarray, springs: Sequence[SpringPotential] = ()
) -> Freedom:
    """Mobility and redundancy of ``system``.

    Args:
        system: the constraints.
        poses: (bodies, pose_size).
        motors: motor values, (connections,).
        springs: potentials that hold motions.
    """
    left, values, right = np.linalg.svd(_scaled_gradient(system, poses, motors), full_matrices=True)
    rank = int(np.sum(values > _RANK))
    dependent = np.max(np.abs(left[:, rank:]), axis=1, initial=0.0)
    free = free_motions(system, poses, motors, springs)
    curvatures, modes = np.linalg.eigh(free.curvature)
    # along these the curvature is that of rounding, beside that of the stiffest motion
    flat = np.abs(curvatures) <= 1e-12 * np.max(np.abs(curvatures), initial=0.0)
    return Freedom(
        mobility=system.size - rank,
        mobile=_moving(system, right[rank:]),
        zero_energy=_moving(system, modes[:, flat].T @ free.motions),
        redundancy=system.rows - rank,
        redundant=tuple(dict.fromkeys(np.array(system.row_names)[_takes_part(dependent)].tolist())),
    )


def free_motions(
    system: JointSystem, poses: np.ndarray, motors: np.ndarray, springs: Sequence[SpringPotential]
) -> FreeMotions:
    """Slope and curvature of all ``springs`` at ``poses`` (bodies, pose_size), motors at ``motors``."""
    scale, size = system.pose_scale, system.space.pose_size
    scaled = _scaled_gradient(system, poses, motors)
    _, values, right = np.linalg.svd(scaled, full_matrices=True)
    motions = right[int(np.sum(values > _RANK)) :]
    slope, curvature = np.zeros(system.size), np.zeros((system.size, system.size))
    for spring in springs:
        # fixed bodies have no columns
        own = np.repeat([body in system.columns for body in spring.bodies], size)
        columns = [column for body in spring.bodies for column in system.columns.get(body, ())]
        slope[columns] += spring.gradient(poses)[own]
        curvature[np.ix_(columns, columns)] += spring.hessian(poses)[np.ix_(own, own)]
    multipliers = system.row_scale * np.linalg.lstsq(scaled.T, scale * slope, rcond=_RANK)[0]
    for rows, columns, block in system.hessian_blocks(poses, motors, multipliers):
        curvature[np.ix_(rows, columns)] -= block
    along = motions @ (curvature * np.outer(scale, scale)) @ motions.T
    return FreeMotions(motions, motions @ (scale * slope), 0.5 * (along + along.T))


def is_held(system: JointSystem, poses: np.ndarray, motors: np.ndarray, rate: np.ndarray, rows: np.ndarray) -> bool:
    """Whether a function of the poses with the gradient ``rate`` (size,) is constant in every motion that is left.

    Args:
        system: the constraints.
        poses: (bodies, pose_size).
        motors: motor values, (connections,).
        rate: its derivative by the pose unknowns, (size,).
        rows: constraints considered.
    """
    scaled = _scaled_gradient(system, poses, motors)[rows]
    wanted = rate * system.pose_scale
    left = wanted - scaled.T @ np.linalg.lstsq(scaled.T, wanted, rcond=_RANK)[0]
    return bool(np.linalg.norm(left) <= _RANK * np.linalg.norm(wanted))


def stiff_motions(linkage: Linkage, poses: np.ndarray, motors: np.ndarray) -> list[Motion]:
    """A basis of the motions that keep joints closed at ``poses`` (bodies, pose_size) and deform no link.

    Velocities are of the order of the mechanism's length or below, spins of the order of one.
    """
    joints, dim = linkage.joints, linkage.dim
    space, length = joints.space, linkage.length
    rigid = [i for i, body in enumerate(linkage.bodies) if body.region is None and not body.fixed]
    links: list[tuple[int, ...]] = [*((i,) for i in rigid), *linkage.interfaces.values()]
    turns = space.freedoms - dim
    places = np.array([body.centre for body in linkage.bodies]) + poses[:, :dim]
    basis = []
    for bodies in links:
        for k in range(space.freedoms):
            z, velocity, spin = np.zeros(joints.size), np.zeros((len(poses), dim)), np.zeros((len(poses), turns))
            for body in bodies:
                slide = length * np.eye(dim)[k] if k < dim else np.zeros(dim)
                spin[body] = np.eye(turns)[k - dim] if k >= dim else 0.0
                velocity[body] = slide + _cross(spin[body], (places[body] - places[bodies[0]])[None])[0]
                z[joints.columns[body]] = np.concatenate(
                    [velocity[body], space.rotation_rates(poses[body]) @ spin[body]]
                )
            basis.append(Motion(z, velocity, spin))
    rates = joints.row_scale[:, None] * (joints.gradient(poses, motors) @ np.array([motion.z for motion in basis]).T)
    _, values, right = np.linalg.svd(rates, full_matrices=True)
    return [
        Motion(*(np.tensordot(weights, [getattr(m, name) for m in basis], 1) for name in ("z", "velocity", "spin")))
        for weights in right[int(np.sum(values > _RANK)) :]
    ]


def _scaled_gradient(system: JointSystem, poses: np.ndarray, motors: np.ndarray) -> np.ndarray:
    """A in units of ``JointSystem.pose_scale``, rows of the order of one."""
    return system.row_scale[:, None] * system.gradient(poses, motors) * system.pose_scale


def _takes_part(entries: np.ndarray) -> np.ndarray:
    """Entries of a unit vector beyond rounding."""
    return np.abs(entries) > 1e-6


def _moving(system: JointSystem, motions: np.ndarray) -> tuple[str, ...]:
    """Names of the links that move in any of ``motions`` (n, size)."""
    moves = _takes_part(motions).any(axis=0)
    names = [system.bodies[body].link.name for body in system.free_bodies if moves[system.columns[body]].any()]
    return tuple(dict.fromkeys(names))


def _cross(spin: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """ω × ``offsets`` (n, dim)."""
    if len(spin) == 1:
        return spin[0] * np.column_stack([-offsets[:, 1], offsets[:, 0]])
    return np.cross(spin, offsets)
