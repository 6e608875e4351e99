"""Quantities of equilibria and of links at rest, with their derivatives by the design and by the laws' numbers.

- ``quantity``: the interface of quantities; components and magnitudes of vectors
- ``motion``: displacements and rotations
- ``forces``: forces that prescribe displacements, torques of motors, reactions of joints
- ``links``: strain energy, mass, volume and length of flexible links
- ``sample``: the equilibria at which they are evaluated
- ``sensitivity``: total derivatives by adjoints
"""

from fenicsmech.quantities.forces import ForceMagnitude, JointForce, JointMoment, MotorTorque
from fenicsmech.quantities.links import CentrelineLength, LinkMass, LinkVolume, StrainEnergy
from fenicsmech.quantities.motion import Displacement, Rotation
from fenicsmech.quantities.quantity import (
    Component,
    FormValue,
    Magnitude,
    Observable,
    Partial,
    Quantity,
    RestObservable,
    border_of,
)
from fenicsmech.quantities.sample import PrescribedDisplacement, Sample, at
from fenicsmech.quantities.sensitivity import Gradient, Sensitivity
