"""Quantities of equilibria and of links at rest; derivatives with respect to the design field and numbers of parts.

- ``quantity``: the interface of quantities; components and magnitudes of vectors
- ``motion``: displacements and rotations
- ``forces``: forces that prescribe displacements, torques of motors, reactions of joints
- ``links``: strain energy, mass, volume and length of flexible links
- ``outlines``: outlines of flexible links, and smooth extremes over them
- ``thickness``: least thickness of a link
- ``curvature``: largest curvature of its outline
- ``gap``: least gap between links, or a link and an obstacle
- ``sample``: the equilibria at which they are evaluated
- ``number``: numbers of parts, and their derivatives from adjoints
- ``link_numbers``: numbers of laws, depth, changes of temperature
- ``joint_numbers``: stiffness and rest of springs, offsets of motors
- ``joint_places``: positions and axes of joints
- ``sensitivity``: total derivatives by adjoints
"""

from fenicsmech.quantities.curvature import LargestCurvature
from fenicsmech.quantities.forces import ForceMagnitude, JointForce, JointMoment, MotorTorque
from fenicsmech.quantities.gap import LeastGap
from fenicsmech.quantities.joint_numbers import MotorOffset, SpringRest, SpringStiffness
from fenicsmech.quantities.joint_places import JointAxis, JointPosition
from fenicsmech.quantities.link_numbers import Depth, LawParameter, TemperatureChange
from fenicsmech.quantities.links import CentrelineLength, LinkMass, LinkVolume, OfLinks, StrainEnergy
from fenicsmech.quantities.motion import Displacement, Rotation
from fenicsmech.quantities.number import EffectNumber, ModelNumber, NumberKind, NumberTerms, joint_changes, read_kind
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
from fenicsmech.quantities.thickness import LeastThickness
