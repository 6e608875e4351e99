"""The neo-Hookean laws, which differ in how resistance to shear and to changes of volume combine at large strain.

Their numbers are Young's modulus E and Poisson's ratio ν at small strain:

    μ = E / 2(1 + ν),     λ = E ν / (1 + ν)(1 − 2ν),     κ = λ + 2 μ / 3.
"""

from __future__ import annotations

from dataclasses import dataclass

from ufl import det, sqrt, tr
from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, finite, positive, set_fields
from fenicsmech.laws.remainders import log_remainder
from fenicsmech.laws.split import LOGARITHMIC, QUADRATIC, SIMO, SplitLaw
from fenicsmech.laws.strain import Strain


@dataclass(frozen=True)
class _TwoConstants(SplitLaw):
    E: float
    nu: float

    def __post_init__(self) -> None:
        law = f"law {type(self).__name__}"
        young, poisson = positive(f"Young's modulus of {law}", self.E), finite(f"Poisson's ratio of {law}", self.nu)
        set_fields(self, E=young, nu=poisson)
        if not -1.0 < self.nu < 0.5:
            remedy = "Give a value between −1 and 0.5, both excluded"
            raise DescriptionError(law, f"Poisson's ratio is {self.nu:g}", remedy)

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

    @property
    def stable(self) -> bool:  # type: ignore[override]
        """Auxetic ones soften as they are stretched: λ < 0."""
        return self.nu >= 0.0

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * (strain.shear + 2 * log_remainder(strain.j))

    @property
    def volumetric_modulus(self):
        return self.lam


class _Isochoric(_TwoConstants):
    """W̃ = μ/2 (J^(−2/3) tr FᵀF − 3), and κ."""

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * strain.isochoric_I1

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
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)²; E, ν as for ``NeoHookean``."""

    volumetric = LOGARITHMIC


@dataclass(frozen=True)
class IsochoricNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/2 (J − 1)² (CalculiX and others); E, ν as for ``NeoHookean``."""

    volumetric = QUADRATIC


@dataclass(frozen=True)
class IsochoricSimoNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/4 (J² − 1 − 2 ln J) (deal.II and others); E, ν as for ``NeoHookean``."""

    volumetric, stable = SIMO, True
