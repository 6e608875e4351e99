"""Frictionless contact with rigid obstacles, by a penalty on penetration.

    V = Σ_links ∫ ½ κ ⟨−g(x)⟩² dA + Σ_points ½ k ⟨−g(x)⟩²,     x = X + u,

g the signed gap, positive outside, 0 on the surface, negative inside an obstacle, and ⟨·⟩ the positive part. The
pressure κ ⟨−g⟩ pushes a link out along ∇g. V is once continuously differentiable; its second derivative jumps where
points come into contact, and Newton steps find them with gaps linearised.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import basix
import numpy as np
import sympy
import ufl
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import bsr_matrix, csr_matrix, identity, kron

from fenicsmech.compat import add_ghosts, cell_dofs, cell_nodes, lagrange_element, owned_values
from fenicsmech.effects.link_fields import Faces, LinkFields
from fenicsmech.errors import DescriptionError, direction, in_plane, point, points, positive, set_fields
from fenicsmech.mechanism import Effect, FlexibleLink, Link, RigidLink, in_dimension
from fenicsmech.multibody import Linkage, PosePotential
from fenicsmech.symbolic import SmoothFunction

_FACETS = {2: basix.CellType.interval, 3: basix.CellType.triangle}

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
        """g at the coordinates ``x``, two or three, with ``numbers`` and ``sqrt``: of NumPy, UFL or SymPy.

        No point is nearer to the surface than |g|.
        """

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

    Penetration falls as 1 / stiffness; iterations hardly depend on it. Obstacles act only after the motors have moved:
    a configuration whose rigid assembly is on the far side of an obstacle stays there. From then on flexible links
    cannot slip through a cylinder: states with a penetration of a quarter of its radius are rejected. Mechanisms that
    nothing but loads holds start as drawn where an obstacle is on the way of a flexible link to the pose that loads
    prefer. In space a pressed edge is also pressed on its flat faces inside the obstacle, with an error of the order of
    penetration over depth.

    Raises:
        DescriptionError: a number is invalid, or a field that a link of this kind needs is missing.
    """

    obstructs: ClassVar[bool] = True

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
        return [OneSided(self, self.link, fields)] if isinstance(self.link, FlexibleLink) else []

    def turns_with(self, link):
        return True

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
        return [TouchingPoints(self, linkage)] if isinstance(self.link, RigidLink) else []


