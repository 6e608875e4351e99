"""Material laws: the strain energy W(F) per volume of the undeformed material, and nothing else.

A law is a frozen dataclass whose fields are its parameters, numbers or tuples of numbers, and whose ``energy`` is
written in them as in a textbook:

    @dataclass(frozen=True)
    class Yeoh(Law):
        C1: float
        C2: float
        bulk: float

        def energy(self, strain):
            i = strain.J ** (-2 / 3) * strain.I1 - 3
            return self.C1 * i + self.C2 * i**2 + self.bulk / 2 * strain.j**2

        E = property(lambda self: 18 * self.C1 * self.bulk / (3 * self.bulk + 2 * self.C1))
        nu = property(lambda self: (3 * self.bulk - 4 * self.C1) / (6 * self.bulk + 4 * self.C1))

Nothing else is needed: stress and stiffness follow by differentiation, plane stress by a local solve. A law may add
closed forms: ``mixed_energy``, the u–p (mixed) form for nearly incompressible materials, and ``contraction``, the
thickness in plane stress.

In forms the parameters are fields with one value per cell, so that links of one law share compiled code, and parameters
change without compiling. There ``energy`` is called on a copy of the law whose parameters are UFL expressions.

The neo-Hookean laws differ in how the resistance to shear, μ, and that to changes of volume, λ or κ, combine at large
strain:

    μ = E / 2(1 + ν),     λ = E ν / (1 + ν)(1 − 2ν),     κ = λ + 2 μ / 3.

Each is written in j = J − 1 and s = tr FᵀF − 3 − 2 j, and in the remainders φ(j) = j − ln(1 + j) and
ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3, so that no digits are lost at small strain.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import Field, dataclass, fields
from typing import Any, ClassVar

from ufl import Identity, conditional, det, inner, ln, lt, sqrt, tr
from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, finite, positive, set_fields


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


def spatial_strain(H: Expr) -> Strain:
    """In space: J − 1 = I_H + II_H + III_H,  tr FᵀF − 3 = 2 I_H + H : H."""
    second, third = (tr(H) ** 2 - tr(H * H)) / 2, det(H)
    return Strain(H, tr(H) + second + third, inner(H, H) - 2 * (second + third))


class Law(ABC):
    """A strain energy and its parameters; derive a frozen dataclass from it.

    Attributes:
        E: Young's modulus at small strain, a parameter or a property that follows from the parameters. Of an
            anisotropic law a typical value: it starts and scales solvers, and no result depends on it.
        nu: Poisson's ratio at small strain, likewise.
    """

    E: float | Expr
    nu: float | Expr
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # of the derived class

    @abstractmethod
    def energy(self, strain: Strain) -> Expr:
        """W per volume of the undeformed material; NaN or infinite where J ≤ 0."""

    def mixed_energy(self, strain: Strain, p: Expr) -> Expr:
        """Π(F, p), stationary in the pressure p where it equals W, with terms that stay bounded as ν goes to 0.5.

        Raises:
            DescriptionError: the law has no such form.
        """
        problem = "it has no u–p form (mixed_energy), which nearly incompressible links need"
        remedy = "Derive it from SplitLaw, or use formulation=DisplacementFormulation()"
        raise DescriptionError(f"law {type(self).__name__}", problem, remedy)

    def contraction(self, H: Expr) -> Expr | None:
        """F₃₃ − 1 in plane stress from the gradient H in the plane, 2 × 2; None if there is no closed form."""
        return None

    @property
    def has_mixed_energy(self) -> bool:
        """Whether the law has a u–p form."""
        return type(self).mixed_energy is not Law.mixed_energy

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law by name; those of a tuple are numbered: alpha0, alpha1, …"""
        found: dict[str, float] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            counted = [(f"{field.name}{k}", v) for k, v in enumerate(value)] if isinstance(value, tuple) else None
            found |= dict(counted or [(field.name, value)])
        return found

    def with_parameters(self, values: Mapping[str, Expr | float]) -> Law:
        """The law with other ``parameters``, which may be UFL expressions and are not checked."""
        law = copy(self)
        for field in fields(self):
            own = getattr(self, field.name)
            counted = tuple(values[f"{field.name}{k}"] for k in range(len(own))) if isinstance(own, tuple) else None
            set_fields(law, **{field.name: values[field.name] if counted is None else counted})
        return law


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


