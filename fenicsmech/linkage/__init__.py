"""The mechanism as bodies and constraints, without elements: assembly, mobility, redundancy.

- ``bodies``: rigid links and interface bodies
- ``system``: all joint constraints of a set of bodies: values, gradients, Hessians
- ``build``: from the described mechanism to bodies and constraints
- ``holding``: what springs add: potentials of poses that hold freedoms
- ``assembly``: the rigid assembly of a configuration
- ``motions``: motions that joints leave to links that bend no further
- ``mobility``: free directions left and dependent constraints, by name
"""

from fenicsmech.linkage.assembly import Assembly, assemble, assemble_before_strain
from fenicsmech.linkage.bodies import Body
from fenicsmech.linkage.build import Linkage, build_linkage
from fenicsmech.linkage.holding import Holding, free_motions
from fenicsmech.linkage.mobility import Freedom, count_freedom, is_held
from fenicsmech.linkage.motions import Motion, stiff_motions
from fenicsmech.linkage.system import Connection, JointSystem

__all__ = [
    "Assembly",
    "Body",
    "Connection",
    "Freedom",
    "Holding",
    "JointSystem",
    "Linkage",
    "Motion",
    "assemble",
    "assemble_before_strain",
    "build_linkage",
    "count_freedom",
    "free_motions",
    "is_held",
    "stiff_motions",
]
