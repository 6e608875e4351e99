"""Neo-Hookean laws of Young's modulus E and Poisson's ratio ν.

They differ in how the resistance to shear, μ, and that to changes of volume, λ or κ, go together at large strain:

    μ = E / 2(1 + ν),     λ = E ν / (1 + ν)(1 − 2ν),     κ = λ + 2 μ / 3.

Each is written in j = J − 1 and s = tr FᵀF − 3 − 2 j, and in the remainders φ(j) = j − ln(1 + j) and
ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3, so that no digits are lost at small strain.
"""

from __future__ import annotations

from dataclasses import dataclass

from ufl import det, sqrt, tr
from ufl.core.expr import Expr

from fenicsmech.checks import finite, positive
from fenicsmech.errors import DescriptionError
from fenicsmech.laws.law import SplitLaw, Strain, Volumetric, cube_root_remainder, log_remainder


def elastic_constants(part: str, E: float | None, nu: float | None) -> tuple[float, float]:
    """E and ν as floats.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), or not numbers; ``part`` names the material.
    """
    young, poisson = positive(f"Young's modulus of {part}", E), finite(f"Poisson's ratio of {part}", nu)
    if not -1.0 < poisson < 0.5:
        raise DescriptionError(
            part, f"Poisson's ratio is {poisson:g}", "Give a value between −1 and 0.5, both excluded"
        )
    return young, poisson


def _simo_complement(q: Expr) -> Expr:
    """U* = q j − U where U′ = (J − 1/J)/2 = q, at J = q + √(1 + q²)."""
    j = q + q**2 / (1 + sqrt(1 + q**2))
    return q * j - SIMO.energy(j)


QUADRATIC = Volumetric(lambda j: j, lambda j: j**2 / 2, lambda q: q**2 / 2)
"""U = θ²/2, θ = J − 1."""

LOGARITHMIC = Volumetric(lambda j: j - log_remainder(j), lambda j: (j - log_remainder(j)) ** 2 / 2, lambda q: q**2 / 2)
"""U = θ²/2, θ = ln J = j − φ."""

SIMO = Volumetric(lambda j: j, lambda j: (j**2 + 2 * log_remainder(j)) / 4, _simo_complement)
"""U = (J² − 1 − 2 ln J)/4 = (j² + 2 φ)/4, θ = J − 1."""


@dataclass(frozen=True)
class _TwoConstants(SplitLaw):
    """A law of E and ν."""

    E: float
    nu: float

    def __post_init__(self) -> None:
        E, nu = elastic_constants(f"law {type(self).__name__}", self.E, self.nu)
        object.__setattr__(self, "E", E)
        object.__setattr__(self, "nu", nu)

    @property
    def mu(self):
        """Shear modulus."""
        return self.E / (2 * (1 + self.nu))

    @property
    def lam(self):
        """Lamé's first parameter λ."""
        return self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))

    @property
    def kappa(self):
        """Bulk modulus."""
        return self.lam + 2 * self.mu / 3


class _Compressible(_TwoConstants):
    """W̃ = μ/2 (tr FᵀF − 3 − 2 ln J) = μ/2 (s + 2 φ), and λ."""

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * (strain.shear + 2 * log_remainder(strain.j))

    @property
    def volumetric_modulus(self):
        return self.lam


class _Isochoric(_TwoConstants):
    """W̃ = μ/2 (J^(−2/3) tr FᵀF − 3) = μ/2 J^(−2/3) (s − 3 ψ), and κ."""

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * strain.J ** (-2.0 / 3.0) * (strain.shear - 3 * cube_root_remainder(strain.j))

    @property
    def volumetric_modulus(self):
        return self.kappa


@dataclass(frozen=True)
class NeoHookean(_Compressible):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/4 (J² − 1 − 2 ln J) (Simo); plane stress in closed form.

    Attributes:
        E: Young's modulus at small strain, force per area.
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    volumetric = SIMO

    def contraction(self, H: Expr) -> Expr:
        """F₃₃ − 1 = e / (1 + √(1 + e)) from S₃₃ = 0, with j₂ = J₂ − 1:

        F₃₃² = 1 + e = (μ + λ/2) / (μ + λ/2 J₂²),     e = −(λ/2) j₂ (2 + j₂) / (μ + λ/2 J₂²).
        """
        half, j2 = self.lam / 2, tr(H) + det(H)
        e = -half * j2 * (2 + j2) / (self.mu + half * (1 + j2) ** 2)
        return e / (1 + sqrt(1 + e))


@dataclass(frozen=True)
class LogarithmicNeoHookean(_Compressible):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)²; E, ν as of ``NeoHookean``."""

    volumetric = LOGARITHMIC


@dataclass(frozen=True)
class IsochoricNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/2 (J − 1)² (CalculiX and others); E, ν as of ``NeoHookean``."""

    volumetric = QUADRATIC


@dataclass(frozen=True)
class IsochoricSimoNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/4 (J² − 1 − 2 ln J) (deal.II and others); E, ν as of ``NeoHookean``."""

    volumetric = SIMO
