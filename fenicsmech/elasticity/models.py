"""The assumptions of elastic models: about the third dimension, nearly incompressible links, and quadrature.

A model completes the gradient H = F − I of a mesh to three dimensions and gives the strain that laws are written in. In
the plane, with j₂ = tr H + det H = J₂ − 1 and the contraction h = F₃₃ − 1,

    J − 1 = j₂ + J₂ h,      tr FᵀF − 3 − 2 (J − 1) = H : H − 2 det H − 2 j₂ h + h².

Plane strain has F₃₃ = 1, h = 0; where links have grown by the factor 1 + g across their depth, the elastic part of F₃₃
is 1/(1 + g) and h = −g/(1 + g). Plane stress has S₃₃ = 0, which is W_h = ∂W/∂h = 0: in closed form where the law has
one, else by Newton's method at every point, in ln(1 + h), from which material is never squeezed to nothing. With h₀
found,

    h = h₀ − W_h(H, h₀) / W_hh,

where derivatives of h₀ and W_hh are not taken. The derivative of h by H, −W_hH / W_hh, is right nevertheless, and since
W is stationary in h, derivatives of the energy are right up to the third. So forms hold no derivatives of iterations.

Displacements alone lock as ν goes to 0.5. In links in the u–p (mixed) formulation the energy W(F) of the law is
replaced by its Π(F, p), see ``SplitLaw``, a minimum in u and a maximum in the pressure p. With p continuous and one
degree lower than u (Taylor–Hood), the elements do not lock. Source: Boffi, Brezzi & Fortin
(doi:10.1007/978-3-642-36519-5) for the elements.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ufl import Identity, as_matrix, det, diff, dot, exp, inner, max_value, min_value, sinh, tr, variable
from ufl.constantvalue import Zero
from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, finite, point_text, set_fields, whole
from fenicsmech.laws import Law, NeoHookean, PlanarStrain, Strain, spatial_strain, undifferentiated
from fenicsmech.mechanism import Material

_STEPS = 6
"""Of Newton's method across the plane: five leave rounding where rubber is stretched to 0.4 or 6 times its length, and
one is in hand for other laws (tests/elasticity/test_hand_curves.py)."""

LOCKING = 0.49
"""ν above which quadratic displacements alone are too stiff (measured, tests/elasticity/test_locking.py)."""


class ElasticModel(ABC):
    """Dimension and kinematic assumption of an elastic body.

    Attributes:
        name: as shown in summaries and accepted on command lines.
        dim: dimension of the mesh.
        mechanism_dim: dimension of the space in which bodies move and joints and forces act.
        confined: whether strains on the mesh alone must keep the volume of incompressible material.
    """

    name: str
    dim: int
    mechanism_dim: int
    confined: bool = True

    @property
    def half(self) -> bool:
        """Whether the mesh is one half of the links, the other its mirror image at the plane z = 0."""
        return self.mechanism_dim < self.dim

    def check(self, materials: Sequence[Material]) -> None:
        """Checks that links in the plane stay in it: that an axis of each law is normal to the plane.

        Raises:
            DescriptionError: the law of a material has no such axis.
        """
        for material in materials:
            if self.mechanism_dim == 2 and max(abs(axis[2]) for axis in material.law.axes) < 1.0 - 1e-9:
                given = ", ".join(point_text(axis) for axis in material.law.axes)
                raise DescriptionError(
                    f"material {material.name!r}",
                    f"none of the axes of its law, {given}, is normal to the plane, out of which its links would bend",
                    "Turn the directions of the law, as along=(…), into the plane, or use space='3d'",
                )

    @abstractmethod
    def multiplier(self, depth: Expr | float) -> Expr | float:
        """Factor from integrals over the mesh of a link to those over the link, from its ``depth``."""

    @abstractmethod
    def strain(self, law: Law, H: Expr) -> Strain:
        """The strain of a material of ``law`` at the gradient H of the mesh, (dim, dim), or as ``grown`` gives it."""

    def grown(self, H: Expr, h: Expr) -> Expr:
        """The elastic gradient of links that have grown, as ``strain`` takes it: from that of the mesh, H, and, where
        the model holds the depth, from that across it, h."""
        return H


class Solid(ElasticModel):
    """Three dimensions, nothing assumed."""

    name, dim, mechanism_dim = "3d", 3, 3

    def multiplier(self, depth):
        return 1.0

    def strain(self, law, H):
        return spatial_strain(H)


class HalfSolid(Solid):
    """Three dimensions, the halves of all links on either side of the plane z = 0 mirror images of each other.

    Only the half z ≥ 0 is meshed and counts twice; u₃ = 0 on the mid-plane, and bodies move in the plane. Joints and
    forces are taken to be symmetric, as in models in the plane, whatever heights links are stacked at.
    Equilibria are those of the whole, as long as these are symmetric: motion out of the plane is excluded, and so is
    buckling, so that an equilibrium found stable may buckle out of the plane.
    """

    name, mechanism_dim = "3d-symmetric", 2

    def multiplier(self, depth):
        return 2.0


class PlaneStrain(ElasticModel):
    """Two dimensions, F₃₃ = 1: links that cannot contract across their depth."""

    name, dim, mechanism_dim = "plane-strain", 2, 2

    def multiplier(self, depth):
        return depth

    def strain(self, law, H):
        if H.ufl_shape == (3, 3):
            return spatial_strain(H)
        return PlanarStrain(_embed(H, 0.0), tr(H) + det(H), inner(H, H) - 2 * det(H), H, 0.0)

    def grown(self, H, h):
        return H if isinstance(h, Zero) else _embed(H, h)


class PlaneStress(PlaneStrain):
    """Two dimensions, S₃₃ = 0: links free to contract across their depth."""

    name, confined = "plane-stress", False

    def strain(self, law, H):
        return contracted(H, self.contraction(law, H))

    def grown(self, H, h):
        return H

    def contraction(self, law: Law, H: Expr) -> Expr:
        """h = F₃₃ − 1 such that S₃₃ = 0."""
        h = law.contraction(H)
        return self._newton(law, H) if h is None else h

    @staticmethod
    def _newton(law: Law, H: Expr) -> Expr:
        """h with ∂W/∂h = 0, by Newton's method from the neo-Hookean one of the same E and ν, exact at small strain."""
        held = law.with_parameters({name: undifferentiated(value) for name, value in law.parameters.items()})
        H0 = undifferentiated(H)
        h: Any = NeoHookean(1.0, 0.0).with_parameters({"E": held.E, "nu": held.nu}).contraction(H0)
        for _ in range(_STEPS):
            slope, curvature = _across(held, H0, h)
            # of ln(1 + h), downhill where the energy is not convex
            step = -slope / abs((1 + h) * curvature + slope)
            step = max_value(-1.0, min_value(1.0, step))
            h = undifferentiated(h + 2 * (1 + h) * sinh(step / 2) * exp(step / 2))
        return h - _across(law, H, h)[0] / _across(held, H0, h)[1]


