"""Measures of deformation that laws are written in, among them j = J − 1 and s = tr FᵀF − 3 − 2 j."""

from __future__ import annotations

from dataclasses import dataclass

from ufl import Identity, det, inner, tr
from ufl.core.expr import Expr

from fenicsmech.laws.remainders import cube_root_remainder, four_thirds_remainder
from fenicsmech.laws.stretches import InPlane, InSpace, PowerSums


@dataclass(frozen=True)
class Strain:
    """Measures of the deformation gradient F = I + H, computed from H, so that small strain loses no digits.

    Attributes:
        H: displacement gradient, 3 × 3.
        j: J − 1.
        shear: tr FᵀF − 3 − 2 (J − 1), of second order in H.
    """

    H: Expr
    j: Expr
    shear: Expr

    @property
    def F(self) -> Expr:
        """Deformation gradient."""
        return Identity(3) + self.H

    @property
    def C(self) -> Expr:
        """Right Cauchy–Green tensor FᵀF."""
        return self.F.T * self.F

    @property
    def excess(self) -> Expr:
        """C − I = H + Hᵀ + HᵀH, twice the Green strain."""
        return self.H + self.H.T + self.H.T * self.H

    @property
    def J(self) -> Expr:
        """Volume per undeformed volume, det F."""
        return 1 + self.j

    @property
    def I1(self) -> Expr:
        """First invariant of C, tr C."""
        return 3 + 2 * self.j + self.shear

    @property
    def I2(self) -> Expr:
        """Second invariant of C, ((tr C)² − tr C²) / 2."""
        return (self.I1**2 - inner(self.C, self.C)) / 2

    @property
    def isochoric_I1(self) -> Expr:
        """Ī₁ − 3 = J^(−2/3) tr C − 3 = J^(−2/3) (s − 3 ψ)."""
        return self.J ** (-2.0 / 3.0) * (self.shear - 3 * cube_root_remainder(self.j))

    @property
    def isochoric_I2(self) -> Expr:
        """Ī₂ − 3 = J^(−4/3) I₂ − 3 = J^(−4/3) (2 s + II − 3 χ) with II = ((tr D)² − D : D) / 2 of D = C − I."""
        D = self.excess
        second = ((2 * self.j + self.shear) ** 2 - inner(D, D)) / 2
        return self.J ** (-4.0 / 3.0) * (2 * self.shear + second - 3 * four_thirds_remainder(self.j))

    @property
    def powers(self) -> PowerSums:
        """Sums of powers of the principal stretches at constant volume."""
        return InSpace(self.excess)


@dataclass(frozen=True)
class PlanarStrain(Strain):
    """Strain with one principal direction across the plane.

    Attributes:
        in_plane: displacement gradient in the plane, 2 × 2.
        across: contraction F₃₃ − 1.
    """

    in_plane: Expr
    across: Expr | float

    @property
    def powers(self) -> PowerSums:
        return InPlane(self.in_plane, self.across)


def spatial_strain(H: Expr) -> Strain:
    """In space: J − 1 = I_H + II_H + III_H,  tr FᵀF − 3 = 2 I_H + H : H."""
    second, third = (tr(H) ** 2 - tr(H * H)) / 2, det(H)
    return Strain(H, tr(H) + second + third, inner(H, H) - 2 * (second + third))
