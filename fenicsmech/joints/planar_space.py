"""Rigid-body coordinates in the plane: pose (t_x, t_y, θ)."""

from __future__ import annotations

import numpy as np
import sympy

from fenicsmech.joints.space import RigidSpace

_QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


class Planar(RigidSpace):
    """R(θ) = [[cos θ, −sin θ], [sin θ, cos θ]]; the angle counts full turns."""

    dim = 2
    rotation_size = 1
    freedoms = 3

    @property
    def identity(self) -> np.ndarray:
        return np.zeros(3)

    def rotation_increment(self, pose: np.ndarray) -> np.ndarray:
        # cos θ − 1 = −2 sin²(θ/2) keeps the digits of small rotations
        half = np.sin(0.5 * pose[2])
        return np.sin(pose[2]) * _QUARTER_TURN - 2.0 * half * half * np.eye(2)

    def rotation_gradient(self, pose: np.ndarray) -> np.ndarray:
        return (np.cos(pose[2]) * _QUARTER_TURN - np.sin(pose[2]) * np.eye(2))[None]

    def rotation_hessian(self, pose: np.ndarray) -> np.ndarray:
        return -(np.eye(2) + self.rotation_increment(pose))[None, None]

    def retract(self, poses: np.ndarray) -> np.ndarray:
        return poses

    def norm_residual(self, pose: np.ndarray) -> np.ndarray:
        return np.zeros(0)

    def norm_gradient(self, pose: np.ndarray) -> np.ndarray:
        return np.zeros((0, 3))

    def norm_hessian(self) -> np.ndarray:
        return np.zeros((0, 3, 3))

    def turns(self, pose: np.ndarray) -> np.ndarray:
        return np.ones((1, 1))

    def symbolic_rotation(self, parameters: list[sympy.Symbol]) -> sympy.Matrix:
        (angle,) = parameters
        return sympy.Matrix([[sympy.cos(angle), -sympy.sin(angle)], [sympy.sin(angle), sympy.cos(angle)]])

    def compose(self, outer: np.ndarray, inner: np.ndarray, lever: np.ndarray) -> np.ndarray:
        carried = self.displace(outer, (lever + inner[:2])[None])[0] + inner[:2]
        return np.array([*carried, outer[2] + inner[2]])


PLANAR = Planar()
