"""Joints: constraints between two bodies, each a class of a few symbolic lines.

- ``rotations``: poses, rotations and the derivatives of a placed point
- ``joint``: revolute, prismatic, cylindrical, spherical, universal and planar joints, the weld; the joint kind, the
  markers of its equations, and their derivatives
"""

from fenicsmech.joints.joint import (
    CYLINDRICAL,
    JOINT_KINDS,
    PLANAR_JOINT,
    PRISMATIC,
    REVOLUTE,
    SPHERICAL,
    UNIVERSAL,
    WELD,
    JointKind,
    PlanarMarker,
    SpatialMarker,
    constraint,
    constraint_rate,
    coordinate_rate,
    free_coordinate,
)
from fenicsmech.joints.rotations import RIGID_SPACES, RigidSpace, across, cross_matrix
