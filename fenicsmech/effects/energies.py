"""Energies of effects in terms of the fields of flexible links and of the poses of bodies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.effects.faces import Boundary, Faces, cofactor
from fenicsmech.elasticity import ElasticBody, ElasticModel
from fenicsmech.mechanism import Effect, FlexibleLink
from fenicsmech.multibody import Linkage


@dataclass(frozen=True, eq=False)
class LinkFields:
    """Fields that link energies are written in.

    Attributes:
        links: all flexible links.
        body: the links as one body.
        boundaries: the parts of links' boundaries that effects list.
    """

    links: tuple[FlexibleLink, ...]
    body: ElasticBody
    boundaries: Mapping[Faces, Boundary]

    @property
    def model(self) -> ElasticModel:
        """The assumption about the third dimension."""
        return self.body.model

    @property
    def u(self) -> fem.Function:
        """Displacement field."""
        return self.body.u

    @property
    def order(self) -> int:
        """Degree of u."""
        return self.body.order

    @property
    def dx(self) -> ufl.Measure:
        """Measure of all cells, interfaces included, on the reference mesh."""
        return self.body.dx

    def cellwise(self, per_link: Sequence[float]) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        return self.body.cellwise(per_link)

    @property
    def dim(self) -> int:
        """Dimension of the mesh."""
        return self.model.dim

    @property
    def mesh(self):
        """The reference mesh."""
        return self.body.mesh

    @property
    def position(self):
        """x = X + u, the positions of material points."""
        return self.body.rest + self.u

    @property
    def stretch(self):
        """det(∇X): volume at rest over that of the reference mesh."""
        return ufl.det(self.body.rest_gradient)

    @property
    def depth(self):
        """Factor from integrals over the mesh to those over the links: their depth, or 2 for half models."""
        return self.model.multiplier(self.body.depth)

    def integral(self, density, *, degree: int) -> ufl.Form:
        """∫ density dV over the links at rest, their depth included; ``degree`` of ``density``.

        In curved cells det(∇X) is a polynomial too, of degree dim.
        """
        whole = degree if self.body.bulge is None else degree + self.dim
        return density * self.stretch * self.depth * self.dx(metadata={"quadrature_degree": whole})

    def boundary_integral(self, density, faces: Faces, *, degree: int) -> ufl.Form:
        """∫ density dA over ``faces`` of the links at rest, their depth included.

        By Nanson's formula dA = |det(∇X) (∇X)⁻ᵀ N| dA₀.
        """
        area = ufl.dot(cofactor(self.body.rest_gradient), ufl.FacetNormal(self.mesh))
        return self.reference_integral(density * self.depth * ufl.sqrt(ufl.dot(area, area)), faces, degree=degree)

    def flux(self, vector, faces: Faces, *, degree: int) -> ufl.Form:
        """∫ vector · n da over ``faces`` of the links as deformed, their depth at rest included.

        n points out of the link. By Nanson's formula n da = cof(∇X + ∇u) N dA₀.
        """
        motion = self.body.rest_gradient + ufl.grad(self.u)
        area = ufl.dot(cofactor(motion), ufl.FacetNormal(self.mesh))
        return self.reference_integral(self.depth * ufl.dot(vector, area), faces, degree=degree)

    def reference_integral(self, density, faces: Faces, *, degree: int) -> ufl.Form:
        """∫ density dA₀ over ``faces`` of the reference mesh, without ``depth``."""
        terms = [density * ds(metadata={"quadrature_degree": degree}) for ds in self.boundaries[faces].measures]
        return sum(terms[1:], start=terms[0])


class PosePotential(ABC):
    """A potential V(z) of the poses of a few bodies.

    Attributes:
        bodies: indices of the bodies.
        holds: whether it acts in full from the start, instead of growing with the load factor.
    """

    bodies: tuple[int, ...]
    holds: bool = False

    @abstractmethod
    def value(self, poses: np.ndarray) -> float:
        """V; ``poses`` are those of all bodies, (bodies, pose_size)."""

    @abstractmethod
    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂V/∂z of ``bodies``, one after the other, (n · pose_size,)."""

    @abstractmethod
    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z², (n · pose_size, n · pose_size)."""


def spring_potentials(effects: Sequence[Effect], linkage: Linkage) -> tuple[PosePotential, ...]:
    """The potentials of ``effects`` that act in full from the start."""
    return tuple(found for effect in effects for found in effect.pose_potentials(linkage) if found.holds)
