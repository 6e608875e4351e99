"""What strain energies are written in: elastic moduli and invariants of F = I + H."""

from __future__ import annotations

from dataclasses import dataclass

from ufl import det, inner, tr
from ufl.core.expr import Expr


@dataclass(frozen=True)
class Moduli:
    """Elastic moduli from E and ν (UFL expressions or numbers).

    μ = E / 2(1 + ν),  λ = E ν / (1 + ν)(1 − 2ν),  κ = λ + 2 μ / 3.
    """

    youngs_modulus: Expr | float
    poissons_ratio: Expr | float

    @property
    def mu(self):
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))

    @property
    def lam(self):
        nu = self.poissons_ratio
        return self.youngs_modulus * nu / ((1 + nu) * (1 - 2 * nu))

    @property
    def kappa(self):
        return self.lam + 2 * self.mu / 3


@dataclass(frozen=True)
class Strain:
    """Invariants of F = I + H, computed from H.

    Attributes:
        j: J − 1.
        shear: tr FᵀF − 3 − 2 (J − 1), of second order in H.
    """

    j: Expr
    shear: Expr


def spatial_strain(H: Expr) -> Strain:
    """In space: J − 1 = I_H + II_H + III_H,  tr FᵀF − 3 = 2 I_H + H : H."""
    second, third = (tr(H) ** 2 - tr(H * H)) / 2, det(H)
    return Strain(tr(H) + second + third, inner(H, H) - 2 * (second + third))


def plane_strain(H: Expr) -> Strain:
    """In the plane with F₃₃ = 1: J − 1 = tr H + det H,  tr FᵀF − 3 = 2 tr H + H : H."""
    return Strain(tr(H) + det(H), inner(H, H) - 2 * det(H))


def plane_strain_stretched(H: Expr, e: Expr) -> Strain:
    """In the plane with F₃₃² = 1 + e.

    With j₂ = tr H + det H = J₂ − 1 and h = F₃₃ − 1 = e / (1 + √(1 + e)):

        J − 1 = j₂ + J₂ h,      negative J₂ makes J negative,
        tr FᵀF − 3 − 2 (J − 1) = H : H − 2 det H − 2 j₂ h + h².
    """
    in_plane = tr(H) + det(H)
    h = e / (1 + (1 + e) ** 0.5)
    return Strain(in_plane + (1 + in_plane) * h, inner(H, H) - 2 * det(H) - 2 * in_plane * h + h**2)
