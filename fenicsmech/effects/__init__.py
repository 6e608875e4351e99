"""Effects: what may act on a mechanism beside its links, joints and forces, one per file.

- ``protocol``: energies on links and potentials of bodies, all that solvers see of an effect
- ``faces``: parts of links' boundaries
- ``gravity``: weight
- ``joint_spring``: springs in revolute and prismatic joints
- ``joint_compliance``: pins that give way
- ``pressure``: of a fluid on the boundary of a link
- ``prestrain``: links that would be longer or shorter than drawn
- ``contact``: frictionless contact with ``obstacles``; ``contact_gauge`` measures it

An effect that a scene does not list costs nothing: no form, no unknown, no entry of a matrix.
"""

from fenicsmech.effects.contact import Contact
from fenicsmech.effects.contact_gauge import ContactGauge
from fenicsmech.effects.faces import Faces, find_boundaries
from fenicsmech.effects.gravity import Gravity, Mass
from fenicsmech.effects.joint_compliance import JointCompliance
from fenicsmech.effects.joint_spring import JointSpring
from fenicsmech.effects.obstacles import Cylinder, HalfPlane, Obstacle
from fenicsmech.effects.pressure import Pressure
from fenicsmech.effects.prestrain import Prestrain
from fenicsmech.effects.protocol import (
    BodyEffect,
    JointSoftening,
    LinkEffect,
    LinkFields,
    PosePotential,
    RestStretch,
    holding,
)

__all__ = [
    "BodyEffect",
    "Contact",
    "ContactGauge",
    "Cylinder",
    "Faces",
    "Gravity",
    "HalfPlane",
    "JointCompliance",
    "JointSoftening",
    "JointSpring",
    "LinkEffect",
    "LinkFields",
    "Mass",
    "Obstacle",
    "PosePotential",
    "Pressure",
    "Prestrain",
    "RestStretch",
    "find_boundaries",
    "holding",
]
