"""Joints: constraints between two bodies, each a few symbolic lines in a file of its own.

- ``rotations``: poses, rotations and the derivatives of a placed point
- ``joint``: the joint kind, the markers of its equations, and their derivatives
- ``revolute``, ``prismatic``, ``cylindrical``, ``spherical``, ``universal``, ``planar``, ``weld``: the joints
"""

from fenicsmech.joints.cylindrical import CYLINDRICAL
from fenicsmech.joints.joint import JointKind, PlanarMarker, SpatialMarker, constraint, free_coordinate
from fenicsmech.joints.planar import PLANAR_JOINT
from fenicsmech.joints.prismatic import PRISMATIC
from fenicsmech.joints.revolute import REVOLUTE
from fenicsmech.joints.rotations import RIGID_SPACES, RigidSpace
from fenicsmech.joints.spherical import SPHERICAL
from fenicsmech.joints.universal import UNIVERSAL
from fenicsmech.joints.weld import WELD

__all__ = [
    "CYLINDRICAL",
    "JointKind",
    "PLANAR_JOINT",
    "PRISMATIC",
    "PlanarMarker",
    "REVOLUTE",
    "RIGID_SPACES",
    "RigidSpace",
    "SPHERICAL",
    "SpatialMarker",
    "UNIVERSAL",
    "WELD",
    "constraint",
    "free_coordinate",
]
