"""Frictionless contact with rigid obstacles, by a penalty on penetration.

    V = Σ_links ∫ ½ κ ⟨−g(x)⟩² dA + Σ_points ½ k ⟨−g(x)⟩²,     x = X + u,

g the signed gap, positive outside, 0 on the surface, negative inside an obstacle, and ⟨·⟩ the positive part. The
pressure κ ⟨−g⟩ pushes a link out along ∇g. V is once continuously differentiable; its second derivative jumps where
points come into contact: Newton's method is semismooth there.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy
import ufl
from dolfinx import fem

from fenicsmech.effects.link_fields import Faces, LinkFields
from fenicsmech.effects.one_sided import OneSided
from fenicsmech.errors import DescriptionError, direction, in_plane, point, points, positive, set_fields
from fenicsmech.mechanism import Effect, FlexibleLink, Link, RigidLink, in_dimension
from fenicsmech.multibody import Linkage, PosePotential
from fenicsmech.symbolic import SmoothFunction, derive

_RELATIVE_STIFFNESS = 0.1
"""Default stiffness over that of the outermost layer of elements."""


class Obstacle(ABC):
    """A rigid, fixed obstacle."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[float, ...]:
        """Numbers that ``gap`` depends on; constants in forms, so that obstacles of one kind share compiled code."""

    @abstractmethod
    def gap(self, x, numbers, sqrt):
        """g at the coordinates ``x``, two or three, with ``numbers`` and ``sqrt``: of NumPy, UFL or SymPy."""

    @property
    def core(self) -> float | None:
        """Penetration beyond which the direction of the gap's gradient is ambiguous; None if it never is."""
        return None

    @abstractmethod
    def check(self, dim: int) -> None:
        """Checks the description in ``dim`` dimensions.

        Raises:
            DescriptionError: it is invalid.
        """


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
        set_fields(self, point=point("point of a half-plane", self.point))
        set_fields(self, normal=direction("normal of a half-plane", self.normal))

    def check(self, dim):
        in_plane("normal of a half-plane", self.normal, dim)

    @property
    def numbers(self):
        normal = in_dimension(self.normal, 3)
        return (float(np.dot(normal, in_dimension(self.point, 3))), *normal)

    def gap(self, x, numbers, sqrt):
        offset, *normal = numbers
        return sum(normal[k] * x[k] for k in range(len(x))) - offset

    def __str__(self) -> str:
        return f"a plane through {self.point} that faces {self.normal}"


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
        set_fields(self, centre=point("centre of a cylinder", self.centre, dimensions=(2,)))
        set_fields(self, radius=positive("radius of a cylinder", self.radius))

    def check(self, dim):
        pass

    @property
    def numbers(self):
        distance = float(np.hypot(*self.centre))
        e = tuple(-c / distance for c in self.centre) if distance else (1.0, 0.0)
        return (*(c + self.radius * n for c, n in zip(self.centre, e, strict=True)), *e, self.radius)

    def gap(self, x, numbers, sqrt):
        # with r from b = c + R e, the point of the surface that is nearest to the origin,
        #     |x − c|² − R² = r · (r + 2 R e),
        # so that obstacles much larger than the links lose no digits
        a, b, along, across, radius = numbers
        r, s = x[0] - a, x[1] - b
        beyond = r * (r + 2.0 * radius * along) + s * (s + 2.0 * radius * across)
        return beyond / (sqrt(beyond + radius**2) + radius)

    @property
    def core(self):
        return 0.25 * self.radius  # deeper points might leave on the other side

    def __str__(self) -> str:
        return f"a cylinder of radius {self.radius:g} at {self.centre}"


