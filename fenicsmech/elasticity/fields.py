"""The fields of all flexible links on the fixed reference mesh: shape, displacement, pressure, parameters, growth.

With reference coordinates X₀ of straight cells, the bulge c that curves them along the drawn outline, design d, rest
shape X = X₀ + c + d and displacement u from the rest shape:

    H = F − I = ∇u (∇X)⁻¹,     ∇X = I + ∇c + ∇d.

Links whose strain-free state is not the one drawn have grown by F_p, and only F_e of F = F_e F_p strains the material:

    F_p = I + s (λ − 1) N,     N = e ⊗ e or I,
    H_e = F_e − I = H + Γ + H Γ,     Γ = F_p⁻¹ − I = −s (λ − 1) / (1 + s (λ − 1)) N,

and W counts per strain-free volume, det F_p times the drawn one: (1 + s (λ − 1)) to the power of 1 or 3. s is the load
factor of effects.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from petsc4py import PETSc

from fenicsmech.compat import cellwise_space, compile_expression, interpolation_points, owned_values, vector_space
from fenicsmech.elasticity.formulation import PressureField
from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.mechanism import Material


class BodyFields:
    """State, shape and materials of an elastic body.

    Args:
        mesh: reference mesh.
        link: index of the link of each local cell, (cells,).
        materials: material of each link.
        depths: depth of each link, used by planar models.
        model: 3D, whole or half, plane strain or plane stress.
        order: degree of the displacement field.
        bulge: c, by which curved cells differ from straight ones; None if all are straight.
        pressed: local cells in the u–p formulation; None if there are none on any rank.

    Attributes:
        u: displacement field, vector P_order.
        d: design field, vector P1.
        bulge: c, vector P2, or None.
        pressure: of the links in the u–p formulation, P_(order − 1); None if no link is.
        parameters: of the links' laws by name, each with one value per cell; changing them needs no compiling.
        depth: one value per cell.
        load_factor: of the effects.
    """

    def __init__(
        self,
        mesh: dmesh.Mesh,
        *,
        link: np.ndarray,
        materials: Sequence[Material],
        depths: Sequence[float],
        model: ElasticModel,
        order: int,
        bulge: fem.Function | None,
        pressed: np.ndarray | None,
    ) -> None:
        self.mesh, self.model, self.order, self.bulge, self._link = mesh, model, order, bulge, link
        self.u = fem.Function(vector_space(mesh, order), name="displacement")
        self.d = fem.Function(vector_space(mesh, 1), name="design")
        numbers = [material.law.parameters for material in materials]
        self.parameters = {
            name: self.cellwise([known.get(name, 0.0) for known in numbers])
            for name in dict.fromkeys(name for known in numbers for name in known)
        }
        self.depth = self.cellwise(depths)
        self.pressure = None if pressed is None else PressureField(mesh, order - 1, pressed)
        self.load_factor = fem.Constant(mesh, PETSc.ScalarType(1.0))

    def cellwise(self, per_link: Sequence[float] | np.ndarray) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        function = fem.Function(cellwise_space(self.mesh))
        function.x.array[: len(self._link)] = np.asarray(per_link, dtype=float)[self._link]
        return function

    def gradient(self, field):
        """H = ∇field (∇X)⁻¹, the gradient of a field on the rest shape, symbolic."""
        return ufl.dot(ufl.grad(field), ufl.inv(self.rest_gradient))

    @property
    def rest_gradient(self):
        """∇X = I + ∇c + ∇d, symbolic."""
        gradient = ufl.Identity(self.model.dim) + ufl.grad(self.d)
        return gradient if self.bulge is None else gradient + ufl.grad(self.bulge)

    @property
    def rest(self):
        """X = X₀ + c + d, symbolic."""
        rest = ufl.SpatialCoordinate(self.mesh) + self.d
        return rest if self.bulge is None else rest + self.bulge

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

    def take(self, values: np.ndarray) -> None:
        """Sets the owned values of u, and of p behind them, flat; ghosts follow in ``update``."""
        displacements, *pressures = self.split(values)
        owned_values(self.u)[:] = displacements
        if self.pressure is not None:
            owned_values(self.pressure.p)[:] = pressures[0]

    def values(self) -> np.ndarray:
        """This rank's owned values of u, and of p behind them, flat."""
        return np.concatenate([owned_values(field) for field in self.fields])

    def split(self, values: np.ndarray) -> list[np.ndarray]:
        """Owned values as in ``values``, field by field."""
        ends = np.cumsum([len(owned_values(field)) for field in self.fields])
        return np.split(values, ends[:-1])

    @property
    def fields(self) -> list[fem.Function]:
        """u, and p where links have one."""
        return [self.u] if self.pressure is None else [self.u, self.pressure.p]

    def carried(self, change: np.ndarray) -> np.ndarray:
        """Displacements after the rest shape changes by δ, every node's change carried along by the deformation:

            x(X + δ) ≈ x(X) + F δ,     u ← u + H δ,

        a first guess of the displacement from the new rest shape. Where links only move rigidly it is exact.

        Args:
            change: δ, this rank's P1 values with ghosts, flat.

        Returns:
            This rank's values of u, ghosts last, flat.
        """
        self._change.x.array[:] = change
        self._carried.interpolate(self._carrying)
        return self.u.x.array + self._carried.x.array

    def update(self) -> None:
        """Makes ghost values of u and p agree with their owners."""
        for field in self.fields:
            field.x.scatter_forward()

    @cached_property
    def _change(self) -> fem.Function:
        return fem.Function(self.d.function_space, name="change_of_design")

    @cached_property
    def _carried(self) -> fem.Function:
        return fem.Function(self.u.function_space, name="carried_change")

    @cached_property
    def _carrying(self) -> fem.Expression:
        """H δ at the nodes of u."""
        V = self.u.function_space
        return compile_expression(ufl.dot(self.gradient(self.u), self._change), interpolation_points(V), self.mesh.comm)


