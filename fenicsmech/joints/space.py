"""What the planar and the spatial rigid-body coordinates have in common.

A body with reference centre c carries the pose z = (t, r): displacement t of its centre and rotation
parameters r. A material point X of the body sits at

    x(z) = c + t + R(r) (X − c),        u(z) = x − X = t + (R(r) − I) (X − c).

Writing R − I without forming R keeps the digits of small motions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import sympy


class RigidSpace(ABC):
    """Rigid-body coordinates in ``dim`` dimensions; poses are arrays of ``pose_size`` numbers.

    Attributes:
        dim: dimension of the space (2 or 3).
        rotation_size: number of rotation parameters r.
        pose_size: ``dim + rotation_size``.
        freedoms: rigid-body degrees of freedom (3 or 6).
    """

    dim: int
    rotation_size: int
    freedoms: int

    @property
    def pose_size(self) -> int:
        return self.dim + self.rotation_size

    @property
    @abstractmethod
    def identity(self) -> np.ndarray:
        """The pose of a body that has not moved, shape (pose_size,)."""

    @abstractmethod
    def rotation_increment(self, pose: np.ndarray) -> np.ndarray:
        """R − I, shape (dim, dim)."""

    @abstractmethod
    def rotation_gradient(self, pose: np.ndarray) -> np.ndarray:
        """∂R/∂r_a, shape (rotation_size, dim, dim)."""

    @abstractmethod
    def rotation_hessian(self, pose: np.ndarray) -> np.ndarray:
        """∂²R/∂r_a∂r_b, shape (rotation_size, rotation_size, dim, dim)."""

    @abstractmethod
    def retract(self, poses: np.ndarray) -> np.ndarray:
        """``poses`` (..., pose_size) put back on the manifold of rotations, to first order unchanged."""

    @abstractmethod
    def norm_residual(self, pose: np.ndarray) -> np.ndarray:
        """Constraints the rotation parameters obey among themselves (|q|² − 1, or none)."""

    @abstractmethod
    def norm_gradient(self, pose: np.ndarray) -> np.ndarray:
        """Gradient of ``norm_residual``, shape (n, pose_size)."""

    @abstractmethod
    def norm_hessian(self) -> np.ndarray:
        """Hessian of ``norm_residual``, shape (n, pose_size, pose_size)."""

    @abstractmethod
    def turns(self, pose: np.ndarray) -> np.ndarray:
        """∂r/∂ω for a small rotation vector ω in space, (rotation_size, 1 or 3)."""

    @abstractmethod
    def symbolic_rotation(self, parameters: list[sympy.Symbol]) -> sympy.Matrix:
        """R(r) in sympy; must be the same formula as the numeric one."""

    @abstractmethod
    def compose(self, outer: np.ndarray, inner: np.ndarray, lever: np.ndarray) -> np.ndarray:
        """Pose of a body that first moved by ``inner`` and is then carried along by ``outer``.

        Args:
            outer: pose of the carrying body, referred to its own centre.
            inner: pose of the carried body before.
            lever: reference centre of the carried body minus that of the carrying one, (dim,).
        """

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
        gradient[:, :, self.dim :] = np.einsum("aij,nj->nia", self.rotation_gradient(pose), offsets)
        return gradient

    def displacement_hessian(self, pose: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Σ_n f_n · ∂²u_n/∂z², shape (pose_size, pose_size), from ``moment`` = Σ_n f_n ⊗ (X_n − c)."""
        hessian = np.zeros((self.pose_size, self.pose_size))
        hessian[self.dim :, self.dim :] = np.einsum("abij,ij->ab", self.rotation_hessian(pose), moment)
        return hessian
