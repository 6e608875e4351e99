"""Effects on a mechanism beside its links, joints and forces, one per file.

- ``energies``: of fields of links and poses of bodies; ``faces``: parts of links' boundaries
- ``gravity``: weight
- ``joint_spring``: springs in revolute and prismatic joints
- ``joint_compliance``: elastic pins
- ``pressure``: of a fluid on the boundary of a link
- ``prestrain``: links whose strain-free length is not the drawn one
- ``contact``: frictionless contact with ``obstacles``

Each is an ``Effect`` of the ``mechanism`` layer in a file of its own. An effect that a scene does not list costs
nothing: no form, no unknown, no entry of a matrix.
"""

from fenicsmech.effects.contact import Contact, ContactGauge
from fenicsmech.effects.energies import LinkFields, PosePotential, spring_potentials
from fenicsmech.effects.faces import Boundary, Faces, find_boundaries
from fenicsmech.effects.gravity import Gravity, Mass
from fenicsmech.effects.joint_compliance import JointCompliance
from fenicsmech.effects.joint_spring import JointSpring
from fenicsmech.effects.obstacles import Cylinder, HalfPlane, Obstacle
from fenicsmech.effects.pressure import Pressure
from fenicsmech.effects.prestrain import Prestrain

__all__ = [
    "Boundary",
    "Contact",
    "ContactGauge",
    "Cylinder",
    "Faces",
    "Gravity",
    "HalfPlane",
    "JointCompliance",
    "JointSpring",
    "LinkFields",
    "Mass",
    "Obstacle",
    "PosePotential",
    "Pressure",
    "Prestrain",
    "find_boundaries",
    "spring_potentials",
]
