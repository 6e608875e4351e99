"""The mechanism as bodies and constraints: interfaces, points, assembly, mobility, redundancy.

- ``body``: rigid links and interface bodies
- ``interfaces``: interface nodes of the mesh as functions of body poses, and the transposes of that map
- ``interpolation``: the design field at the nodes of the displacement field
- ``points``: material points: position, gradient and Hessian with respect to the state
- ``system``: all joint constraints of a set of bodies: values, gradients, Hessians
- ``build``: from the described mechanism to bodies and constraints
- ``holding``: what springs add: potentials of poses that hold freedoms
- ``assembly``: the rigid assembly of a configuration
- ``motions``: motions that joints leave to links that bend no further
- ``mobility``: free directions left and dependent constraints, by name
"""

from fenicsmech.multibody.assembly import Assembly, assemble, assemble_before_strain
from fenicsmech.multibody.body import Body
from fenicsmech.multibody.build import Linkage, build_linkage
from fenicsmech.multibody.coordinate import JointCoordinate
from fenicsmech.multibody.holding import Holding, free_motions
from fenicsmech.multibody.interfaces import InterfaceMap
from fenicsmech.multibody.interpolation import DesignAtNodes
from fenicsmech.multibody.mobility import Freedom, count_freedom, is_held
from fenicsmech.multibody.motions import Motion, stiff_motions
from fenicsmech.multibody.points import BodyPoint, LinkPoint, MaterialPoint, body_point, link_point
from fenicsmech.multibody.system import Connection, JointSystem

__all__ = [
    "Assembly",
    "Body",
    "BodyPoint",
    "Connection",
    "DesignAtNodes",
    "Freedom",
    "Holding",
    "InterfaceMap",
    "JointCoordinate",
    "JointSystem",
    "LinkPoint",
    "Linkage",
    "MaterialPoint",
    "Motion",
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
