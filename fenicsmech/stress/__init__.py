"""Recovered stress of flexible links: its peak at the surface, and the places where stress has no limit.

- ``recovery``: polynomials fitted to the stresses of elements in patches
- ``interpolation``: what elements leave out of strains
- ``singular_places``: re-entrant corners, rims of what joints hold, points of forces
- ``surface``: the surface of the links and the stress there, on one process
- ``peak``: the largest stress at an equilibrium
- ``fields``: stress and strain at the vertices of a mesh
- ``edge``: stress along the edge of a link
- ``law_stability``: whether laws are stable at an equilibrium
- ``safety``, ``life``: factors of safety, cycles to failure
- ``measures``: measures of stress and strain, with derivatives
- ``extremes``: their largest values as quantities of designs
- ``drawn``: the recovery in coordinates of the drawn links, and its transpose
"""

from fenicsmech.stress.edge import EdgeStress, edge_stress
from fenicsmech.stress.extremes import LargestStrain, LargestStress, LeastLife, LeastSafety
from fenicsmech.stress.fields import StressField
from fenicsmech.stress.interpolation import InterpolationOptions
from fenicsmech.stress.law_stability import LawStability
from fenicsmech.stress.life import Life, LinkLife, Links, life_between
from fenicsmech.stress.peak import StressRecovery
from fenicsmech.stress.recovered import Recovered, von_mises
from fenicsmech.stress.recovery import RecoveryOptions
from fenicsmech.stress.safety import LinkSafety, Safety, allowables, check_allowables, safety_of
from fenicsmech.stress.singular_places import SingularityOptions, SingularPlace
from fenicsmech.stress.surface import LinkSurface, StressOptions, StressPeak, SurfacePeaks
