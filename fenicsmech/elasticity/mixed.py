"""Strain energy densities with the pressure p as an unknown of its own, for nearly incompressible materials.

Every law is W = W̃(F) + M U(θ), with W̃ its density without volumetric modulus, M that modulus (λ or κ), θ(J) a measure
of dilatation and U convex. With the complement U*(q) = sup_θ q θ − U(θ), the perturbed Lagrangian

    Π(F, p) = W̃(F) − p θ(J) − M U*(−p / M)

is stationary in p at p = −M U′(θ), where it equals W: the exact solution is the same, but no number in it grows as ν
goes to 0.5, and θ = 0 remains. p is positive in compression, and the hydrostatic pressure at small strain.

With p one degree lower than u and continuous (Taylor–Hood), volumes are as free to stay constant as the material
demands. Sources: Sussman & Bathe (doi:10.1016/0045-7949(87)90265-3), Brink & Stein (doi:10.1007/BF02824849) for the
functional at finite strain; Boffi, Brezzi & Fortin (doi:10.1007/978-3-642-36519-5) for the elements.
"""

from __future__ import annotations

from functools import singledispatch

from ufl import sqrt
from ufl.core.expr import Expr

from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.remainders import log_remainder
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
    """θ from ``j`` = J − 1: j, unless a law says otherwise."""
    return j


@singledispatch
def complement(law: EnergyLaw, q: Expr) -> Expr:
    """U*. Register a function for a new law to let it have a pressure of its own."""
    raise NotImplementedError(f"no mixed form is registered for {law!r}")


@singledispatch
def volumetric_modulus(law: EnergyLaw, moduli: Moduli) -> Expr:
    """M: κ, unless a law has λ."""
    return moduli.kappa


def mixed_density(law: EnergyLaw, strain: Strain, moduli: Moduli, p: Expr) -> Expr:
    """Π per volume of the undeformed material."""
    shear = density(law, strain, ShearOnly(moduli.youngs_modulus, moduli.poissons_ratio))
    modulus = volumetric_modulus(law, moduli)
    return shear - p * dilatation(law, strain.j) - modulus * complement(law, -p / modulus)


@volumetric_modulus.register(NeoHookean)
@volumetric_modulus.register(LogarithmicNeoHookean)
def _(law: EnergyLaw, moduli: Moduli) -> Expr:
    return moduli.lam


@dilatation.register
def _(law: LogarithmicNeoHookean, j: Expr) -> Expr:
    """θ = ln J = j − φ."""
    return j - log_remainder(j)


@complement.register(LogarithmicNeoHookean)
@complement.register(IsochoricNeoHookean)
def _(law: EnergyLaw, q: Expr) -> Expr:
    """U = θ²/2, U* = q²/2."""
    return q**2 / 2


@complement.register(NeoHookean)
@complement.register(IsochoricSimoNeoHookean)
def _(law: EnergyLaw, q: Expr) -> Expr:
    """U = (j² + 2 φ)/4, U′ = (J − 1/J)/2 = q at J = q + √(1 + q²), U* = q j − U."""
    j = q + q**2 / (1 + sqrt(1 + q**2))
    return q * j - (j**2 + 2 * log_remainder(j)) / 4
