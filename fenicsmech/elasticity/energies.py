"""Strain energy densities W, one function per material law.

Each is written in J − 1 =: j and s = tr FᵀF − 3 − 2 j, and in the remainders φ(j) = j − ln(1 + j) and
ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3, so that no digits are lost at small strain. Stress and tangent follow
by differentiation.
"""

from __future__ import annotations

from functools import singledispatch

from ufl.core.expr import Expr

from fenicsmech.elasticity.remainders import cube_root_remainder, log_remainder
from fenicsmech.elasticity.strain import Moduli, Strain
from fenicsmech.mechanism import (
    EnergyLaw,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    NeoHookean,
)


@singledispatch
def density(law: EnergyLaw, strain: Strain, moduli: Moduli) -> Expr:
    """W per volume of the undeformed material. Register a function for a new law to add it."""
    raise NotImplementedError(f"no strain energy is registered for {law!r}")


@density.register
def _(law: NeoHookean, strain: Strain, moduli: Moduli) -> Expr:
    """W = μ/2 (s + 2 φ) + λ/4 (j² + 2 φ)."""
    phi = log_remainder(strain.j)
    return moduli.mu / 2 * (strain.shear + 2 * phi) + moduli.lam / 4 * (strain.j**2 + 2 * phi)


@density.register
def _(law: LogarithmicNeoHookean, strain: Strain, moduli: Moduli) -> Expr:
    """W = μ/2 (s + 2 φ) + λ/2 (j − φ)²."""
    phi = log_remainder(strain.j)
    return moduli.mu / 2 * (strain.shear + 2 * phi) + moduli.lam / 2 * (strain.j - phi) ** 2


def _isochoric(strain: Strain, moduli: Moduli) -> Expr:
    """μ/2 (J^(−2/3) tr FᵀF − 3) = μ/2 J^(−2/3) (s − 3 ψ)."""
    shear = strain.shear - 3 * cube_root_remainder(strain.j)
    return moduli.mu / 2 * (1 + strain.j) ** (-2.0 / 3.0) * shear


@density.register
def _(law: IsochoricNeoHookean, strain: Strain, moduli: Moduli) -> Expr:
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/2 j²."""
    return _isochoric(strain, moduli) + moduli.kappa / 2 * strain.j**2


@density.register
def _(law: IsochoricSimoNeoHookean, strain: Strain, moduli: Moduli) -> Expr:
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/4 (j² + 2 φ)."""
    return _isochoric(strain, moduli) + moduli.kappa / 4 * (strain.j**2 + 2 * log_remainder(strain.j))
