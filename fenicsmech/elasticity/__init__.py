"""Strain energy of flexible links in UFL, on the fixed reference mesh with the design field in place.

- ``models``: what is assumed about the third dimension (3D, whole or half; plane strain, plane stress)
- ``strain``: the invariants an energy is written in, free of cancellation
- ``remainders``: the nonlinear remainders of logarithms and roots, free of cancellation
- ``energies``: one strain energy density per material law
- ``mixed``: the same densities with the pressure as an unknown of its own
- ``formulation``: which links have such a pressure
- ``pressure``: its field
- ``transverse``: the stretch out of the plane in plane stress, per material law
- ``growth``: links whose strain-free state is not the drawn one
- ``body``: energy, residual, tangent and stress of all links
- ``mixed_stress``: the stress that a step promises, for the next tangent
"""

from fenicsmech.elasticity.body import ElasticBody
from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.formulation import LOCKING, Displacement, Formulation, Mixed
from fenicsmech.elasticity.growth import Stretch
from fenicsmech.elasticity.mixed import dilatation, mixed_density, volumetric_modulus
from fenicsmech.elasticity.mixed_stress import MixedStress
from fenicsmech.elasticity.models import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticModel
from fenicsmech.elasticity.pressure import PressureField
from fenicsmech.elasticity.quadrature import Quadrature
from fenicsmech.elasticity.remainders import cube_root_remainder, log_remainder
from fenicsmech.elasticity.strain import Moduli, Strain, spatial_strain
from fenicsmech.elasticity.stress import cauchy_stress

__all__ = [
    "Displacement",
    "ElasticBody",
    "ElasticModel",
    "Formulation",
    "LOCKING",
    "MID_PLANE_SYMMETRIC",
    "Mixed",
    "MixedStress",
    "Moduli",
    "PLANE_STRAIN",
    "PLANE_STRESS",
    "PressureField",
    "Quadrature",
    "SPATIAL",
    "Strain",
    "Stretch",
    "cauchy_stress",
    "cube_root_remainder",
    "density",
    "dilatation",
    "log_remainder",
    "mixed_density",
    "spatial_strain",
    "volumetric_modulus",
]
