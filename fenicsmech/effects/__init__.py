"""Effects: what may act on a mechanism beside its links, joints and forces, one per file.

- ``protocol``: energies on links and potentials of bodies, all that solvers see of an effect
- ``gravity``: weight

An effect that a scene does not list costs nothing: no form, no unknown, no entry of a matrix.
"""

from fenicsmech.effects.gravity import Gravity, Mass
from fenicsmech.effects.protocol import BodyEffect, LinkEffect, LinkFields, PosePotential

__all__ = ["BodyEffect", "Gravity", "LinkEffect", "LinkFields", "Mass", "PosePotential"]
