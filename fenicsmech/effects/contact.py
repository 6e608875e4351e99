"""Frictionless contact with rigid obstacles, by a penalty on penetration.

    V = Σ_links ∫ ½ κ ⟨−g(x)⟩² dA + Σ_points ½ k ⟨−g(x)⟩²,     x = X₀ + d + u,

g the signed gap and ⟨·⟩ the positive part. The pressure κ ⟨−g⟩ pushes a link out along ∇g. V is once continuously
differentiable, its second derivative jumps where points come into contact: Newton's method is semismooth there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.checks import points, positive
from fenicsmech.compat import assemble_vector, compile_form
from fenicsmech.effects.energies import LinkFields, PosePotential
from fenicsmech.effects.faces import Faces
from fenicsmech.effects.obstacles import Obstacle
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import RigidSpace
from fenicsmech.mechanism import Effect, FlexibleLink, Link, RigidLink, in_dimension


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

    Penetration falls as 1 / stiffness, while Newton's method takes more iterations where contact changes. Obstacles
    act once the motors have moved: a configuration whose rigid assembly is on the far side of an obstacle stays there.
    Afterwards flexible links cannot slip through a cylinder: states with a penetration of a quarter of its radius are
    rejected. In space a pressed edge is also pressed on its flat faces inside the obstacle, with an error of
    the order of penetration over depth.

    Raises:
        DescriptionError: a number makes no sense, or what a link of this kind needs is missing.
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
            object.__setattr__(self, "stiffness", positive(f"stiffness of {part}", self.stiffness))
        object.__setattr__(self, "points", points(f"points of {part}", self.points, least=0, dimensions=(2, 3)))
        if not isinstance(self.obstacle, Obstacle):
            raise DescriptionError(part, f"{self.obstacle!r} is not an obstacle", "Give a Cylinder(…) or HalfPlane(…)")
        match self.link:
            case RigidLink() if not self.points or self.stiffness is None:
                raise DescriptionError(
                    part, "a rigid link touches at points only", "Give points=… and their stiffness=…"
                )
            case FlexibleLink() if self.points:
                raise DescriptionError(part, "a flexible link touches anywhere", "Leave points out")

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        self.obstacle.check(dim)

    def explain(self):
        return f"frictionless contact of {self.link.name} with {self.obstacle}"

    @property
    def faces(self):
        return (Faces(self.link),) if isinstance(self.link, FlexibleLink) else ()

    def link_energy(self, fields):
        if not isinstance(self.link, FlexibleLink):
            return None
        gap = self.obstacle.gap_form(fields.position, fields.mesh)
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
        # ten times more costs slender links several times the iterations
        return fem.Constant(fields.mesh, 0.1 * link.material.law.E) / height

    def pose_potentials(self, linkage):
        if not isinstance(self.link, RigidLink):
            return []
        body = linkage.body_of(self.link)
        drawn = np.array([in_dimension(p, linkage.dim) for p in self.points])
        return [_Points(self, body, drawn, np.array(linkage.bodies[body].centre), linkage.joints.space)]


class _Points(PosePotential):
    """½ k Σ ⟨−g⟩² at points of one body."""

    def __init__(self, contact: Contact, body: int, drawn: np.ndarray, centre: np.ndarray, space: RigidSpace) -> None:
        self.bodies, self._drawn, self._offsets, self._space = (body,), drawn, drawn - centre, space
        self._obstacle, self._stiffness = contact.obstacle, contact.stiffness

    def value(self, poses):
        _, inside, _ = self._touching(poses)
        return 0.5 * self._stiffness * float(inside @ inside)

    def gradient(self, poses):
        where, inside, offsets = self._touching(poses)
        slope = np.einsum("ni,nia->na", self._obstacle.gap_gradient(where), self._motion(poses, offsets))
        return -self._stiffness * inside @ slope

    def hessian(self, poses):
        where, inside, offsets = self._touching(poses)
        normal, motion = self._obstacle.gap_gradient(where), self._motion(poses, offsets)
        slope = np.einsum("ni,nia->na", normal, motion)
        bend = np.einsum("n,nij,nia,njb->ab", inside, self._obstacle.gap_hessian(where), motion, motion)
        turn = self._space.displacement_hessian(poses[self.bodies[0]], (inside[:, None] * normal).T @ offsets)
        return self._stiffness * (slope.T @ slope - bend - turn)

    def _touching(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions of the points inside the obstacle, −g, and their offsets from the body's centre."""
        where = self._drawn + self._space.displace(poses[self.bodies[0]], self._offsets)
        gap = self._obstacle.gap(where)
        inside = gap < 0.0
        return where[inside], -gap[inside], self._offsets[inside]

    def _motion(self, poses: np.ndarray, offsets: np.ndarray) -> np.ndarray:
        return self._space.displacement_gradient(poses[self.bodies[0]], offsets)


class ContactGauge:
    """Measures the contact of a flexible link in the state that its fields hold.

    Args:
        contact: of a flexible link.
        fields: of a simulation whose scene lists ``contact``.
    """

    def __init__(self, contact: Contact, fields: LinkFields) -> None:
        self._obstacle, self._fields = contact.obstacle, fields
        self._form = compile_form(-ufl.derivative(contact.link_energy(fields), fields.u))
        (faces,) = contact.faces
        V = fields.u.function_space
        self._design, self._forces = fem.Function(V), fem.Function(V)
        self._nodes = fem.locate_dofs_topological(V, fields.dim - 1, fields.boundaries[faces].facets)

    def force(self) -> np.ndarray:
        """The force of the obstacle on the link, (dim,)."""
        # shape functions sum up to one: so do nodal forces to the resultant
        force = assemble_vector(self._form, self._forces).reshape(-1, self._fields.dim).sum(axis=0)
        return self._fields.mesh.comm.allreduce(force, op=MPI.SUM)

    def gap(self) -> float:
        """The smallest gap at nodes of the link's boundary; where negative, the largest penetration."""
        fields = self._fields
        self._design.interpolate(fields.body.d)
        moved = fields.body.drawn_nodes + (self._design.x.array + fields.u.x.array).reshape(-1, fields.dim)
        gaps = self._obstacle.gap(moved[self._nodes])
        return fields.mesh.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)