class OneSided:
    """The boundary of a flexible link and an obstacle at the points of the quadrature of V, n on this rank.

    Newton steps find with them which points touch (``equilibrium.active_set``); forces and stiffness, with D = −∂p/∂g:

        −Σ w p ∇g,     Σ w (D ∇g ⊗ ∇g − p ∇²g).

    Args:
        contact: of the link.
        link: with the boundary.
        fields: of the links.

    Attributes:
        link: with the boundary.
        compliances: 1/κ, (n,).
        weights: areas that points stand for, of the links at rest, their depth included, (n,).
        places: x, (n, dim), as ``weights`` and ``gaps`` of the last ``update``.
        gaps: g, (n,).
    """

    def __init__(self, contact: Contact, link: FlexibleLink, fields: LinkFields) -> None:
        boundary, dim = fields.boundaries[Faces(link)], fields.dim
        self.link, self._obstacle, self._body, self._boundary = link, contact.obstacle, fields.body, boundary
        points, self._weights = basix.make_quadrature(_FACETS[dim], 2 * fields.order)
        self._points = np.column_stack([1.0 - points.sum(axis=1), points])
        self._nodes = self._tabulated(fields.u, 0)[0]
        self._shape, *self._along = self._tabulated(fields.body.shape, 1)
        space = fields.u.function_space
        self._motion = fem.Function(space)
        count = self._nodes.shape[1]
        self._global = space.dofmap.index_map.local_to_global(np.arange(count, dtype=np.int32)).astype(np.int64)
        if contact.stiffness is not None:
            stiffness = np.full(len(boundary.cells), contact.stiffness)
        else:
            stiffness = _RELATIVE_STIFFNESS * link.material.law.E / self._heights()
        self.compliances = np.repeat(1.0 / stiffness, len(self._points))
        # shape and depth, and u, of the last update; None before the first: arrays are empty on ranks without cells
        self._rest: tuple[np.ndarray, np.ndarray] | None = None
        self._u: np.ndarray | None = None

    @cached_property
    def _gap(self) -> SmoothFunction:
        return smooth_gap(self._obstacle, self._body.model.dim)

    def _heights(self) -> np.ndarray:
        """Heights of the cells over their facets, as meshed, (facets,)."""
        dim, mesh = self._body.model.dim, self._body.mesh
        cells = mesh.geometry.x[cell_nodes(mesh)[self._boundary.cells]][..., :dim]
        volume = np.abs(np.linalg.det(cells[:, 1:] - cells[:, :1]))
        edges = self._boundary.places[:, 1:] - self._boundary.places[:, :1]
        area = np.linalg.norm(edges[:, 0] if dim == 2 else np.cross(edges[:, 0], edges[:, 1]), axis=1)
        return volume / area

    def update(self) -> None:
        """Takes the rest shape and the displacements that the fields hold, where they changed. Local."""
        body = self._body
        shape, depth, u = body.shape.x.array, body.depth.x.array, body.u.x.array
        rest = self._rest
        same_rest = rest is not None and np.array_equal(shape, rest[0]) and np.array_equal(depth, rest[1])
        if same_rest and self._u is not None and np.array_equal(u, self._u):
            return
        if not same_rest:
            self._take_rest()
            self._rest = shape.copy(), depth.copy()
        self._u = u.copy()
        self.places = self._unloaded + self._nodes @ u.reshape(-1, body.model.dim)
        numbers = np.array([self._obstacle.numbers])
        self.gaps = self._gap.value(self.places, numbers)[:, 0]
        self._normals = self._gap.gradient(self.places, numbers)[:, 0]

    @property
    def touched(self) -> np.ndarray:
        """Vertices of this rank's facets with a point inside the obstacle, (k, dim), numbered in the whole mesh."""
        inside = (self.gaps.reshape(-1, len(self._points)) < 0.0).any(axis=1)
        return self._boundary.corners[inside]

    def _take_rest(self) -> None:
        """Places and weights of the points in the rest shape."""
        places, dim = self._boundary.places, self._body.model.dim
        shape = self._body.shape.x.array.reshape(-1, dim)
        self._unloaded = (self._points @ places).reshape(-1, dim) + self._shape @ shape
        edges = [np.repeat(places[:, k] - places[:, 0], len(self._points), axis=0) for k in range(1, dim)]
        edges = [edge + along @ shape for edge, along in zip(edges, self._along, strict=True)]
        area = edges[0] if dim == 2 else np.cross(edges[0], edges[1])
        depth = self._body.model.multiplier(self._body.depth.x.array[self._boundary.cells])
        weights = np.outer(depth * np.ones(len(places)), self._weights).ravel()
        self.weights = weights * np.linalg.norm(area, axis=1)

    def rates(self, motion: np.ndarray) -> np.ndarray:
        """∇g · δu at the points, (n,), from δu of this rank's owned nodes, flat."""
        owned_values(self._motion)[:] = motion
        self._motion.x.scatter_forward()
        moved = self._nodes @ self._motion.x.array.reshape(self._nodes.shape[1], -1)
        return np.einsum("ni,ni->n", self._normals, moved)

    def forces(self, pressures: np.ndarray) -> np.ndarray:
        """−Σ w p ∇g, the gradient of the energy where p are the ``pressures``, this rank's owned values, flat."""
        values = -(self.weights * pressures)[:, None] * self._normals
        self._motion.x.array[:] = (self._nodes.T @ values).ravel()
        add_ghosts(self._motion)
        return owned_values(self._motion).copy()

    def add_stiffness(
        self,
        matrix: PETSc.Mat,
        rows_of: Callable[[np.ndarray], np.ndarray],
        stiffness: np.ndarray,
        pressures: np.ndarray,
    ) -> None:
        """Adds Σ w (D ∇g ⊗ ∇g − p ∇²g) into ``matrix`` and leaves it unassembled.

        ``rows_of`` gives the matrix's rows of nodes, numbered over all ranks, ``stiffness`` is D, ``pressures`` p.
        """
        points = np.flatnonzero((stiffness != 0.0) | (pressures != 0.0))
        normals, count = self._normals[points], len(points)
        if not count:
            return
        blocks = stiffness[points, None, None] * normals[:, :, None] * normals[:, None, :]
        curvatures = self._gap.hessian(self.places[points], np.array([self._obstacle.numbers]), np.ones((count, 1)))
        blocks = self.weights[points, None, None] * (blocks - pressures[points, None, None] * curvatures)
        shape = self._nodes[points]
        used = np.unique(shape.indices)
        nodes = kron(shape[:, used], identity(normals.shape[1]), format="csr")
        diagonal = bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=2 * (nodes.shape[0],))
        found = (nodes.T @ diagonal @ nodes).tocsr()
        rows = rows_of(self._global[used]).astype(PETSc.IntType)
        matrix.setValuesIJV(found.indptr.astype(PETSc.IntType), rows[found.indices], found.data, addv=True, rowmap=rows)

    def _tabulated(self, field: fem.Function, order: int) -> list[csr_matrix]:
        """The basis functions of a field's space at the points, (n, local nodes), and for ``order`` 1 their derivatives
        along the facets' edges from the first corner to each other one."""
        space, sides = field.function_space, self._boundary.sides
        dim, dofs = self._body.model.dim, cell_dofs(space)[self._boundary.cells]
        element = lagrange_element(dim, dofs.shape[1])
        corners = np.vstack([np.zeros(dim), np.eye(dim)])
        values = np.zeros((1 + order * (dim - 1), len(sides), len(self._points), dofs.shape[1]))
        for own in np.unique(sides, axis=0):
            table = element.tabulate(order, self._points @ corners[own])[..., 0]
            here = (sides == own).all(axis=1)
            values[0, here] = table[0]
            for k in range(1, len(values)):
                edge = corners[own[k]] - corners[own[0]]
                values[k, here] = np.einsum("d,dqn->qn", edge, table[1:])
        values[np.abs(values) < 1e-13] = 0.0
        columns = np.broadcast_to(dofs[:, None, :], values.shape[1:]).ravel()
        starts = np.arange(0, columns.size + 1, dofs.shape[1])
        shape, found = (len(starts) - 1, len(field.x.array) // dim), []
        for table in values:
            found.append(csr_matrix((table.ravel(), columns, starts), shape=shape, copy=True))
            found[-1].eliminate_zeros()  # in its own arrays
        return found


class TouchingPoints(PosePotential):
    """½ k Σ ⟨−g⟩² at n points of a rigid link, with the same parts as those of ``OneSided``.

    Attributes:
        compliances: 1/k, (n,).
        weights: one each, (n,).
        gaps: g, of the last ``update``, (n,).
    """

    def __init__(self, contact: Contact, linkage: Linkage) -> None:
        body = linkage.body_of(contact.link)
        self._drawn = np.array([in_dimension(p, linkage.dim) for p in contact.points])
        self._offsets, self._space = self._drawn - linkage.bodies[body].centre, linkage.joints.space
        assert contact.stiffness is not None, "rigid links have one"
        self.bodies, self._obstacle, self._stiffness = (body,), contact.obstacle, contact.stiffness
        self.weights = np.ones(len(self._drawn))
        self.compliances = self.weights / self._stiffness

    def value(self, poses):
        inside = np.maximum(-self._gaps_at(poses), 0.0)
        return 0.5 * self._stiffness * float(inside @ inside)

    def gradient(self, poses):
        self.update(poses)
        return self.forces(self._stiffness * np.maximum(-self.gaps, 0.0))

    def hessian(self, poses):
        self.update(poses)
        return self.stiffness(self._stiffness * (self.gaps < 0.0), self._stiffness * np.maximum(-self.gaps, 0.0))

    def update(self, poses: np.ndarray) -> None:
        """Takes the ``poses`` of all bodies."""
        self._pose, numbers = poses[self.bodies[0]], np.array([self._obstacle.numbers])
        self._places = self._where(poses)
        self.gaps = self._gap.value(self._places, numbers)[:, 0]
        self._normals = self._gap.gradient(self._places, numbers)[:, 0]
        self._motion = self._space.displacement_gradient(self._pose, self._offsets)
        self._slopes = np.einsum("ni,nia->na", self._normals, self._motion)

    def rates(self, motion: np.ndarray) -> np.ndarray:
        """∇g · δu at the points, (n,), from δz of the link's pose."""
        return self._slopes @ motion

    def forces(self, pressures: np.ndarray) -> np.ndarray:
        """−Σ p ∇g by the link's pose, the gradient of V where p are the ``pressures``."""
        return -pressures @ self._slopes

    def stiffness(self, stiffness: np.ndarray, pressures: np.ndarray) -> np.ndarray:
        """Σ D ∇g ⊗ ∇g − p ∇²g by the link's pose, ``stiffness`` is D, ``pressures`` p."""
        numbers = np.array([self._obstacle.numbers])
        curvature = self._gap.hessian(self._places, numbers, pressures[:, None])
        hessian = np.einsum("nij,nia,njb->ab", curvature, self._motion, self._motion)
        turn = self._space.displacement_hessian(self._pose, (pressures[:, None] * self._normals).T @ self._offsets)
        return (stiffness[:, None] * self._slopes).T @ self._slopes - hessian - turn

    @cached_property
    def _gap(self) -> SmoothFunction:
        return smooth_gap(self._obstacle, self._space.dim)

    def _where(self, poses: np.ndarray) -> np.ndarray:
        return self._drawn + self._space.displace(poses[self.bodies[0]], self._offsets)

    def _gaps_at(self, poses: np.ndarray) -> np.ndarray:
        return self._gap.value(self._where(poses), np.array([self._obstacle.numbers]))[:, 0]


def smooth_gap(obstacle: Obstacle, dim: int) -> SmoothFunction:
    """g at many points in ``dim`` dimensions, of their coordinates and the obstacle's numbers, with its derivatives."""
    x, numbers = sympy.symbols(f"x:{dim}"), sympy.symbols(f"c:{len(obstacle.numbers)}")
    return SmoothFunction([obstacle.gap(x, numbers, sympy.sqrt)], x, numbers, many=True)
