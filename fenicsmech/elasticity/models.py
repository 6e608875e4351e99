"""The assumptions of elastic models: about the third dimension, nearly incompressible links, and quadrature.

A model completes the gradient H = F − I of a mesh to three dimensions and gives the strain that laws are written in. In
the plane, with j₂ = tr H + det H = J₂ − 1 and the contraction h = F₃₃ − 1,

    J − 1 = j₂ + J₂ h,      tr FᵀF − 3 − 2 (J − 1) = H : H − 2 det H − 2 j₂ h + h².

Plane strain has h = 0. Plane stress has S₃₃ = 0, which is ∂W/∂h = 0: in closed form where the law has one, else by
Newton's method at every point.

Displacements alone lock as ν goes to 0.5. In links in the u–p (mixed) formulation the energy W(F) of the law is
replaced by its Π(F, p), see ``SplitLaw``, a minimum in u and a maximum in the pressure p. With p continuous and one
degree lower than u (Taylor–Hood), the elements do not lock. Source: Boffi, Brezzi & Fortin
(doi:10.1007/978-3-642-36519-5) for the elements.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from ufl import Identity, as_matrix, det, diff, dot, inner, tr, variable
from ufl.core.expr import Expr

from fenicsmech.errors import DescriptionError, finite, set_fields, whole
from fenicsmech.laws import Law, NeoHookean, Strain, spatial_strain
from fenicsmech.mechanism import Material

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

    @abstractmethod
    def multiplier(self, depth: Expr | float) -> Expr | float:
        """Factor from integrals over the mesh of a link to those over the link, from its ``depth``."""

    @abstractmethod
    def strain(self, law: Law, H: Expr) -> Strain:
        """The strain of a material of ``law`` at the gradient H of the mesh, (dim, dim)."""


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
        return Strain(_embed(H, 0.0), tr(H) + det(H), inner(H, H) - 2 * det(H))


class PlaneStress(PlaneStrain):
    """Two dimensions, S₃₃ = 0: links free to contract across their depth."""

    name, confined = "plane-stress", False

    def strain(self, law, H):
        return _contracted(H, self.contraction(law, H))

    def contraction(self, law: Law, H: Expr) -> Expr:
        """h = F₃₃ − 1 such that S₃₃ = 0."""
        h = law.contraction(H)
        return self._newton(law, H) if h is None else h

    @staticmethod
    def _newton(law: Law, H: Expr) -> Expr:
        """h with ∂W/∂h = 0, by Newton's method from the neo-Hookean one of the same E and ν, exact at small strain.

        The error of the energy is the square of that of h, and each step squares this in turn: three leave rounding
        up to stretches of 1.5, and 1e-8 of the stress at 2 (tests/elasticity/test_new_law.py). h is an expression:
        stiffnesses are those of these energies, and take long to compile.
        """
        h = NeoHookean(1.0, 0.0).with_parameters({"E": law.E, "nu": law.nu}).contraction(H)
        for _ in range(3):
            h = variable(h)
            slope = diff(law.energy(_contracted(H, h)), h)
            h = h - slope / diff(slope, h)
        return h


def cauchy_stress(model: ElasticModel, law: Law, H: Expr) -> Expr:
    """σ = J⁻¹ (∂W/∂F) Fᵀ, 3 × 3, with F = I + H completed by the model's assumption."""
    H = variable(model.strain(law, H).H)
    strain = spatial_strain(H)
    return dot(diff(law.energy(strain), H), (Identity(3) + H).T) / strain.J


def _contracted(H: Expr, h: Expr) -> Strain:
    """The strain of the gradient H in the plane with F₃₃ = 1 + h."""
    j2 = tr(H) + det(H)
    # a negative J₂ makes J negative
    return Strain(_embed(H, h), j2 + (1 + j2) * h, inner(H, H) - 2 * det(H) - 2 * j2 * h + h**2)


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
