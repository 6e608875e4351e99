"""Material laws: the strain energy W(F) per volume of the undeformed material.

- ``law``, ``split``: what a law is; laws with a separate volumetric energy, which have a u–p form
- ``strain``, ``remainders``, ``stretches``: measures of deformation without loss of digits at small strain
- ``held``: long formulas in forms
- ``evaluation``: formulas evaluated without forms
- ``stability``: whether further strain takes more stress
- ``neo_hookean``: four laws of E and ν
- ``rubber``, ``mooney_rivlin``, ``yeoh``, ``gent``, ``ogden``: laws of rubber, and what they share
- ``directed``, ``orthotropic``, ``transversely_isotropic``: laws with directions fixed to a link
"""

from fenicsmech.laws.evaluation import Formulas, LawForm, number
from fenicsmech.laws.gent import Gent
from fenicsmech.laws.held import undifferentiated
from fenicsmech.laws.law import Law
from fenicsmech.laws.mooney_rivlin import MooneyRivlin
from fenicsmech.laws.neo_hookean import IsochoricNeoHookean, IsochoricSimoNeoHookean, LogarithmicNeoHookean, NeoHookean
from fenicsmech.laws.ogden import Ogden
from fenicsmech.laws.orthotropic import Orthotropic
from fenicsmech.laws.remainders import cube_root_remainder, four_thirds_remainder, log_remainder
from fenicsmech.laws.rubber import Rubber
from fenicsmech.laws.split import SplitLaw, Volumetric
from fenicsmech.laws.stability import drucker_stability
from fenicsmech.laws.strain import PlanarStrain, Strain, spatial_strain
from fenicsmech.laws.transversely_isotropic import TransverselyIsotropic
from fenicsmech.laws.yeoh import Yeoh
