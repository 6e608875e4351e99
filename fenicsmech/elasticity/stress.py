"""Stress, by differentiation of the strain energy."""

from __future__ import annotations

from ufl import Identity, dev, diff, dot, inner, sqrt, variable
from ufl.core.expr import Expr

from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.elasticity.strain import Moduli, spatial_strain
from fenicsmech.mechanism import EnergyLaw


def cauchy_stress(model: ElasticModel, law: EnergyLaw, H: Expr, moduli: Moduli) -> Expr:
    """σ = J⁻¹ (∂W/∂F) Fᵀ, 3 × 3, with F = I + H completed by the model's assumption."""
    H = variable(model.embed(law, H, moduli))
    strain = spatial_strain(H)
    piola = diff(density(law, strain, moduli), H)
    return dot(piola, (Identity(3) + H).T) / (1 + strain.j)


def von_mises(stress: Expr) -> Expr:
    """√(3/2 dev σ : dev σ)."""
    return sqrt(1.5 * inner(dev(stress), dev(stress)))
