"""Strain energy densities with the pressure p as an unknown of its own, for nearly incompressible materials.

Every law is W = W̃(F) + M g(J)²/2 with W̃ its density without volumetric modulus, M that modulus (λ or κ) and
g(1) = 0, g′(1) = 1. The perturbed Lagrangian

    Π(F, p) = W̃(F) − p g(J) − p² / (2 M)

is stationary in p at p = −M g(J), where it equals W: the exact solution is the same, but no number in it grows as ν
goes to 0.5, and g = 0 remains. p is positive in compression, and the hydrostatic pressure at small strain.

With p one degree lower than u and continuous (Taylor–Hood), volumes are as free to stay constant as the material
demands. Sources: Sussman & Bathe (doi:10.1016/0045-7949(87)90265-3), Brink & Stein (doi:10.1007/BF02824849) for the
functional at finite strain; Boffi, Brezzi & Fortin (doi:10.1007/978-3-642-36519-5) for the elements.
"""

from __future__ import annotations

from functools import singledispatch

from ufl import sqrt
from ufl.core.expr import Expr

from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.remainders import log_curvature
from fenicsmech.elasticity.strain import Moduli, Strain
from fenicsmech.mechanism import (
    EnergyLaw,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    NeoHookean,
)


class ShearOnly(Moduli):
    """The shear modulus alone: λ = κ = 0."""

    lam = 0.0
    kappa = 0.0


@singledispatch
def dilatation(law: EnergyLaw, j: Expr) -> Expr:
    """g from ``j`` = J − 1. Register a function for a new law to let it have a pressure of its own."""
    raise NotImplementedError(f"no mixed form is registered for {law!r}")


@singledispatch
def volumetric_modulus(law: EnergyLaw, moduli: Moduli) -> Expr:
    """M: κ, unless a law has λ."""
    return moduli.kappa


def mixed_density(law: EnergyLaw, strain: Strain, moduli: Moduli, p: Expr) -> Expr:
    """Π per volume of the undeformed material."""
    shear = density(law, strain, ShearOnly(moduli.youngs_modulus, moduli.poissons_ratio))
    return shear - p * dilatation(law, strain.j) - p**2 / (2 * volumetric_modulus(law, moduli))


@volumetric_modulus.register(NeoHookean)
@volumetric_modulus.register(LogarithmicNeoHookean)
def _(law: EnergyLaw, moduli: Moduli) -> Expr:
    return moduli.lam


@dilatation.register
def _(law: LogarithmicNeoHookean, j: Expr) -> Expr:
    """g = ln J = j − φ = j (1 − j φ/j²)."""
    return j * (1 - j * log_curvature(j))


@dilatation.register
def _(law: IsochoricNeoHookean, j: Expr) -> Expr:
    """g = j."""
    return j


@dilatation.register(NeoHookean)
@dilatation.register(IsochoricSimoNeoHookean)
def _(law: EnergyLaw, j: Expr) -> Expr:
    """g²/2 = (j² + 2 φ)/4, with the sign of j."""
    return j * sqrt((1 + 2 * log_curvature(j)) / 2)