def _across(law: Law, H: Expr, h: Expr) -> tuple[Expr, Expr]:
    """∂W/∂h and ∂²W/∂h² at the gradient H in the plane."""
    h = variable(h)
    slope = diff(law.energy(contracted(H, h)), h)
    return slope, diff(slope, h)


def cauchy_stress(model: ElasticModel, law: Law, H: Expr, p: Expr | None = None) -> Expr:
    """σ = J⁻¹ (∂W/∂F) Fᵀ, 3 × 3, with F = I + H completed by the model's assumption; from Π(F, p) where p is given."""
    H = variable(model.strain(law, H).H)
    strain = spatial_strain(H)
    energy = law.energy(strain) if p is None else law.mixed_energy(strain, p)
    return dot(diff(energy, H), (Identity(3) + H).T) / strain.J


def contracted(H: Expr, h: Expr) -> Strain:
    """The strain of the gradient H in the plane with F₃₃ = 1 + h."""
    j2 = tr(H) + det(H)
    # a negative J₂ makes J negative
    return PlanarStrain(_embed(H, h), j2 + (1 + j2) * h, inner(H, H) - 2 * det(H) - 2 * j2 * h + h**2, H, h)


def _embed(H: Expr, h: Expr | float) -> Expr:
    return as_matrix([[H[0, 0], H[0, 1], 0], [H[1, 0], H[1, 1], 0], [0, 0, h]])


SPATIAL, MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS = Solid(), HalfSolid(), PlaneStrain(), PlaneStress()


class Formulation(ABC):
    """Treatment of links of nearly incompressible material."""

    @abstractmethod
    def mixed(self, materials: Sequence[Material], model: ElasticModel, order: int) -> tuple[bool, ...]:
        """Whether links of ``materials`` are in the u–p formulation, at displacements of degree ``order``.

        Raises:
            DescriptionError: the law of one that should be has no u–p form.
        """


@dataclass(frozen=True)
class DisplacementFormulation(Formulation):
    """Displacements alone, whatever Poisson's ratio is."""

    def mixed(self, materials, model, order):
        return (False,) * len(materials)


@dataclass(frozen=True)
class MixedFormulation(Formulation):
    """Displacement and pressure in links whose Poisson's ratio is above a limit, displacements alone in all others.

    In plane stress, where depths adjust to keep the volume, and for order 1, which has no stable partner for its
    displacements, displacements are alone.

    Attributes:
        above: the limit, at least 0: a pressure needs resistance to changes of volume.

    Raises:
        DescriptionError: the limit is not in [0, 0.5).
    """

    above: float = LOCKING

    def __post_init__(self) -> None:
        above = finite("limit of Poisson's ratio of the mixed formulation", self.above)
        if not 0.0 <= above < 0.5:
            raise DescriptionError(
                "mixed formulation", f"its limit of Poisson's ratio is {above:g}", "Give one from 0 to below 0.5"
            )
        set_fields(self, above=above)

    def mixed(self, materials, model, order):
        found = tuple(model.confined and order > 1 and material.law.nu > self.above for material in materials)
        for material, mixed in zip(materials, found, strict=True):
            if mixed and not material.law.has_mixed_energy:
                raise DescriptionError(
                    f"material {material.name!r}",
                    f"ν = {material.law.nu:g} requires the u–p formulation, and its law "
                    f"{type(material.law).__name__} has no mixed_energy",
                    "Derive the law from SplitLaw, or use formulation=DisplacementFormulation()",
                )
        return found


@dataclass(frozen=True)
class Quadrature:
    """Degree of the quadrature over cells.

    Raises:
        DescriptionError: it is not a whole number of at least 1.
    """

    degree: int

    def __post_init__(self) -> None:
        whole("degree of the quadrature", self.degree, least=1)

    @staticmethod
    def for_order(order: int, dim: int) -> Quadrature:
        """The cheapest degree whose error lies well below the discretisation error (measured), by order of u."""
        return Quadrature({1: 1, 2: 3 if dim == 3 else 4}.get(order, 2 * order))
