"""What laws with directions share: Green strain along axes fixed to the undeformed link, and engineering constants.

The compliance 𝕊 at small strain follows from the constants, as in ε₁₁ = σ₁₁/E₁ − ν₁₂/E₁ σ₂₂ − …. With the stiffness
ℂ = 𝕊⁻¹, the bulk modulus K = 1 / (1 : 𝕊 : 1) of a body under pressure, Green strain E = (FᵀF − I) / 2 and the energy U
of changes of volume,

    W = ½ E : (ℂ − K 1 ⊗ 1) : E + K U(J),     U = (J² − 1 − 2 ln J) / 4.

The first part is that of St. Venant and Kirchhoff. It is never negative, and stays bounded where the material is nearly
incompressible, so there is a u–p form. Strains along the axes are moderate: under compression to less than about 0.7 of
its length such material gives way.

In plane stress, with one axis across the plane, W is quadratic in r = F₃₃² − 1 but for U, and S₃₃ = 0 reads

    (1 + r) (c r + K + g) = K,     c = (ℂ − K 1 ⊗ 1)₃₃₃₃,     g = 2 b + K (J₂² − 1),

where b is the stress across the plane, by ℂ − K 1 ⊗ 1, of the Green strain in it. As c ≥ 0, one root has r > −1:

    r = −2 g / (B + √(B² − 4 c g)),     B = c + K + g,     B² − 4 c g = (g + K − c)² + 4 K c.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from ufl import as_matrix, det, sqrt, tr
from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, direction, finite, positive, set_fields
from fenicsmech.laws.split import SIMO, SplitLaw

Vector = tuple[float, ...]


class Directed(SplitLaw):
    """Derive a frozen dataclass of constants and directions."""

    volumetric = SIMO

    @property
    @abstractmethod
    def compliance(self) -> tuple[tuple[Expr | float, ...], ...]:
        """𝕊 of normal stresses along the axes, 3 × 3."""

    @property
    @abstractmethod
    def shear_moduli(self) -> tuple[Expr | float, ...]:
        """G₁₂, G₁₃, G₂₃."""

    @property
    def volumetric_modulus(self):
        """K."""
        return 1 / sum(sum(row) for row in self.compliance)

    @property
    def E(self):
        """A typical Young's modulus, 9 K μ / (3 K + μ) with the mean μ of the shear moduli."""
        K, mu = self.volumetric_modulus, sum(self.shear_moduli) / 3
        return 9 * K * mu / (3 * K + mu)

    @property
    def nu(self):
        """A typical Poisson's ratio, (3 K − 2 μ) / (6 K + 2 μ)."""
        K, mu = self.volumetric_modulus, sum(self.shear_moduli) / 3
        return (3 * K - 2 * mu) / (6 * K + 2 * mu)

    def bounded_stiffness(self):
        """ℂ − K 1 ⊗ 1 of normal strains along the axes, by cofactors, 3 × 3."""
        S, K = self.compliance, self.volumetric_modulus

        def cofactor(i: int, j: int):
            (a, b), (c, d) = [(m + 1) % 3 for m in (i, i + 1)], [(m + 1) % 3 for m in (j, j + 1)]
            return S[a][c] * S[b][d] - S[a][d] * S[b][c]

        determinant = sum(S[0][j] * cofactor(0, j) for j in range(3))
        return [[cofactor(i, j) / determinant - K for j in range(3)] for i in range(3)]

    @abstractmethod
    def across_plane(self, green: Expr) -> tuple[Expr, Expr]:
        """c and b, from the Green strain in the plane, 3 × 3."""

    def contraction(self, H):
        excess, j2, K = H + H.T + H.T * H, tr(H) + det(H), self.volumetric_modulus
        c, b = self.across_plane(
            as_matrix([[excess[0, 0], excess[0, 1], 0], [excess[1, 0], excess[1, 1], 0], [0] * 3]) / 2
        )
        g = 2 * b + K * j2 * (2 + j2)
        r = -2 * g / (c + K + g + sqrt((g + K - c) ** 2 + 4 * K * c))
        return r / (1 + sqrt(1 + r))

    def check_constants(self, ratios: Sequence[tuple[str, str, str]]) -> None:
        """Sets constants to checked numbers, moduli to positive ones, for ``__post_init__``.

        Args:
            ratios: of each Poisson's ratio, its name and those of E₁ and E₂, with |ν₁₂| < √(E₁ / E₂).

        Raises:
            DescriptionError: a number is not as it should be, or 𝕊 is not positive definite.
        """
        law = f"law {type(self).__name__}"
        for name in self.moduli:
            set_fields(self, **{name: positive(f"{name} of {law}", getattr(self, name))})
        for name, *pair in ratios:
            value, (first, second) = finite(f"{name} of {law}", getattr(self, name)), pair
            limit = (getattr(self, first) / getattr(self, second)) ** 0.5
            set_fields(self, **{name: value})
            if not abs(value) < limit:
                problem = f"{name} is {value:g}, and some strain would release energy"
                root = "" if first == second else f", √({first}/{second})"
                remedy = f"Give a value between ±{limit:.4g}{root}"
                raise DescriptionError(law, problem, remedy)
        S = self.compliance
        scale = S[0][0] * S[1][1] * S[2][2]
        determinant = sum(
            S[0][j] * (S[1][(j + 1) % 3] * S[2][(j + 2) % 3] - S[1][(j + 2) % 3] * S[2][(j + 1) % 3]) for j in range(3)
        )
        if not determinant > 1e-12 * scale:
            given = ", ".join(f"{name} = {getattr(self, name):g}" for name, *_ in ratios)
            problem = f"with {given} some strain would release energy (det 𝕊 E₁E₂E₃ = {determinant / scale:.3g})"
            raise DescriptionError(law, problem, "Give smaller Poisson's ratios")


def unit(law: str, name: str, values: Sequence[float]) -> Vector:
    """A direction of a ``law`` as a unit vector in space; a missing z is 0."""
    return (*direction(f"{name} of {law}", values), 0.0)[:3]
