"""Rigid-body coordinates: poses, rotations and the derivatives of a placed point.

- ``space``: the protocol both dimensions share
- ``planar``: pose (t, θ)
- ``spatial``: pose (t, q) with unit quaternion q
"""

from fenicsmech.kinematics.planar import PLANAR
from fenicsmech.kinematics.space import RigidSpace
from fenicsmech.kinematics.spatial import SPATIAL

RIGID_SPACES = {2: PLANAR, 3: SPATIAL}

__all__ = ["PLANAR", "RIGID_SPACES", "SPATIAL", "RigidSpace"]
