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
from fenicsmech.elasticity.formulation import Displacement, Formulation, Mixed
from fenicsmech.elasticity.growth import Stretch
from fenicsmech.elasticity.mixed_stress import MixedStress
from fenicsmech.elasticity.models import MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticModel
from fenicsmech.elasticity.quadrature import Quadrature
from fenicsmech.elasticity.strain import Moduli, Strain

__all__ = [
    "MID_PLANE_SYMMETRIC",
    "PLANE_STRAIN",
    "PLANE_STRESS",
    "SPATIAL",
    "Displacement",
    "ElasticBody",
    "ElasticModel",
    "Formulation",
    "Mixed",
    "MixedStress",
    "Moduli",
    "Quadrature",
    "Strain",
    "Stretch",
    "density",
]
