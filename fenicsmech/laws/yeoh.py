"""The law of Yeoh."""

from dataclasses import dataclass

from fenicsmech.laws.rubber import Rubber


@dataclass(frozen=True)
class Yeoh(Rubber):
    """W = C₁ i + C₂ i² + C₃ i³ + κ/2 (J − 1)²,     i = Ī₁ − 3 = Σ λ̄ₖ² − 3,     κ = 2 μ (1 + ν) / 3(1 − 2 ν).

    Source: Yeoh (doi:10.5254/1.3538343).

    Attributes:
        C1, C2, C3: force per area; μ = 2 C₁.
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: C₁ ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    C1: float
    C2: float
    C3: float
    nu: float

    moduli = ("C1", "C2", "C3")

    @property
    def shear_modulus(self):
        return 2 * self.C1

    def distortion(self, strain):
        i = strain.isochoric_I1
        return i * (self.C1 + i * (self.C2 + i * self.C3))
