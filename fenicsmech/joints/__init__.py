"""Joints: constraints between two bodies, each a few symbolic lines in a file of its own.

- ``space``, ``planar_space``, ``spatial_space``: poses, rotations and the derivatives of a placed point
- ``kind``: the protocol of a joint and the markers it speaks of
- ``derive``: gradient and Hessian of a joint's equations, derived symbolically
- ``revolute``, ``prismatic``, ``cylindrical``, ``spherical``, ``universal``, ``planar``, ``weld``: the joints
"""

from fenicsmech.joints.coordinate import free_coordinate
from fenicsmech.joints.cylindrical import CYLINDRICAL
from fenicsmech.joints.derive import Constraint, constraint
from fenicsmech.joints.kind import JointKind, PlanarMarker, SpatialMarker
from fenicsmech.joints.planar import PLANAR_JOINT
from fenicsmech.joints.planar_space import PLANAR
from fenicsmech.joints.prismatic import PRISMATIC
from fenicsmech.joints.revolute import REVOLUTE
from fenicsmech.joints.space import RigidSpace
from fenicsmech.joints.spatial_space import RIGID_SPACES, SPATIAL
from fenicsmech.joints.spherical import SPHERICAL
from fenicsmech.joints.universal import UNIVERSAL
from fenicsmech.joints.weld import WELD

__all__ = [
    "CYLINDRICAL",
    "Constraint",
    "JointKind",
    "PLANAR",
    "PLANAR_JOINT",
    "PRISMATIC",
    "PlanarMarker",
    "REVOLUTE",
    "RIGID_SPACES",
    "RigidSpace",
    "SPATIAL",
    "SPHERICAL",
    "SpatialMarker",
    "UNIVERSAL",
    "WELD",
    "constraint",
    "free_coordinate",
]
