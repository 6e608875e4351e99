"""Laws with a separate volumetric energy, which have a u–p (mixed) form."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from ufl import sqrt
from ufl.core.expr import Expr

from fenicsmech.laws.law import Law
from fenicsmech.laws.remainders import log_remainder
from fenicsmech.laws.strain import Strain


@dataclass(frozen=True)
class Volumetric:
    """A convex volumetric energy U(θ) per modulus, and its Legendre transform.

    Attributes:
        dilatation: θ from j = J − 1; zero with slope one at j = 0.
        energy: U from j.
        complement: U*(q) = sup_θ q θ − U(θ).
    """

    dilatation: Callable[[Expr], Expr]
    energy: Callable[[Expr], Expr]
    complement: Callable[[Expr], Expr]


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


class SplitLaw(Law):
    """A law W = W̃(F) + M U(θ(J)) with a separate volumetric energy and a u–p form.

    With the Legendre transform U*(q) = sup_θ q θ − U(θ), the perturbed Lagrangian

        Π(F, p) = W̃(F) − p θ(J) − M U*(−p / M)

    is stationary in p at p = −M U′(θ), where it equals W: the exact solution is the same, but no number in it grows as
    ν goes to 0.5, and θ = 0 remains. p is positive in compression, and the hydrostatic pressure at small strain.
    Sources: Sussman & Bathe (doi:10.1016/0045-7949(87)90265-3), Brink & Stein (doi:10.1007/BF02824849).

    Attributes:
        volumetric: θ, U and U*.
    """

    volumetric: Volumetric

    @abstractmethod
    def distortion(self, strain: Strain) -> Expr:
        """W̃."""

    @property
    @abstractmethod
    def volumetric_modulus(self) -> Expr | float:
        """M."""

    def energy(self, strain):
        return self.distortion(strain) + self.volumetric_modulus * self.volumetric.energy(strain.j)

    def mixed_energy(self, strain, p):
        M, theta = self.volumetric_modulus, self.volumetric.dilatation(strain.j)
        return self.distortion(strain) - p * theta - M * self.volumetric.complement(-p / M)
