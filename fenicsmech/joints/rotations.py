"""Rigid-body coordinates in the plane and in space.

A body with reference centre c carries the pose z = (t, r): displacement t of its centre and rotation
parameters r. A material point X of the body sits at

    x(z) = c + t + R(r) (X − c),        u(z) = x − X = t + (R(r) − I) (X − c).

Writing R − I without forming R keeps the digits of small motions.

    in the plane   r = θ, which counts full turns        R − I = sin θ J − 2 sin²(θ/2) I,   J a quarter turn
    in space       r = q = (w, v), a quaternion, |q| = 1     R − I = 2 (w [v]× + v vᵀ − (v·v) I)

The quadratic R(q) equals the homogeneous formula in common use on the unit sphere, has no cancellation at small
rotations, and its second derivative is constant.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np
import sympy


class RigidSpace(ABC):
    """Rigid-body coordinates in ``dim`` dimensions; poses are arrays of ``pose_size`` numbers.

    Rotation parameters may obey a constraint (|q|² − 1 = 0); by default there is none.

    Attributes:
        dim: dimension of the space (2 or 3).
        rotation_size: number of rotation parameters r.
        freedoms: rigid-body degrees of freedom (3 or 6).
        pose_size: ``dim + rotation_size``.
        identity: the pose of a body as drawn, (pose_size,).
    """

    dim: int
    rotation_size: int
    freedoms: int
    identity: np.ndarray

    @property
    def pose_size(self) -> int:
        return self.dim + self.rotation_size

    @abstractmethod
    def rotation_increment(self, pose: np.ndarray) -> np.ndarray:
        """R − I, (dim, dim)."""

    @abstractmethod
    def rotation_gradient(self, pose: np.ndarray) -> np.ndarray:
        """∂R/∂r_a, (rotation_size, dim, dim)."""

    @abstractmethod
    def rotation_hessian(self, pose: np.ndarray) -> np.ndarray:
        """∂²R/∂r_a∂r_b, (rotation_size, rotation_size, dim, dim)."""

    @abstractmethod
    def symbolic_rotation(self, parameters: list[sympy.Symbol]) -> sympy.Matrix:
        """R(r) in sympy, the same formula as the numeric one."""

    @abstractmethod
    def rotation_rates(self, pose: np.ndarray) -> np.ndarray:
        """B = ∂r/∂ω for a small rotation vector ω in space, (rotation_size, 1 or 3)."""

    @abstractmethod
    def rotation_rates_gradient(self, pose: np.ndarray) -> np.ndarray:
        """∂B/∂r_a, (rotation_size, rotation_size, 1 or 3)."""

    @abstractmethod
    def turned(self, vector: np.ndarray, r: np.ndarray) -> np.ndarray:
        """r after a further rotation by the ``vector`` φ, (1,) in the plane and (3,) in space: of R(φ) R(r)."""

    @abstractmethod
    def converted(self, poses: np.ndarray) -> np.ndarray:
        """Poses (n, 3 or 7) in the plane or in space as poses here, (n, pose_size); space to plane by what is in it."""

    def retract(self, poses: np.ndarray) -> np.ndarray:
        """``poses`` (..., pose_size) put back on the manifold of rotations, to first order unchanged."""
        return poses

    def norm_residual(self, pose: np.ndarray) -> np.ndarray:
        """Constraints among the rotation parameters, (n,)."""
        return np.zeros(0)

    def norm_gradient(self, pose: np.ndarray) -> np.ndarray:
        """Gradient of ``norm_residual``, (n, pose_size)."""
        return np.zeros((0, self.pose_size))

    def norm_hessian(self) -> np.ndarray:
        """Hessian of ``norm_residual``, (n, pose_size, pose_size)."""
        return np.zeros((0, self.pose_size, self.pose_size))

    def displace(self, pose: np.ndarray, offsets: np.ndarray) -> np.ndarray:
        """Displacements u of points X − c = ``offsets`` (n, dim), shape (n, dim)."""
        return pose[: self.dim] + offsets @ self.rotation_increment(pose).T

    def rotate(self, pose: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """R ``vector``."""
        return vector + self.rotation_increment(pose) @ vector

    def displacement_gradient(self, pose: np.ndarray, offsets: np.ndarray) -> np.ndarray:
        """∂u/∂z for points X − c = ``offsets`` (n, dim), shape (n, dim, pose_size)."""
        gradient = np.zeros((len(offsets), self.dim, self.pose_size))
        gradient[:, :, : self.dim] = np.eye(self.dim)
        gradient[:, :, self.dim :] = (self.rotation_gradient(pose) @ offsets.T).T
        return gradient

    def displacement_hessian(self, pose: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Σ_n f_n · ∂²u_n/∂z², shape (pose_size, pose_size), from ``moment`` = Σ_n f_n ⊗ (X_n − c)."""
        hessian = np.zeros((self.pose_size, self.pose_size))
        hessian[self.dim :, self.dim :] = np.einsum("abij,ij->ab", self.rotation_hessian(pose), moment)
        return hessian


