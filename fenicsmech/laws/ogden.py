"""The law of Ogden, in principal stretches."""

from dataclasses import dataclass

from fenicsmech.errors import DescriptionError
from fenicsmech.laws.rubber import Rubber


@dataclass(frozen=True)
class Ogden(Rubber):
    """W = Σₚ μₚ/αₚ (λ̄₁^αₚ + λ̄₂^αₚ + λ̄₃^αₚ − 3) + κ/2 (J − 1)², of any number of terms. κ follows from ν, see ``Yeoh``.

    Some programs have 2 μₚ/αₚ² in place of μₚ/αₚ. Source: Ogden (doi:10.1098/rspa.1972.0026).

    Attributes:
        mu: μₚ, force per area, of any sign; μ = Σ μₚ αₚ / 2.
        alpha: αₚ, of any sign but not zero.
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: Σ μₚ αₚ ≤ 0, there are not as many μₚ as αₚ, an αₚ is zero, ν outside (−1, 0.5), or not
            numbers.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    nu: float

    moduli = ("mu",)

    def __post_init__(self) -> None:
        sizes = [len(each) if isinstance(each, tuple | list) else -1 for each in (self.mu, self.alpha)]
        if sizes[0] != sizes[1] or sizes[0] < 1:
            given = f"mu is {self.mu!r} and alpha is {self.alpha!r}"
            raise DescriptionError("law Ogden", given, "Give two tuples of one length, mu=(…), alpha=(…)")
        super().__post_init__()
        if not all(self.alpha):
            raise DescriptionError("law Ogden", f"alpha is {self.alpha!r}", "Give exponents that are not zero")

    @property
    def shear_modulus(self):
        return sum(mu * alpha for mu, alpha in self.terms) / 2

    @property
    def terms(self):
        """(μₚ, αₚ) of each term."""
        return tuple(zip(self.mu, self.alpha, strict=True))

    def distortion(self, strain):
        return strain.powers.weighted([(mu / alpha, alpha) for mu, alpha in self.terms])
