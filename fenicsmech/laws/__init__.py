"""Material laws: strain energy densities in UFL, and the strain measures they are written in.

- ``law``: strain measures, the interface of laws, and laws with a separate volumetric energy
- ``neo_hookean``: four laws of two constants, E and ν
"""

from fenicsmech.laws.law import Law, SplitLaw, Strain, Volumetric, cube_root_remainder, log_remainder, spatial_strain
from fenicsmech.laws.neo_hookean import (
    LOGARITHMIC,
    QUADRATIC,
    SIMO,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    NeoHookean,
    elastic_constants,
)

__all__ = [
    "IsochoricNeoHookean",
    "IsochoricSimoNeoHookean",
    "LOGARITHMIC",
    "Law",
    "LogarithmicNeoHookean",
    "NeoHookean",
    "QUADRATIC",
    "SIMO",
    "SplitLaw",
    "Strain",
    "Volumetric",
    "cube_root_remainder",
    "elastic_constants",
    "log_remainder",
    "spatial_strain",
]
