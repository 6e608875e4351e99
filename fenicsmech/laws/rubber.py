"""What laws of rubber share: isotropic resistance to distortion, and a bulk modulus that follows from Poisson's ratio.

With λ̄_k = J^(−1/3) λ_k, the principal stretches at constant volume, and the shear modulus μ at small strain,

    W = W̃(λ̄₁, λ̄₂, λ̄₃) + κ/2 (J − 1)²,     κ = 2 μ (1 + ν) / 3(1 − 2 ν).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import fields

from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, finite, set_fields
from fenicsmech.laws.split import QUADRATIC, SplitLaw


class Rubber(SplitLaw):
    """Derive a frozen dataclass whose last number is Poisson's ratio ``nu``.

    Raises:
        DescriptionError: μ ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    volumetric = QUADRATIC

    def __post_init__(self) -> None:
        law = f"law {type(self).__name__}"
        for field in fields(self):
            part, value = f"{field.name} of {law}", getattr(self, field.name)
            several = isinstance(value, tuple | list)
            set_fields(self, **{field.name: tuple(finite(part, v) for v in value) if several else finite(part, value)})
        if not -1.0 < self.nu < 0.5:  # type: ignore[operator]  # a number here
            remedy = "Give a value between −1 and 0.5, both excluded"
            raise DescriptionError(law, f"Poisson's ratio is {self.nu:g}", remedy)
        if not self.shear_modulus > 0.0:  # type: ignore[operator]
            problem = f"its shear modulus at small strain is {self.shear_modulus:g}"
            raise DescriptionError(law, problem, "Give numbers that make it positive, as the docstring has it")

    @property
    @abstractmethod
    def shear_modulus(self) -> Expr | float:
        """μ at small strain."""

    @property
    def E(self):
        """Young's modulus at small strain."""
        return 2 * self.shear_modulus * (1 + self.nu)

    @property
    def volumetric_modulus(self):
        """Bulk modulus κ."""
        return self.E / (3 * (1 - 2 * self.nu))