class PlanarSpace(RigidSpace):
    """Poses (t_x, t_y, θ)."""

    dim = 2
    rotation_size = 1
    freedoms = 3
    identity = np.zeros(3)
    identity.setflags(write=False)
    _identity, _quarter_turn = np.eye(2), np.array([[0.0, -1.0], [1.0, 0.0]])

    def rotation_increment(self, pose):
        # cos θ − 1 = −2 sin²(θ/2) keeps the digits of small rotations
        half = np.sin(0.5 * pose[2])
        return np.sin(pose[2]) * self._quarter_turn - 2.0 * half * half * self._identity

    def rotation_gradient(self, pose):
        return (np.cos(pose[2]) * self._quarter_turn - np.sin(pose[2]) * self._identity)[None]

    def rotation_hessian(self, pose):
        return -(self._identity + self.rotation_increment(pose))[None, None]

    def symbolic_rotation(self, parameters):
        (angle,) = parameters
        # not cos θ, whose difference from one loses the digits of small turns
        sine, cosine = sympy.sin(angle), 1 - 2 * sympy.sin(angle / 2) ** 2
        return sympy.Matrix([[cosine, -sine], [sine, cosine]])

    def rotation_rates(self, pose):
        return np.ones((1, 1))

    def rotation_rates_gradient(self, pose):
        return np.zeros((1, 1, 1))

    def turned(self, vector, r):
        return vector + r

    def converted(self, poses):
        if poses.shape[1] == self.pose_size:
            return poses
        return np.column_stack([poses[:, :2], 2.0 * np.arctan2(poses[:, 6], poses[:, 3])])


def cross_matrix(vector: Iterable) -> list[list]:
    """[v]×, rows of three numbers or symbols: [v]× a = v × a."""
    x, y, z = vector
    return [[0, -z, y], [z, 0, -x], [-y, x, 0]]


def _quaternion_hessian() -> np.ndarray:
    """∂²R/∂q_a∂q_b of the quadratic R(q), (4, 4, 3, 3)."""
    hessian, unit = np.zeros((4, 4, 3, 3)), np.eye(3)
    for a in range(3):
        # ∂²R/∂w∂v_a = 2 [e_a]×,   ∂²R/∂v_a∂v_b = 2 (e_a e_bᵀ + e_b e_aᵀ) − 4 δ_ab I
        hessian[0, 1 + a] = hessian[1 + a, 0] = 2.0 * np.cross(unit[a], unit).T
        for b in range(3):
            outer = np.outer(unit[a], unit[b])
            hessian[1 + a, 1 + b] = 2.0 * (outer + outer.T) - 4.0 * unit[a, b] * unit
    return hessian


class SpatialSpace(RigidSpace):
    """Poses (t_x, t_y, t_z, w, v_x, v_y, v_z) with the unit quaternion q = (w, v)."""

    dim = 3
    rotation_size = 4
    freedoms = 6
    identity = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    identity.setflags(write=False)
    _hessian = _quaternion_hessian()

    def rotation_increment(self, pose):
        q = pose[3:]
        return 0.5 * np.einsum("abij,a,b->ij", self._hessian, q, q)

    def rotation_gradient(self, pose):
        return np.einsum("abij,b->aij", self._hessian, pose[3:])

    def rotation_hessian(self, pose):
        return self._hessian

    def symbolic_rotation(self, parameters):
        w, *vector = parameters
        v = sympy.Matrix(vector)
        return sympy.eye(3) + 2 * (w * sympy.Matrix(cross_matrix(v)) + v * v.T - v.dot(v) * sympy.eye(3))

    def rotation_rates(self, pose):
        # dq = ½ (0, ω) ∘ q
        w, v = pose[3], pose[4:]
        return 0.5 * np.vstack([-v, w * np.eye(3) - cross_matrix(v)])

    def rotation_rates_gradient(self, pose):
        # linear in q
        return np.array([self.rotation_rates(np.append(np.zeros(3), unit)) for unit in np.eye(4)])

    def turned(self, vector, r):
        # p ∘ q = (p₀ q₀ − p · q, p₀ q + q₀ p + p × q),  p = (cos ½|φ|, sin ½|φ| φ / |φ|)
        half, (scalar, *rest) = 0.5 * np.linalg.norm(vector), r
        w, v = np.cos(half), 0.5 * np.sinc(half / np.pi) * vector
        return np.append(w * scalar - v @ rest, w * r[1:] + scalar * v + np.cross(v, rest))

    def converted(self, poses):
        if poses.shape[1] == self.pose_size:
            return poses
        converted, half = np.zeros((len(poses), self.pose_size)), 0.5 * poses[:, 2]
        converted[:, :2], converted[:, 3], converted[:, 6] = poses[:, :2], np.cos(half), np.sin(half)
        return converted

    def retract(self, poses):
        poses = np.array(poses)
        poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
        return poses

    def norm_residual(self, pose):
        return np.array([pose[3:] @ pose[3:] - 1.0])

    def norm_gradient(self, pose):
        return np.concatenate([np.zeros(3), 2.0 * pose[3:]])[None]

    def norm_hessian(self):
        return 2.0 * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])[None]


RIGID_SPACES = {2: PlanarSpace(), 3: SpatialSpace()}
"""Rigid-body coordinates by dimension."""


def across(spin: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """ω × ``offsets`` (..., dim), ω (..., 1) in the plane and (..., 3) in space."""
    if spin.shape[-1] == 1:
        return spin * np.stack([-offsets[..., 1], offsets[..., 0]], axis=-1)
    return np.cross(spin, offsets)
