"""The fields of all flexible links on the fixed reference mesh: shape, displacement, pressure, parameters, growth.

With reference coordinates X₀ of straight cells, the bulge c that curves them along the drawn outline, the design d and
displacement u from the rest shape:

    X = X₀ + s,     s = c + d,     H = F − I = ∇u (∇X)⁻¹,     ∇X = I + ∇s.

Forms hold s alone: c does not change, so ∂/∂d = ∂/∂s.

Links whose strain-free state is not the one drawn have grown by F_p, and only F_e of F = F_e F_p strains the material.
Effects of each kind k stretch a link by λ, along e or in all directions:

    F_p = Π (I + g N),     g = σ (λ − 1),     N = e ⊗ e or I,
    H_e = F_e − I = H + Γ + H Γ,     I + Γ = F_p⁻¹ = Π (I − g / (1 + g) N),

and W counts per strain-free volume, det F_p times the drawn one: each factor is 1 + g or (1 + g)³. σ is the load factor
of effects. The factors commute, as at most one of a link has a direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from types import MappingProxyType
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from petsc4py import PETSc

from fenicsmech.compat import (
    add_ghosts,
    cell_dofs,
    cellwise_space,
    compile_expression,
    interpolation_points,
    owned_values,
    scalar_space,
    vector_space,
)
from fenicsmech.elasticity.models import ElasticModel, Quadrature
from fenicsmech.laws import Law
from fenicsmech.mechanism import Material


class PressureField:
    """p, of ``degree`` in local ``cells``, zero elsewhere.

    Attributes:
        unknown: whether each owned node is an unknown: those that only touch other cells are not, (owned,).
        count: number of unknowns on all ranks.
    """

    def __init__(self, mesh: dmesh.Mesh, degree: int, cells: np.ndarray) -> None:
        V = scalar_space(mesh, degree)
        self.p = fem.Function(V, name="pressure")
        marker = fem.Function(V)
        marker.x.array[cell_dofs(V)[cells]] = 1.0
        # a node may touch such a cell only on another rank
        add_ghosts(marker)
        self.unknown = owned_values(marker) > 0.0
        self.count = int(mesh.comm.allreduce(int(self.unknown.sum())))


@dataclass(frozen=True)
class Stretch:
    """The strain-free length of a link over the drawn one.

    Attributes:
        ratio: λ.
        along: e, a unit vector of the drawn link, (dim,); None for all directions.
    """

    ratio: float
    along: tuple[float, ...] | None


class _Factor:
    """One factor I + g N of F_p, from the ``stretches`` of links."""

    def __init__(self, fields: BodyFields, stretches: Sequence[Stretch | None], load_factor: Any) -> None:
        dim, directed = fields.model.dim, {stretch.along is not None for stretch in stretches if stretch is not None}
        every = [stretch or Stretch(1.0, None) for stretch in stretches]
        self.excess = fields.cellwise([stretch.ratio - 1.0 for stretch in every])
        self._grown, self._tensor = load_factor * self.excess, ufl.Identity(dim)
        # of the depth: planar links that grow in all directions do so across it, too
        self.across = self._grown if False in directed else ufl.as_ufl(0)
        if True in directed:
            tensors = np.array([np.eye(dim) if s.along is None else np.outer(s.along, s.along) for s in every])
            parts = {(i, j): fields.cellwise(tensors[:, i, j]) for i in range(dim) for j in range(i, dim)}
            self._tensor = ufl.as_matrix([[parts[min(i, j), max(i, j)] for j in range(dim)] for i in range(dim)])
            self.across = self.across * fields.cellwise([float(stretch.along is None) for stretch in every])

    @property
    def inverse_excess(self):
        """Its inverse less I."""
        return -self._grown / (1 + self._grown) * self._tensor

    @property
    def volume(self):
        """Its determinant, the growth of depth included."""
        return (1 + self._grown) * (1 + self.across) ** 2


class Growth:
    """F_p, one value per cell, in UFL; only cells that are free to deform grow.

    Args:
        fields: of the body.
        stretches: of each link by kind of effect, None where it has none.
        link: index of the link of each local cell, −1 where it cannot deform, (cells,).

    Attributes:
        load_factor: σ, with respect to which forms can be differentiated.
        excess: λ − 1 by kind of effect.
    """

    def __init__(self, fields: BodyFields, stretches: Mapping[str, Sequence[Stretch | None]], link: np.ndarray) -> None:
        self._model, self._link = fields.model, link
        self.load_factor = ufl.variable(fields.load_factor)
        self._factors = [_Factor(fields, own, self.load_factor) for own in stretches.values()]
        self.excess = {kind: factor.excess for kind, factor in zip(stretches, self._factors, strict=True)}
        for excess in self.excess.values():
            excess.x.array[np.flatnonzero(link < 0)] = 0.0

    def stretch(self, kind: str, link: int, excess: float) -> None:
        """Gives a link λ − 1 = ``excess`` by a kind of effect. Local."""
        self.excess[kind].x.array[np.flatnonzero(self._link == link)] = excess

    def elastic(self, H):
        """H_e, in the form that ``ElasticModel.strain`` takes."""
        return self._model.grown(_composed([H, self._inverse_excess]), -self._across / (1 + self._across))

    @property
    def inverse(self):
        """F_p⁻¹ on the mesh."""
        return ufl.Identity(self._model.dim) + self._inverse_excess

    @property
    def _inverse_excess(self):
        """F_p⁻¹ − I on the mesh."""
        return _composed([factor.inverse_excess for factor in self._factors])

    @property
    def volume(self):
        """det F_p, the growth of depth included."""
        return prod(factor.volume for factor in self._factors)

    @property
    def depth(self):
        """Strain-free depth over the drawn one, in the plane."""
        return 1 + self._across

    @property
    def _across(self):
        """Strain-free depth over the drawn one, less 1, in the plane."""
        return _composed([factor.across for factor in self._factors])


def _composed(excesses: Sequence[Any]) -> Any:
    """Π (I + A) − I of tensors or numbers A, without loss of digits where they are small."""
    total, *others = excesses
    for other in others:
        total = total + other + ufl.dot(total, other)
    return total


@dataclass(frozen=True)
class Term:
    """The cells of one kind of law, all in the u–p formulation or none; parameters of the law are fields."""

    law: Law
    mixed: bool
    dx: ufl.Measure
    cells: np.ndarray


class BodyFields:
    """State, shape and materials of an elastic body.

    Args:
        mesh: reference mesh.
        link: index of the link of each local cell, (cells,).
        free: whether each local cell can deform (False inside interfaces), (cells,).
        materials: material of each link.
        depths: depth of each link, used by planar models.
        model: 3D, whole or half, plane strain or plane stress.
        order: degree of the displacement field.
        quadrature: explicit degree; never UFL's estimate.
        effects: energies in addition to the elastic one, as functions of this body.
        stretches: of the strain-free state of each link by kind of effect, None where it does not change it.
        bulge: c, by which curved cells differ from straight ones; None if all are straight.
        mixed: whether each link is in the u–p formulation.

    Attributes:
        u: displacement field, vector P_order.
        shape: s = c + d, vector, P2, or P1 with linear displacements, which know no c.
        bulge: c, in the space of s, or None.
        pressure: of the links in the u–p formulation, P_(order − 1); None if no link is.
        parameters: of the links' laws by name, each with one value per cell; changing them needs no compiling.
        depth: one value per cell.
        numbers: what energies depend on of the numbers of links: ``parameters``, in the plane ``depth``, the
            ``excess`` of growth, and what effects add.
        load_factor: of the effects.
        growth: of the strain-free state; None if all links are as drawn.
        dx: measure of all cells, interfaces included.
        terms: the cells that can deform, by kind of law.
    """

    def __init__(
        self,
        mesh: dmesh.Mesh,
        *,
        link: np.ndarray,
        free: np.ndarray,
        materials: Sequence[Material],
        depths: Sequence[float],
        model: ElasticModel,
        order: int,
        quadrature: Quadrature,
        effects: Sequence[Callable[[Any], ufl.Form | None]] = (),
        stretches: Mapping[str, Sequence[Stretch | None]] = MappingProxyType({}),
        bulge: fem.Function | None = None,
        mixed: Sequence[bool] = (),
    ) -> None:
        self.mesh, self.model, self.order, self.bulge, self._link = mesh, model, order, bulge, link
        self.effects = tuple(effects)
        self.u = fem.Function(vector_space(mesh, order), name="displacement")
        self.shape = fem.Function(vector_space(mesh, min(order, 2)), name="shape")
        self.reshape(np.zeros_like(self.shape.x.array))
        numbers = [material.law.parameters for material in materials]
        self.parameters = {
            name: self.cellwise([known.get(name, 0.0) for known in numbers])
            for name in dict.fromkeys(name for known in numbers for name in known)
        }
        self.depth = self.cellwise(depths)
        self.numbers = self.parameters | ({"depth": self.depth} if model.dim == 2 else {})
        self.load_factor = fem.Constant(mesh, PETSc.ScalarType(1.0))
        mixed = tuple(mixed) or (False,) * len(materials)
        self.pressure = None
        if any(mixed):
            self.pressure = PressureField(mesh, order - 1, np.flatnonzero(free & np.array(mixed)[link]))
        self.growth = Growth(self, stretches, np.where(free, link, -1)) if stretches else None
        self.numbers |= {} if self.growth is None else self.growth.excess

        kinds = [(str(type(m.law)), *m.law.parameters, own) for m, own in zip(materials, mixed, strict=True)]
        known = sorted(set(kinds), key=str)
        kind_of_cell = np.array([known.index(kind) for kind in kinds])[link]
        cells = np.flatnonzero(free).astype(np.int32)
        tags = dmesh.meshtags(mesh, mesh.topology.dim, cells, kind_of_cell[cells].astype(np.int32))
        self.dx = ufl.Measure("dx", domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": quadrature.degree})
        self.terms = []
        for tag, kind in enumerate(known):
            first = kinds.index(kind)
            law = materials[first].law.with_parameters(self.parameters)
            where = np.flatnonzero(kind_of_cell == tag).astype(np.int32)
            self.terms.append(Term(law, mixed[first], self.dx(tag), where))

    def cellwise(self, per_link: Sequence[float] | np.ndarray) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        function = fem.Function(cellwise_space(self.mesh))
        function.x.array[: len(self._link)] = np.asarray(per_link, dtype=float)[self._link]
        return function

    def gradient(self, field):
        """H = ∇field (∇X)⁻¹, the gradient of a field on the rest shape, symbolic."""
        return ufl.dot(ufl.grad(field), ufl.inv(self.rest_gradient))

    @property
    def drawn_gradient(self):
        """I + ∇c, symbolic."""
        identity = ufl.Identity(self.model.dim)
        return identity if self.bulge is None else identity + ufl.grad(self.bulge)

    @property
    def rest_gradient(self):
        """∇X = I + ∇s, symbolic."""
        return ufl.Identity(self.model.dim) + ufl.grad(self.shape)

    @property
    def rest(self):
        """X = X₀ + s, symbolic."""
        return ufl.SpatialCoordinate(self.mesh) + self.shape

    @property
    def drawn_shape(self) -> np.ndarray:
        """c at this rank's nodes of s, ghosts last, flat."""
        return np.zeros_like(self.shape.x.array) if self.bulge is None else self.bulge.x.array

    @property
    def design(self) -> np.ndarray:
        """d = s − c at this rank's nodes of s, ghosts last, flat."""
        return self.shape.x.array - self.drawn_shape

    def reshape(self, design: np.ndarray) -> None:
        """Takes values of d as those of ``design``."""
        self.shape.x.array[:] = self.drawn_shape + design

    @cached_property
    def drawn_nodes(self) -> np.ndarray:
        """X₀ + c at this rank's nodes of u, ghosts last, (nodes, dim)."""
        V, dim = self.u.function_space, self.model.dim
        nodes = V.tabulate_dof_coordinates()[:, :dim]
        if self.bulge is None:
            return nodes
        bulge = fem.Function(V)
        bulge.interpolate(self.bulge)
        return nodes + bulge.x.array.reshape(-1, dim)

    @property
    def fields(self) -> list[fem.Function]:
        """u, and p where links have one."""
        return [self.u] if self.pressure is None else [self.u, self.pressure.p]

    def values(self) -> np.ndarray:
        """This rank's owned values of u, then those of p, flat."""
        return np.concatenate([owned_values(field) for field in self.fields])

    def split(self, values: np.ndarray) -> list[np.ndarray]:
        """Owned values as in ``values``, field by field."""
        ends = np.cumsum([len(owned_values(field)) for field in self.fields])
        return np.split(values, ends[:-1])

    def take(self, values: np.ndarray) -> None:
        """Sets the owned values of u, then of p, flat; ghosts follow in ``update``."""
        for field, own in zip(self.fields, self.split(values), strict=True):
            owned_values(field)[:] = own

    def update(self) -> None:
        """Makes ghost values of u and p agree with their owners."""
        for field in self.fields:
            field.x.scatter_forward()

    def carried(self, change: np.ndarray) -> np.ndarray:
        """Displacements after the rest shape changes by δ, every node's change carried along by the deformation:

            x(X + δ) ≈ x(X) + F δ,     u ← u + H δ,

        a first guess of the displacement from the new rest shape. Where links only move rigidly it is exact. ``change``
        are this rank's values of δ, the result its values of u, with ghosts, flat.
        """
        moved, by, expression = self._carrying
        by.x.array[:] = change
        moved.interpolate(expression)
        return self.u.x.array + moved.x.array

    @cached_property
    def _carrying(self) -> tuple[fem.Function, fem.Function, fem.Expression]:
        """A field for H δ, one for δ, and H δ at the nodes of u, compiled."""
        V, change = self.u.function_space, fem.Function(self.shape.function_space)
        moved = ufl.dot(self.gradient(self.u), change)
        return fem.Function(V), change, compile_expression(moved, interpolation_points(V), self.mesh.comm)