@dataclass(frozen=True)
class Contact(Effect):
    """Frictionless contact of a link and an obstacle.

    Attributes:
        link: a flexible link, touched anywhere on its boundary, or a rigid link, touched at ``points``.
        obstacle: a ``Cylinder`` or a ``HalfPlane``.
        stiffness: for flexible links pressure per penetration κ, by default a tenth of that of the outermost layer of
            elements, 0.1 E / h with its height h: the penetration under the pressure p is 10 (p / E) h. For
            rigid links force per penetration k of each point; must be given.
        points: of a rigid link as drawn.

    Penetration falls as 1 / stiffness, while Newton's method takes more iterations where contact changes. Obstacles act
    only after the motors have moved: a configuration whose rigid assembly is on the far side of an obstacle stays
    there. From then on flexible links cannot slip through a cylinder: states with a penetration of a quarter of its
    radius are rejected. In space a pressed edge is also pressed on its flat faces inside the obstacle, with an error of
    the order of penetration over depth.

    Raises:
        DescriptionError: a number is invalid, or a field that a link of this kind needs is missing.
    """

    link: Link
    obstacle: Obstacle
    stiffness: float | None = None
    points: Sequence[Sequence[float]] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.link, Link):
            raise DescriptionError("contact", f"{self.link!r} is not a link", "Give a rigid or a flexible link")
        part = f"contact of {self.link.name!r}"
        if self.stiffness is not None:
            set_fields(self, stiffness=positive(f"stiffness of {part}", self.stiffness))
        set_fields(self, points=points(f"points of {part}", self.points, least=0, dimensions=(2, 3)))
        if not isinstance(self.obstacle, Obstacle):
            raise DescriptionError(part, f"{self.obstacle!r} is not an obstacle", "Give a Cylinder(…) or HalfPlane(…)")
        match self.link:
            case RigidLink() if not self.points or self.stiffness is None:
                raise DescriptionError(
                    part, "a rigid link touches at points only", "Give points=… and their stiffness=…"
                )
            case FlexibleLink() if self.points:
                raise DescriptionError(part, "a flexible link touches along its whole surface", "Leave points out")

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        self.obstacle.check(dim)

    def explain(self):
        return f"frictionless contact of {self.link.name} with {self.obstacle}"

    @property
    def faces(self):
        return (Faces(self.link),) if isinstance(self.link, FlexibleLink) else ()

    def one_sided(self, fields):
        return [_Surface(self, self.link, fields)] if isinstance(self.link, FlexibleLink) else []

    def link_energy(self, fields):
        if not isinstance(self.link, FlexibleLink):
            return None
        numbers = [fem.Constant(fields.mesh, number) for number in self.obstacle.numbers]
        gap = self.obstacle.gap([fields.position[k] for k in range(fields.dim)], numbers, ufl.sqrt)
        inside = -gap
        if self.obstacle.core is not None:
            # NaN, as in an inverted element: no solution lies beyond
            lost = ufl.lt(gap, fem.Constant(fields.mesh, -self.obstacle.core))
            inside = ufl.conditional(lost, fem.Constant(fields.mesh, np.nan), inside)
        inside = ufl.conditional(ufl.lt(gap, 0.0), inside, 0.0)
        density = 0.5 * self._stiffness(self.link, fields) * inside**2
        return fields.boundary_integral(density, Faces(self.link), degree=2 * fields.order)

    def _stiffness(self, link: FlexibleLink, fields: LinkFields):
        """κ in UFL."""
        if self.stiffness is not None:
            return fem.Constant(fields.mesh, self.stiffness)
        height = fields.dim * ufl.CellVolume(fields.mesh) / ufl.FacetArea(fields.mesh)
        return fem.Constant(fields.mesh, _RELATIVE_STIFFNESS * link.material.law.E) / height

    def pose_potentials(self, linkage):
        return [_Points(self, linkage)] if isinstance(self.link, RigidLink) else []


class _Surface(OneSided):
    """The surface of a flexible link, at the points of the quadrature of its energy."""

    def __init__(self, contact: Contact, link: FlexibleLink, fields: LinkFields) -> None:
        self._obstacle, boundary = contact.obstacle, fields.boundaries[Faces(link)]
        super().__init__(fields, boundary, degree=2 * fields.order)
        if contact.stiffness is not None:
            stiffness = np.full(len(boundary.cells), contact.stiffness)
        else:
            stiffness = _RELATIVE_STIFFNESS * link.material.law.E / self.heights()
        self.compliances = self.at_points(1.0 / stiffness)

    @cached_property
    def _gap(self) -> SmoothFunction:
        return _smooth_gap(self._obstacle, self._body.model.dim)

    def gap(self, x):
        numbers = np.array([self._obstacle.numbers])
        weights = np.ones((len(x), 1))
        return (
            self._gap.value(x, numbers)[:, 0],
            self._gap.gradient(x, numbers)[:, 0],
            self._gap.hessian(x, numbers, weights),
        )


class _Points(PosePotential):
    """½ k Σ ⟨−g⟩² at points of a rigid link."""

    def __init__(self, contact: Contact, linkage: Linkage) -> None:
        body = linkage.body_of(contact.link)
        self._drawn = np.array([in_dimension(p, linkage.dim) for p in contact.points])
        self._offsets, self._space = self._drawn - linkage.bodies[body].centre, linkage.joints.space
        self.bodies, self._obstacle, self._stiffness = (body,), contact.obstacle, contact.stiffness

    def value(self, poses):
        inside = self._touching(poses)[1]
        return 0.5 * self._stiffness * float(inside @ inside)

    def gradient(self, poses):
        point, inside, _, motion = self._touching(poses)
        slope = np.einsum("ni,nia->na", self._gap.gradient(*point)[:, 0], motion)
        return -self._stiffness * inside @ slope

    def hessian(self, poses):
        point, inside, offsets, motion = self._touching(poses)
        normal = self._gap.gradient(*point)[:, 0]
        slope = np.einsum("ni,nia->na", normal, motion)
        hessian = np.einsum("nij,nia,njb->ab", self._gap.hessian(*point, inside[:, None]), motion, motion)
        turn = self._space.displacement_hessian(poses[self.bodies[0]], (inside[:, None] * normal).T @ offsets)
        return self._stiffness * (slope.T @ slope - hessian - turn)

    @cached_property
    def _gap(self) -> SmoothFunction:
        return _smooth_gap(self._obstacle, self._space.dim)

    def _touching(self, poses: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
        """Of the points inside: arguments of g, −g, offsets from the body's centre, and ∂u/∂z."""
        pose, numbers = poses[self.bodies[0]], np.array([self._obstacle.numbers])
        where = self._drawn + self._space.displace(pose, self._offsets)
        gap = self._gap.value(where, numbers)[:, 0]
        inside = gap < 0.0
        offsets = self._offsets[inside]
        return (where[inside], numbers), -gap[inside], offsets, self._space.displacement_gradient(pose, offsets)


def _smooth_gap(obstacle: Obstacle, dim: int) -> SmoothFunction:
    """g at many points in ``dim`` dimensions, of their coordinates and the obstacle's numbers, with its derivatives."""
    x, numbers = sympy.symbols(f"x:{dim}"), sympy.symbols(f"c:{len(obstacle.numbers)}")
    return derive([obstacle.gap(x, numbers, sympy.sqrt)], x, numbers, many=True)
