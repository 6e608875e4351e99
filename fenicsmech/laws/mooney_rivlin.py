"""The law of Mooney and Rivlin."""

from dataclasses import dataclass

from fenicsmech.laws.rubber import Rubber


@dataclass(frozen=True)
class MooneyRivlin(Rubber):
    """W = C₁₀ (Ī₁ − 3) + C₀₁ (Ī₂ − 3) + κ/2 (J − 1)², with Ī₁ = Σ λ̄ₖ², Ī₂ = Σ λ̄ₖ⁻².

    κ follows from ν, see ``Yeoh``. Source: Rivlin (doi:10.1098/rsta.1948.0024).

    Attributes:
        C10, C01: force per area; μ = 2 (C₁₀ + C₀₁).
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: C₁₀ + C₀₁ ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    C10: float
    C01: float
    nu: float

    moduli = ("C10", "C01")

    @property
    def shear_modulus(self):
        return 2 * (self.C10 + self.C01)

    def distortion(self, strain):
        return self.C10 * strain.isochoric_I1 + self.C01 * strain.isochoric_I2