def log_remainder(j: Expr) -> Expr:
    """φ(j) = j − ln(1 + j) ≥ 0 without cancellation.

    Energies at strain ε are of order ε²: as differences of terms of order one they would lose all digits below 1e-8.
    With y = j / (2 + j):  ln(1 + j) = 2 (y + y³/3 + y⁵/5 + …)  and  j − 2 y = j y,  so

        φ = j y − 2 y³ (1/3 + y²/5 + y⁴/7 + …)     for |j| < 0.1.

    Eight terms truncate at 0.05¹⁷ ≈ 1e-22 of the leading one.
    """
    y = j / (2 + j)
    square = y * y
    tail = 0.0
    for k in reversed(range(1, 9)):
        tail = 1.0 / (2 * k + 1) + square * tail
    return conditional(lt(abs(j), 0.1), j * y - 2 * y * square * tail, j - ln(1 + j))


def cube_root_remainder(j: Expr) -> Expr:
    """ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3 ≤ 0 without cancellation.

    With c = (1 + j)^(1/3):  c − 1 = j / (c² + c + 1)  and  ψ = −(2 c + 1) (c − 1)² / 3.
    """
    c = (1 + j) ** (1.0 / 3.0)
    k = j / (c * c + c + 1)
    return -(2 * c + 1) * k * k / 3


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


@dataclass(frozen=True)
class _TwoConstants(SplitLaw):
    E: float
    nu: float

    def __post_init__(self) -> None:
        law = f"law {type(self).__name__}"
        young, poisson = positive(f"Young's modulus of {law}", self.E), finite(f"Poisson's ratio of {law}", self.nu)
        set_fields(self, E=young, nu=poisson)
        if not -1.0 < self.nu < 0.5:
            remedy = "Give a value between −1 and 0.5, both excluded"
            raise DescriptionError(law, f"Poisson's ratio is {self.nu:g}", remedy)

    @property
    def mu(self):
        """Shear modulus."""
        return self.E / (2 * (1 + self.nu))

    @property
    def lam(self):
        """Lamé's first parameter λ."""
        return self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu))

    @property
    def kappa(self):
        """Bulk modulus."""
        return self.lam + 2 * self.mu / 3


class _Compressible(_TwoConstants):
    """W̃ = μ/2 (tr FᵀF − 3 − 2 ln J) = μ/2 (s + 2 φ), and λ."""

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * (strain.shear + 2 * log_remainder(strain.j))

    @property
    def volumetric_modulus(self):
        return self.lam


class _Isochoric(_TwoConstants):
    """W̃ = μ/2 (J^(−2/3) tr FᵀF − 3) = μ/2 J^(−2/3) (s − 3 ψ), and κ."""

    def distortion(self, strain: Strain) -> Expr:
        return self.mu / 2 * strain.J ** (-2.0 / 3.0) * (strain.shear - 3 * cube_root_remainder(strain.j))

    @property
    def volumetric_modulus(self):
        return self.kappa


@dataclass(frozen=True)
class NeoHookean(_Compressible):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/4 (J² − 1 − 2 ln J) (Simo); plane stress in closed form.

    Attributes:
        E: Young's modulus at small strain, force per area.
        nu: Poisson's ratio at small strain.

    Raises:
        DescriptionError: E ≤ 0, ν outside (−1, 0.5), or not numbers.
    """

    volumetric = SIMO

    def contraction(self, H: Expr) -> Expr:
        """F₃₃ − 1 = e / (1 + √(1 + e)) from S₃₃ = 0, with j₂ = J₂ − 1:

        F₃₃² = 1 + e = (μ + λ/2) / (μ + λ/2 J₂²),     e = −(λ/2) j₂ (2 + j₂) / (μ + λ/2 J₂²).
        """
        half, j2 = self.lam / 2, tr(H) + det(H)
        e = -half * j2 * (2 + j2) / (self.mu + half * (1 + j2) ** 2)
        return e / (1 + sqrt(1 + e))


@dataclass(frozen=True)
class LogarithmicNeoHookean(_Compressible):
    """W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)²; E, ν as for ``NeoHookean``."""

    volumetric = LOGARITHMIC


@dataclass(frozen=True)
class IsochoricNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/2 (J − 1)² (CalculiX and others); E, ν as for ``NeoHookean``."""

    volumetric = QUADRATIC


@dataclass(frozen=True)
class IsochoricSimoNeoHookean(_Isochoric):
    """W = μ/2 (J^(−2/3) tr FᵀF − 3) + κ/4 (J² − 1 − 2 ln J) (deal.II and others); E, ν as for ``NeoHookean``."""

    volumetric = SIMO
