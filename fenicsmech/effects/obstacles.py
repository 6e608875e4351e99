"""Rigid obstacles, each by its signed gap g(x): positive outside, 0 on the surface, negative inside."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from fenicsmech.checks import direction, point, positive
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import in_dimension


class Obstacle(ABC):
    """Something rigid that stands still.

    Numbers enter forms as constants, so that obstacles of one kind share their compiled code.
    """

    @property
    @abstractmethod
    def core(self) -> float | None:
        """Penetration at which the way out is in doubt; None if it never is."""

    @abstractmethod
    def check(self, dim: int) -> None:
        """Refuses what makes no sense in ``dim`` dimensions.

        Raises:
            DescriptionError: saying why.
        """

    @abstractmethod
    def gap_form(self, x, mesh: dmesh.Mesh):
        """g at a position ``x``, in UFL."""

    @abstractmethod
    def gap(self, points: np.ndarray) -> np.ndarray:
        """g at ``points`` (n, dim), (n,)."""

    @abstractmethod
    def gap_gradient(self, points: np.ndarray) -> np.ndarray:
        """∇g, (n, dim)."""

    @abstractmethod
    def gap_hessian(self, points: np.ndarray) -> np.ndarray:
        """∇∇g, (n, dim, dim)."""


@dataclass(frozen=True)
class HalfPlane(Obstacle):
    """Everything behind a plane: g = (x − p) · n.

    Attributes:
        point: p, on the plane.
        normal: n, out of the obstacle; any length.

    Raises:
        DescriptionError: they are not a point and a direction.
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", point("point of a half-plane", self.point))
        object.__setattr__(self, "normal", direction("normal of a half-plane", self.normal))

    @property
    def core(self):
        return None

    def check(self, dim):
        if dim == 2 and in_dimension(self.normal, 3)[2] != 0.0:
            raise DescriptionError(
                "half-plane", f"its normal {self.normal} leaves the plane", "Simulate in space, or give two coordinates"
            )

    def gap_form(self, x, mesh):
        normal = fem.Constant(mesh, self._normal(x.ufl_shape[0]))
        return ufl.dot(x, normal) - fem.Constant(mesh, self._offset(x.ufl_shape[0]))

    def gap(self, points):
        dim = points.shape[1]
        return points @ self._normal(dim) - self._offset(dim)

    def gap_gradient(self, points):
        return np.tile(self._normal(points.shape[1]), (len(points), 1))

    def gap_hessian(self, points):
        return np.zeros((len(points), points.shape[1], points.shape[1]))

    def __str__(self) -> str:
        return f"a plane through {self.point} that faces {self.normal}"

    def _normal(self, dim: int) -> np.ndarray:
        return np.array(in_dimension(self.normal, dim))

    def _offset(self, dim: int) -> float:
        return float(self._normal(dim) @ in_dimension(self.point, dim))


@dataclass(frozen=True)
class Cylinder(Obstacle):
    """An infinite cylinder along z: g = |(x − c)_xy| − R.

    Attributes:
        centre: c, two coordinates.
        radius: R.

    Raises:
        DescriptionError: they are not a point and a positive number.
    """

    centre: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", point("centre of a cylinder", self.centre, dimensions=(2,)))
        object.__setattr__(self, "radius", positive("radius of a cylinder", self.radius))

    @property
    def core(self):
        return 0.25 * self.radius  # what gets deeper might leave on the other side

    def check(self, dim):
        pass

    def gap_form(self, x, mesh):
        centre = fem.Constant(mesh, np.array(self.centre))
        across = ufl.as_vector([x[0] - centre[0], x[1] - centre[1]])
        return ufl.sqrt(ufl.dot(across, across)) - fem.Constant(mesh, self.radius)

    def gap(self, points):
        return np.linalg.norm(points[:, :2] - self.centre, axis=1) - self.radius

    def gap_gradient(self, points):
        gradient = np.zeros_like(points)
        across = points[:, :2] - self.centre
        gradient[:, :2] = across / np.linalg.norm(across, axis=1, keepdims=True)
        return gradient

    def gap_hessian(self, points):
        # (I − e ⊗ e) / |x − c| across the axis
        e = self.gap_gradient(points)[:, :2]
        across = np.eye(2) - np.einsum("ni,nj->nij", e, e)
        hessian = np.zeros((len(points), points.shape[1], points.shape[1]))
        hessian[:, :2, :2] = across / np.linalg.norm(points[:, :2] - self.centre, axis=1)[:, None, None]
        return hessian

    def __str__(self) -> str:
        return f"a cylinder of radius {self.radius:g} at {self.centre}"
