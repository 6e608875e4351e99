"""Rigid-body coordinates in space: pose (t_x, t_y, t_z, w, v_x, v_y, v_z) with unit quaternion (w, v)."""

from __future__ import annotations

import numpy as np
import sympy

from fenicsmech.joints.planar_space import PLANAR
from fenicsmech.joints.space import RigidSpace


def _cross_matrices() -> np.ndarray:
    """[e_a]× for the three unit vectors, shape (3, 3, 3)."""
    return np.stack([np.cross(np.eye(3)[a], np.eye(3)).T for a in range(3)])


def _second_derivative() -> np.ndarray:
    """∂²R/∂q_a∂q_b of the quadratic R(q), shape (4, 4, 3, 3)."""
    hessian = np.zeros((4, 4, 3, 3))
    unit = np.eye(3)
    for a, cross in enumerate(_cross_matrices()):
        hessian[0, 1 + a] = hessian[1 + a, 0] = 2.0 * cross
        for b in range(3):
            outer = np.outer(unit[a], unit[b])
            hessian[1 + a, 1 + b] = 2.0 * (outer + outer.T) - 4.0 * unit[a, b] * unit
    return hessian


_HESSIAN = _second_derivative()


class Spatial(RigidSpace):
    """R(q) = I + 2 (w [v]× + v vᵀ − (v·v) I), quadratic in q, a rotation on |q|² = 1.

    On the unit sphere this equals the homogeneous formula in common use;
    it needs no cancellation at small rotations, and its second derivative is constant.
    """

    dim = 3
    rotation_size = 4
    freedoms = 6

    @property
    def identity(self) -> np.ndarray:
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    def rotation_increment(self, pose: np.ndarray) -> np.ndarray:
        q = pose[3:]
        return 0.5 * np.einsum("abij,a,b->ij", _HESSIAN, q, q)

    def rotation_gradient(self, pose: np.ndarray) -> np.ndarray:
        return np.einsum("abij,b->aij", _HESSIAN, pose[3:])

    def rotation_hessian(self, pose: np.ndarray) -> np.ndarray:
        return _HESSIAN

    def retract(self, poses: np.ndarray) -> np.ndarray:
        poses = np.array(poses)
        poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
        return poses

    def norm_residual(self, pose: np.ndarray) -> np.ndarray:
        return np.array([pose[3:] @ pose[3:] - 1.0])

    def norm_gradient(self, pose: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(3), 2.0 * pose[3:]])[None]

    def norm_hessian(self) -> np.ndarray:
        return 2.0 * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])[None]

    def turns(self, pose: np.ndarray) -> np.ndarray:
        # dq = ½ (0, ω) ∘ q
        w, v = pose[3], pose[4:]
        cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        return 0.5 * np.vstack([-v, w * np.eye(3) - cross])

    def symbolic_rotation(self, parameters: list[sympy.Symbol]) -> sympy.Matrix:
        w, x, y, z = parameters
        v = sympy.Matrix([x, y, z])
        cross = sympy.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return sympy.eye(3) + 2 * (w * cross + v * v.T - v.dot(v) * sympy.eye(3))

    def compose(self, outer: np.ndarray, inner: np.ndarray, lever: np.ndarray) -> np.ndarray:
        carried = self.displace(outer, (lever + inner[:3])[None])[0] + inner[:3]
        (a, b), (v, w) = (outer[3], inner[3]), (outer[4:], inner[4:])
        return self.retract(np.concatenate([carried, [a * b - v @ w], a * w + b * v + np.cross(v, w)]))


SPATIAL = Spatial()


RIGID_SPACES = {2: PLANAR, 3: SPATIAL}
