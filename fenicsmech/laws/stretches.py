"""Sums of powers of the principal stretches at constant volume, smooth also where stretches are equal.

Σ λ̄ₖ^α − 3 is a smooth function of F, though each λ̄ₖ is not where two are equal. One principal stretch that differs from
the other two is smooth, and so is the sum over these two. With a = α/2 and the eigenvalues of J^(−2/3) C written as
e^(2η) and e^(−η ± β),

    Σ λ̄ₖ^α − 3 = 4 u Y + v² (3 + 2 v) / u²,     u = e^(−a η) = 1 + v,     Y = sinh²(a β/2).

Y is a smooth function of X = sinh²(β/2), which is one of F:

    Y = a² X + …     (the terms t of a series, tₙ₊₁ = tₙ X (a² − n²) / (n + ½)(n + 1), at small X),
    Y = sinh²(a ln(√X + √(1 + X)))     (elsewhere).

In the plane η is of the stretch across it. In space let C / m = I + D with m = tr C / 3, and J₂ = D : D / 2,
J₃ = det D. The eigenvalue δ of D farthest from the others is

    δ = ± √(J₂/3) y,     y³ − 3 y = 2 w,     w = 3 √3 |J₃| / 2 J₂^(3/2) ≤ 1,     √3 ≤ y ≤ 2,

with the sign of J₃, and half of the difference of the others squared is J₂ (1 − y²/4). The root y is smooth up to
w = 1, where these two are equal. Where all three are nearly equal, with γ = J^(−2/3) m − 1 = (1 − J₂ + J₃)^(−1/3) − 1,

    Σ λ̄ₖ^α = (1 + γ)^a tr (I + D)^a = (1 + γ)^a (3 + T),     T = Σ (a over n) tr Dⁿ,

where  tr Dⁿ = J₂ tr Dⁿ⁻² + J₃ tr Dⁿ⁻³  from  D³ = J₂ D + J₃ I  for n > 3.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from ufl import Identity, as_ufl, conditional, det, exp, inner, ln, lt, sinh, sqrt, tr
from ufl.core.expr import Expr

from fenicsmech.laws.held import second_order
from fenicsmech.laws.remainders import log_remainder

Terms = Sequence[tuple[Expr | float, Expr | float]]

_EQUAL = 0.003
"""J₂ below which the series of T counts: the eigenvalues of D are below 0.064 there, and 14 terms leave rounding."""

_CLOSE = 0.02
"""X below which the series of Y counts; 12 terms leave rounding up to α = 20."""


class PowerSums(ABC):
    """Σ λ̄ₖ^α − 3, summed over terms of several α."""

    @abstractmethod
    def weighted(self, terms: Terms) -> Expr:
        """Σₚ cₚ (Σ λ̄ₖ^αₚ − 3) of pairs (cₚ, αₚ), without cancellation at small strain, up to second derivatives."""


@dataclass(frozen=True)
class InPlane(PowerSums):
    """Of the gradient H in the plane, and the contraction h across it.

    3 η = l = 2 ln(1 + h) − ln J₂,     X = ((H₁₁ − H₂₂)² + (H₁₂ + H₂₁)²) / 4 J₂,     J₂ = det(I + H) here.
    """

    H: Expr
    h: Expr | float

    def weighted(self, terms):
        h, j2 = as_ufl(self.h), tr(self.H) + det(self.H)
        across = 2 * (h - log_remainder(h)) - (j2 - log_remainder(j2))
        X = ((self.H[0, 0] - self.H[1, 1]) ** 2 + (self.H[0, 1] + self.H[1, 0]) ** 2) / (4 * (1 + j2))

        def total(X):
            return sum(c * _sum(alpha / 2, _less_one(-alpha / 6 * across), X) for c, alpha in terms)

        # not in the contraction, a long formula of its own in plane stress
        return second_order(total, X)


@dataclass(frozen=True)
class InSpace(PowerSums):
    """Of C − I."""

    excess: Expr

    def weighted(self, terms):
        mean = tr(self.excess) / 3
        D = (self.excess - mean * Identity(3)) / (1 + mean)

        def total(J2, J3):
            pairs = [(c, alpha / 2) for c, alpha in terms]
            equal = sum(c * _nearly_equal(a, J2, J3) for c, a in pairs)
            return conditional(lt(J2, _EQUAL), equal, sum(c * _apart(a, J2, J3) for c, a in pairs))

        return second_order(total, inner(D, D) / 2, det(D))


def _log(J2, J3) -> Expr:
    """ln(1 + γ) from  1 = det C̄ = (1 + γ)³ (1 − J₂ + J₃)."""
    return -(J3 - J2 - log_remainder(J3 - J2)) / 3


def _nearly_equal(a, J2, J3) -> Expr:
    power = _less_one(a * _log(J2, J3))
    traces, binomial = [3, 0, 2 * J2], a * (a - 1) / 2
    T = binomial * traces[2]
    for n in range(3, 15):
        traces.append(J2 * traces[n - 2] + J3 * traces[n - 3])
        binomial = binomial * (a - n + 1) / n
        T = T + binomial * traces[n]
    return power * (3 + T) + T


def _apart(a, J2, J3) -> Expr:
    # at J₃ = 0 the slope on one side: that of |J₃| in UFL is 0
    sign = conditional(lt(J3, 0), -1.0, 1.0)
    y = _root(1.5 * 3**0.5 * sign * J3 / (J2 * sqrt(J2)))
    mean = (1 - J2 + J3) ** (-1.0 / 3.0)
    alone = mean * (1 + sign * sqrt(J2 / 3) * y)
    squared = mean**2 * J2 * (1 - y**2 / 4) * alone  # sinh² β
    return _sum(a, alone ** (-a / 2) - 1, squared / (2 * (1 + sqrt(1 + squared))))


def _root(w: Expr) -> Expr:
    """y with y³ − 3 y = 2 w, by Newton's method from the cubic with its values and slopes at w = 0 and 1."""
    rise, first, last = 2 - 3**0.5, 1 / 3, 2 / 9
    y = 3**0.5 + w * (first + w * (3 * rise - 2 * first - last + w * (first + last - 2 * rise)))
    for _ in range(2):
        y = y - (y**3 - 3 * y - 2 * w) / (3 * y**2 - 3)
    return y


def _sum(a, v, X) -> Expr:
    """Σ λ̄ₖ^α − 3 from v = e^(−a η) − 1 and X."""
    term = series = a**2 * X
    for n in range(1, 12):
        term = term * X * (a**2 - n**2) / ((n + 0.5) * (n + 1))
        series = series + term
    Y = conditional(lt(X, _CLOSE), series, sinh(a * ln(sqrt(X) + sqrt(1 + X))) ** 2)
    return 4 * (1 + v) * Y + v**2 * (3 + 2 * v) / (1 + v) ** 2


def _less_one(x: Expr) -> Expr:
    """e^x − 1 without cancellation."""
    return 2 * sinh(x / 2) * exp(x / 2)
