"""Poses from scipy's rotations, independent of the package's own."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fenicsmech.joints import RIGID_SPACES, RigidSpace

SPACES = PLANAR, SPATIAL = RIGID_SPACES[2], RIGID_SPACES[3]


def turn(space: RigidSpace, omega: np.ndarray) -> Rotation:
    """The finite rotation by the vector ``omega`` (3,), or (1,) about z in the plane."""
    return Rotation.from_rotvec(omega if space.dim == 3 else [0.0, 0.0, omega[0]])


def matrix(space: RigidSpace, rotation: Rotation) -> np.ndarray:
    """The rotation matrix (dim, dim)."""
    return rotation.as_matrix()[: space.dim, : space.dim]


def pose(space: RigidSpace, displacement: np.ndarray, rotation: Rotation) -> np.ndarray:
    """The pose (pose_size,) of a body moved by ``displacement`` (dim,) and turned by ``rotation``."""
    x, y, z, w = rotation.as_quat()
    parameters = (w, x, y, z) if space.dim == 3 else (rotation.as_rotvec()[2],)
    return np.array([*displacement, *parameters])


def random_rotation(space: RigidSpace, rng: np.random.Generator) -> Rotation:
    """Any rotation in space, one by up to half a turn in the plane."""
    return turn(space, rng.uniform(-np.pi, np.pi, 1)) if space.dim == 2 else Rotation.from_quat(rng.standard_normal(4))


def random_pose(space: RigidSpace, rng: np.random.Generator) -> np.ndarray:
    """A pose far from the identity."""
    return pose(space, rng.standard_normal(space.dim), random_rotation(space, rng))


def rotation_of(space: RigidSpace, pose: np.ndarray) -> Rotation:
    """scipy's rotation for the rotation parameters of ``pose``."""
    return turn(space, pose[2:]) if space.dim == 2 else Rotation.from_quat(np.roll(pose[3:], -1))


def carry(space: RigidSpace, outer: np.ndarray, inner: np.ndarray, lever: np.ndarray) -> np.ndarray:
    """The pose of a body that first moves by ``inner`` and is then carried along by a body with the pose ``outer``.

    ``lever`` is the reference centre of the carried body minus that of the carrying one, (dim,).
    """
    dim = space.dim
    centre = space.displace(outer, (lever + inner[:dim])[None])[0] + inner[:dim]
    if dim == 2:
        return np.append(centre, outer[2] + inner[2])
    (a, b), (v, w) = (outer[3], inner[3]), (outer[4:], inner[4:])
    return space.retract(np.concatenate([centre, [a * b - v @ w], a * w + b * v + np.cross(v, w)]))
