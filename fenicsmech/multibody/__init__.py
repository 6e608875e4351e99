"""The mechanism as bodies and constraints: interfaces, points, assembly, mobility.

- ``constraints``: bodies that move rigidly, and all constraints between them: values, gradients, Hessians
- ``linkage``: bodies and constraints of the described mechanism; free coordinates of its joints
- ``mobility``: motions that joints, motors and springs leave, and dependent constraints
- ``assembly``: the rigid assembly of a configuration
- ``interfaces``: interface nodes of the mesh as functions of body poses, and the design field at nodes
- ``points``: material points: position, gradient and Hessian with respect to the state
"""

from fenicsmech.multibody.assembly import Assembly, AssemblyOptions, assemble, assemble_before_strain
from fenicsmech.multibody.constraints import Body, Connection, JointSystem
from fenicsmech.multibody.interfaces import DesignAtNodes, InterfaceMap
from fenicsmech.multibody.linkage import JointCoordinate, Linkage, build_linkage
from fenicsmech.multibody.mobility import (
    Freedom,
    Motion,
    SpringPotential,
    count_freedom,
    free_motions,
    is_held,
    stiff_motions,
)
from fenicsmech.multibody.points import BodyPoint, LinkPoint, MaterialPoint, body_point, link_point

__all__ = [
    "Assembly",
    "AssemblyOptions",
    "Body",
    "BodyPoint",
    "Connection",
    "DesignAtNodes",
    "Freedom",
    "InterfaceMap",
    "JointCoordinate",
    "JointSystem",
    "LinkPoint",
    "Linkage",
    "MaterialPoint",
    "Motion",
    "SpringPotential",
    "assemble",
    "assemble_before_strain",
    "body_point",
    "build_linkage",
    "count_freedom",
    "free_motions",
    "is_held",
    "link_point",
    "stiff_motions",
]
