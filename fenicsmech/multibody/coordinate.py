"""The free coordinate of one joint of a linkage, in the poses of its bodies."""

from __future__ import annotations

import numpy as np

from fenicsmech.joints import free_coordinate
from fenicsmech.mechanism import Joint
from fenicsmech.multibody.build import Linkage


class JointCoordinate:
    """φ of a revolute or prismatic ``joint``: the angle or travel of its second link, zero as drawn.

    Attributes:
        bodies: indices of both bodies.
    """

    def __init__(self, linkage: Linkage, joint: Joint) -> None:
        connection = next(c for c in linkage.joints.connections if c.name == joint.name)
        self.bodies = (connection.a, connection.b)
        centres = np.array([linkage.bodies[body].centre for body in self.bodies])
        self._drawn = np.array(connection.at) - centres, np.array(connection.triad)
        self._formula = free_coordinate(joint.kind, linkage.dim)

    def value(self, poses: np.ndarray) -> float:
        """φ from the ``poses`` of all bodies, (bodies, pose_size)."""
        return self._formula.value(self._both(poses), *self._drawn)

    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂φ/∂z of ``bodies``, one after the other, (2 pose_size,)."""
        return self._formula.gradient(self._both(poses), *self._drawn)

    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²φ/∂z², (2 pose_size, 2 pose_size)."""
        return self._formula.hessian(self._both(poses), *self._drawn)

    def _both(self, poses: np.ndarray) -> np.ndarray:
        return poses[list(self.bodies)].ravel()
