"""Materials: elastic constants and strain-energy laws; ``elasticity`` evaluates the energies."""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.checks import finite, positive
from fenicsmech.errors import DescriptionError


class EnergyLaw:
    """A strain energy density W(F), in terms of E and ν of the material."""


@dataclass(frozen=True)
class NeoHookean(EnergyLaw):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/4 (J² − 1 − 2 ln J) (Simo); has a closed plane-stress form."""


@dataclass(frozen=True)
class LogarithmicNeoHookean(EnergyLaw):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)²."""


@dataclass(frozen=True)
class IsochoricNeoHookean(EnergyLaw):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/2 (J − 1)² (CalculiX and others)."""


@dataclass(frozen=True)
class IsochoricSimoNeoHookean(EnergyLaw):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/4 (J² − 1 − 2 ln J) (deal.II and others)."""


@dataclass(frozen=True)
class Material:
    """An isotropic hyperelastic material.

    Attributes:
        name: for messages.
        youngs_modulus: E at small strain, force per area.
        poissons_ratio: ν at small strain.
        law: the strain energy.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    name: str
    youngs_modulus: float
    poissons_ratio: float
    law: EnergyLaw = NeoHookean()

    def __post_init__(self) -> None:
        part = f"material {self.name!r}"
        young = positive(f"Young's modulus of {part}", self.youngs_modulus)
        if not isinstance(self.law, EnergyLaw):
            raise DescriptionError(part, f"its law is {self.law!r}", "Give a law, as NeoHookean()")
        nu = finite(f"Poisson's ratio of {part}", self.poissons_ratio)
        if not -1.0 < nu < 0.5:
            raise DescriptionError(part, f"Poisson's ratio is {nu:g}", "Give a value between −1 and 0.5, both excluded")
        object.__setattr__(self, "youngs_modulus", young)
        object.__setattr__(self, "poissons_ratio", nu)


ONYX = Material("Onyx", 1770.0, 0.42)
"""Carbon-filled nylon, MPa; modulus fitted by the authors of the method (section VII-B)."""

SMOOTH_SIL_950 = Material("Smooth-Sil 950", 1.90, 0.475)
"""Platinum-cure silicone, MPa; constants used by the authors of the method (section VII-B)."""
