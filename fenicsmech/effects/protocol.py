"""What an effect adds to the potential energy of a mechanism: on its flexible links, and between its bodies.

    Π = E_int + share · (Σ link energies + Σ body potentials) − loads

``share`` grows from 0 to 1 before the controlled force does, as that of the constant loads.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.linkage import Linkage
from fenicsmech.mechanism import FlexibleLink
from fenicsmech.mechanism.effect import Effect


@dataclass(frozen=True, eq=False)
class LinkFields:
    """Fields that link energies are written in.

    Attributes:
        links: all flexible links.
        u, d: displacement and design field.
        dx: ufl measure of all cells, interfaces included, on the reference mesh.
        order: degree of u.
        cellwise: makes a field with one value per cell from one value per link, (links,).
    """

    links: tuple[FlexibleLink, ...]
    u: fem.Function
    d: fem.Function
    dx: ufl.Measure
    order: int
    cellwise: Callable[[Sequence[float]], fem.Function]

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return self.u.function_space.mesh.geometry.dim

    @property
    def stretch(self):
        """det(I + ∇d): volume at rest over that of the reference mesh."""
        return ufl.det(ufl.Identity(self.dim) + ufl.grad(self.d))

    def integral(self, density, *, degree: int) -> ufl.Form:
        """∫ density dV over all links at rest, dV without the depth of planar links; ``degree`` of the quadrature."""
        return density * self.stretch * self.dx(metadata={"quadrature_degree": degree})


class LinkEffect(Effect):
    """An effect with an energy on flexible links."""

    @abstractmethod
    def energy(self, fields: LinkFields) -> ufl.Form | None:
        """The energy as a form; None if no link is concerned."""


class PosePotential(ABC):
    """A potential V(z) of the poses of a few bodies.

    Attributes:
        bodies: indices of the bodies.
    """

    bodies: tuple[int, ...]

    @abstractmethod
    def value(self, poses: np.ndarray) -> float:
        """V; ``poses`` are those of all bodies, (bodies, pose_size)."""

    @abstractmethod
    def gradient(self, poses: np.ndarray) -> np.ndarray:
        """∂V/∂z of ``bodies``, one after the other, (n · pose_size,)."""

    @abstractmethod
    def hessian(self, poses: np.ndarray) -> np.ndarray:
        """∂²V/∂z², (n · pose_size, n · pose_size)."""


class BodyEffect(Effect):
    """An effect with potentials of body poses."""

    @abstractmethod
    def potentials(self, linkage: Linkage) -> Sequence[PosePotential]:
        """The potentials."""
