"""Effects on a mechanism in addition to its links, joints and forces, one per file.

- ``link_fields``: the fields of links' energies, and parts of links' boundaries
- ``force_region``: averages over regions of links, which forces act on
- ``gravity``: weight
- ``joint_spring``: springs in revolute and prismatic joints, elastic pins
- ``pressure``: of a fluid on the boundary of a link
- ``prestrain``: links whose strain-free length is not the drawn one
- ``temperature``: free thermal expansion of links
- ``contact``: obstacles, and frictionless contact with them

Each is an ``Effect`` of the ``mechanism`` layer in a file of its own. An effect that a scene does not list costs
nothing: no form, no unknown, no entry of a matrix.
"""

from fenicsmech.effects.contact import Contact, Cylinder, HalfPlane, Obstacle, OneSided, TouchingPoints, smooth_gap
from fenicsmech.effects.force_region import region_average
from fenicsmech.effects.gravity import Gravity, Mass
from fenicsmech.effects.joint_spring import JointCompliance, JointSpring
from fenicsmech.effects.link_fields import Boundary, Faces, LinkFields, find_boundaries
from fenicsmech.effects.pressure import Pressure
from fenicsmech.effects.prestrain import Prestrain
from fenicsmech.effects.temperature import Temperature
