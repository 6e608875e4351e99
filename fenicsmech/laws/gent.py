"""The law of Gent, whose chains do not stretch beyond a limit."""

from dataclasses import dataclass

from fenicsmech.errors import positive, set_fields
from fenicsmech.laws.remainders import log_remainder
from fenicsmech.laws.rubber import Rubber


@dataclass(frozen=True)
class Gent(Rubber):
    """W = −μ/2 J_m ln(1 − (Ī₁ − 3) / J_m) + κ/2 (J − 1)²; infinite from Ī₁ − 3 = J_m on.

    κ follows from ν, see ``Yeoh``. Source: Gent (doi:10.5254/1.3538357).

    Attributes:
        mu: shear modulus at small strain, force per area.
        Jm: limit of Ī₁ − 3.
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: μ ≤ 0, J_m ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    mu: float
    Jm: float
    nu: float

    moduli = ("mu",)

    def __post_init__(self) -> None:
        super().__post_init__()
        set_fields(self, Jm=positive("Jm of law Gent", self.Jm))

    @property
    def shear_modulus(self):
        return self.mu

    def distortion(self, strain):
        # −ln(1 − x) = x + φ(−x)
        x = strain.isochoric_I1 / self.Jm
        return self.mu / 2 * self.Jm * (x + log_remainder(-x))
