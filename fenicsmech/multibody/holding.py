"""What holds freedoms that joints and motors leave: potentials of body poses that are no constraints, as springs are.

Along the null space N of the constraint gradient A the potential V has the slope and the curvature

    Nᵀ ∂V/∂z,     Nᵀ (∂²V/∂z² − Σ λ_k ∂²C_k/∂z²) N,     Aᵀλ = ∂V/∂z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fenicsmech.multibody.system import JointSystem

RANK = 1e-9
"""Singular values of A below this are zero: rows and unknowns are scaled to one."""


class Holding(Protocol):
    """A potential V(z) of the poses of a few ``bodies`` (indices) that acts whatever else does."""

    bodies: tuple[int, ...]

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂V/∂z of ``bodies``, one after the other; ``poses`` are those of all bodies, (bodies, pose_size)."""

    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z², (n · pose_size, n · pose_size)."""


@dataclass(frozen=True)
class FreeMotions:
    """What potentials do along the motions that joints and motors leave, in units of ``JointSystem.pose_scale``.

    Attributes:
        motions: N as rows, orthonormal, (n, size).
        slope: (n,).
        curvature: (n, n).
    """

    motions: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


def free_motions(system: JointSystem, poses: np.ndarray, motors: np.ndarray, holding: Sequence[Holding]) -> FreeMotions:
    """Slope and curvature of all of ``holding`` at ``poses`` (bodies, pose_size), motors at ``motors``."""
    scale = system.pose_scale
    scaled = system.row_scale[:, None] * system.gradient(poses, motors) * scale
    _, values, right = np.linalg.svd(scaled, full_matrices=True)
    motions = right[int(np.sum(values > RANK)) :]
    slope, curvature = np.zeros(system.size), np.zeros((system.size, system.size))
    for potential in holding:
        own, columns = _places(system, potential)
        slope[columns] += potential.gradient(poses)[own]
        curvature[np.ix_(columns, columns)] += potential.hessian(poses)[np.ix_(own, own)]
    multipliers = system.row_scale * np.linalg.lstsq(scaled.T, scale * slope, rcond=RANK)[0]
    for rows, columns, block in system.hessian_blocks(poses, motors, multipliers):
        curvature[np.ix_(rows, columns)] -= block
    along = motions @ (curvature * np.outer(scale, scale)) @ motions.T
    return FreeMotions(motions, motions @ (scale * slope), 0.5 * (along + along.T))


def _places(system: JointSystem, potential: Holding) -> tuple[np.ndarray, np.ndarray]:
    """Which of a potential's derivatives belong to which columns; fixed bodies have none."""
    size = system.space.pose_size
    free = [(k, body) for k, body in enumerate(potential.bodies) if body in system.columns]
    own = [size * k + np.arange(size) for k, _ in free]
    columns = [system.columns[body] for _, body in free]
    none = np.zeros(0, dtype=int)
    return np.concatenate([none, *own]), np.concatenate([none, *columns])