@dataclass(frozen=True)
class Stretch:
    """The strain-free length of a link over the drawn one.

    Attributes:
        ratio: λ.
        along: e, a unit vector of the drawn link, (dim,); None for all directions.
    """

    ratio: float
    along: tuple[float, ...] | None


class Growth:
    """F_p, one value per cell.

    Args:
        stretches: of each link; None where it is as drawn.
        cellwise: makes a field with one value per cell from one value per link, (links,).
        free: whether each local cell can deform; the others do not grow, (cells,).
        dim: of the model; planar ones are free to grow in depth.
        load_factor: s.
    """

    def __init__(
        self,
        stretches: Sequence[Stretch | None],
        cellwise: Callable[[Sequence[float] | np.ndarray], fem.Function],
        *,
        free: np.ndarray,
        dim: int,
        load_factor: fem.Constant,
    ) -> None:
        every = [stretch or Stretch(1.0, None) for stretch in stretches]
        self.load_factor = ufl.variable(load_factor)
        self._excess = cellwise([stretch.ratio - 1.0 for stretch in every])
        self._excess.x.array[np.flatnonzero(~free)] = 0.0
        self._power = cellwise([3.0 if stretch.along is None else 1.0 for stretch in every])
        tensors = np.array([np.eye(dim) if s.along is None else np.outer(s.along, s.along) for s in every])
        parts = {(i, j): cellwise(tensors[:, i, j]) for i in range(dim) for j in range(i, dim)}
        self._tensor = ufl.as_matrix([[parts[min(i, j), max(i, j)] for j in range(dim)] for i in range(dim)])

    def elastic(self, H):
        """H_e in UFL."""
        grown = self.load_factor * self._excess
        inverse = -grown / (1 + grown) * self._tensor
        return H + inverse + ufl.dot(H, inverse)

    @property
    def volume(self):
        """det F_p in UFL, the growth of depth included."""
        return (1 + self.load_factor * self._excess) ** self._power
