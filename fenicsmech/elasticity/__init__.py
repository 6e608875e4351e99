"""Strain energy of flexible links in UFL, on the fixed reference mesh with the design field in place.

- ``models``: assumptions about the third dimension (3D, whole or half; plane strain, plane stress)
- ``formulation``: links in the u–p (mixed) formulation, and their pressure
- ``fields``: shape, displacement, pressure, parameters of laws, growth
- ``body``: energy, residual, tangent and stress of all links
- ``mixed_stress``: the stress predicted by a Newton step, for the next tangent
"""

from fenicsmech.elasticity.body import ElasticBody, Quadrature
from fenicsmech.elasticity.fields import Stretch
from fenicsmech.elasticity.formulation import (
    LOCKING,
    DisplacementFormulation,
    Formulation,
    MixedFormulation,
    PressureField,
)
from fenicsmech.elasticity.mixed_stress import MixedStress
from fenicsmech.elasticity.models import (
    MID_PLANE_SYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPATIAL,
    ElasticModel,
    cauchy_stress,
)

__all__ = [
    "DisplacementFormulation",
    "ElasticBody",
    "ElasticModel",
    "Formulation",
    "LOCKING",
    "MID_PLANE_SYMMETRIC",
    "MixedFormulation",
    "MixedStress",
    "PLANE_STRAIN",
    "PLANE_STRESS",
    "PressureField",
    "Quadrature",
    "SPATIAL",
    "Stretch",
    "cauchy_stress",
]
