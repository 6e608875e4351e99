"""Strain energy of flexible links in UFL, on the fixed reference mesh with the design field in place.

- ``models``: assumptions about the third dimension (3D, whole or half; plane strain, plane stress) and about links
  of nearly incompressible material (displacement or u–p formulation)
- ``fields``: shape, displacement, pressure, parameters of laws, growth
- ``specimens``: nominal stresses of specimens of material tests
- ``body``: energy, residual, stiffness and stress of all links, and the stress predicted by a Newton step
"""

from fenicsmech.elasticity.body import ElasticBody, PredictedStress
from fenicsmech.elasticity.fields import PressureField, Stretch
from fenicsmech.elasticity.models import (
    LOCKING,
    MID_PLANE_SYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPATIAL,
    DisplacementFormulation,
    ElasticModel,
    Formulation,
    MixedFormulation,
    Quadrature,
    cauchy_stress,
)
from fenicsmech.elasticity.specimens import SPECIMENS, Specimen, check_kind, specimen_stress
