"""What is assumed about the third dimension. A model turns H = F − I into the strain its energies see."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ufl import as_matrix, det, tr
from ufl.core.expr import Expr

from fenicsmech.elasticity.strain import Moduli, Strain, plane_strain, plane_strain_stretched, spatial_strain
from fenicsmech.elasticity.transverse import transverse_strain
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import EnergyLaw, Material


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
    def symmetric(self) -> bool:
        """Whether the mesh is one half of the links, the other its mirror image at the plane z = 0."""
        return self.mechanism_dim < self.dim

    @abstractmethod
    def multiplier(self, depth: Expr | float) -> Expr | float:
        """What integrals over the mesh of a link are multiplied by to be those over the link, from its ``depth``."""

    @abstractmethod
    def check(self, link: str, material: Material) -> None:
        """Refuses a material whose law has no form under this model's assumption.

        Raises:
            DescriptionError: it has none.
        """

    @abstractmethod
    def strain(self, law: EnergyLaw, H: Expr, moduli: Moduli) -> Strain:
        """The invariants of F = I + H under this model's assumption."""

    @abstractmethod
    def embed(self, law: EnergyLaw, H: Expr, moduli: Moduli) -> Expr:
        """H as a 3 × 3 tensor under this model's assumption."""


class Spatial(ElasticModel):
    """Three dimensions, nothing assumed."""

    name, dim, mechanism_dim = "3d", 3, 3

    def multiplier(self, depth):
        return 1.0

    def check(self, link, material):
        pass

    def strain(self, law, H, moduli):
        return spatial_strain(H)

    def embed(self, law, H, moduli):
        return H


class MidPlaneSymmetric(Spatial):
    """Three dimensions, the halves of all links on either side of the plane z = 0 mirror images of each other.

    Only the half z ≥ 0 is meshed and counts twice; u₃ = 0 on the mid-plane, and bodies move in the plane. What joints
    do and forces is taken to be symmetric, as in models in the plane, whatever heights links are stacked at.
    Equilibria are those of the whole, as long as these are symmetric: motion out of the plane is not seen, nor
    buckling out of the plane, so that an equilibrium called stable may give way there.
    """

    name, mechanism_dim = "3d-symmetric", 2

    def multiplier(self, depth):
        return 2.0


class Planar(ElasticModel):
    """Two dimensions, everything constant across the depth."""

    dim, mechanism_dim = 2, 2

    def multiplier(self, depth):
        return depth


class PlaneStrain(Planar):
    """Two dimensions, F₃₃ = 1: links that cannot contract across their depth."""

    name = "plane-strain"

    def check(self, link, material):
        pass

    def strain(self, law, H, moduli):
        return plane_strain(H)

    def embed(self, law, H, moduli):
        return _embed(H, 0.0)


class PlaneStress(Planar):
    """Two dimensions, S₃₃ = 0: links free to contract across their depth."""

    name, confined = "plane-stress", False

    def check(self, link, material):
        if transverse_strain.dispatch(type(material.law)) is transverse_strain.dispatch(EnergyLaw):
            raise DescriptionError(
                f"link {link!r}",
                f"the law {type(material.law).__name__} of {material.name!r} has no closed form in plane stress",
                "Use the law NeoHookean(), or plane strain or 3D",
            )

    def strain(self, law, H, moduli):
        return plane_strain_stretched(H, self._transverse(law, H, moduli))

    def embed(self, law, H, moduli):
        return _embed(H, self.contraction(law, H, moduli))

    def contraction(self, law: EnergyLaw, H: Expr, moduli: Moduli) -> Expr:
        """F₃₃ − 1 = e / (1 + √(1 + e))."""
        e = self._transverse(law, H, moduli)
        return e / (1 + (1 + e) ** 0.5)

    @staticmethod
    def _transverse(law: EnergyLaw, H: Expr, moduli: Moduli) -> Expr:
        return transverse_strain(law, tr(H) + det(H), moduli)


def _embed(H: Expr, H33: Expr | float) -> Expr:
    return as_matrix([[H[0, 0], H[0, 1], 0], [H[1, 0], H[1, 1], 0], [0, 0, H33]])


SPATIAL, MID_PLANE_SYMMETRIC, PLANE_STRAIN, PLANE_STRESS = Spatial(), MidPlaneSymmetric(), PlaneStrain(), PlaneStress()
