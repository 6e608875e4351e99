"""Energy, residual, tangent and stress of all flexible links on the fixed reference mesh.

With reference coordinates X₀ of straight cells, the bulge c that curves them along the drawn outline, design d, rest
shape X = X₀ + c + d and displacement u from the rest shape:

    H = F − I = ∇u (∇X)⁻¹,     E(u, d) = ∫ W(H) det(∇X) b dX₀,     ∇X = I + ∇c + ∇d,

b the depth of a planar link; in space 1, or 2 where only one half is meshed. Interface cells move rigidly and store no
energy: they are left out. Where links have a pressure p of their own, Π(H, p) of ``mixed`` takes the place of W, and E
has a saddle there: a minimum in u, a maximum in p.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from petsc4py import PETSc

from fenicsmech.compat import (
    assemble_vector,
    cellwise_space,
    compile_expression,
    compile_form,
    evaluate_expression,
    owned_values,
    vector_space,
)
from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.growth import UNSTRETCHED, Growth, Stretch
from fenicsmech.elasticity.mixed import mixed_density
from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.elasticity.pressure import PressureField
from fenicsmech.elasticity.strain import Moduli
from fenicsmech.elasticity.stress import cauchy_stress, von_mises
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import EnergyLaw, Material


@dataclass(frozen=True)
class Quadrature:
    """Degree of the quadrature, per order of the displacement field.

    Raises:
        DescriptionError: it is not a whole number of at least 1.
    """

    degree: int

    def __post_init__(self) -> None:
        if not isinstance(self.degree, Integral) or self.degree < 1:
            raise DescriptionError("quadrature", f"degree {self.degree!r}", "Give a whole number of at least 1")

    @staticmethod
    def for_order(order: int, dim: int) -> Quadrature:
        """The cheapest degree whose error lies well below the discretisation error (measured)."""
        return Quadrature({1: 1, 2: 3 if dim == 3 else 4}.get(order, 2 * order))


@dataclass(frozen=True)
class _Term:
    """The cells of one law, all with a pressure of their own or all without."""

    law: EnergyLaw
    mixed: bool
    dx: ufl.Measure


class ElasticBody:
    """The flexible links as one hyperelastic body.

    Args:
        mesh: reference mesh.
        link: index of the link of each local cell, (cells,).
        free: whether each local cell can deform (False inside interfaces), (cells,).
        materials: material of each link.
        depths: depth of each link, used by planar models.
        model: 3D, whole or half, plane strain or plane stress.
        order: degree of the displacement field.
        quadrature: explicit degree; never UFL's estimate.
        effects: energies beside the elastic one, as functions of this body; none costs nothing.
        stretches: of the strain-free state of each link, None where it is as drawn; none costs nothing.
        bulge: c, by which curved cells differ from straight ones; None if all are straight.
        with_pressure: whether each link has a pressure of its own; none costs nothing.

    Attributes:
        u: displacement field, vector P_order.
        d: design field, vector P1.
        bulge: c, vector P2, or None.
        pressure: of the links that have one of their own, P_(order − 1); None if no link has.
        youngs_modulus, poissons_ratio: per cell.
        dx: measure of all cells, interfaces included.
        share: how much of the effects acts.
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
        effects: Sequence[Callable[[ElasticBody], ufl.Form | None]] = (),
        stretches: Sequence[Stretch | None] = (),
        bulge: fem.Function | None = None,
        with_pressure: Sequence[bool] = (),
    ) -> None:
        self.mesh, self.model, self.order = mesh, model, order
        self.u = fem.Function(vector_space(mesh, order), name="displacement")
        self.d = fem.Function(vector_space(mesh, 1), name="design")
        self.bulge = bulge
        self._link, self._effects = link, tuple(effects)
        self.youngs_modulus = self.cellwise([m.youngs_modulus for m in materials])
        self.poissons_ratio = self.cellwise([m.poissons_ratio for m in materials])
        self._depth = self.cellwise(depths)
        mixed = tuple(with_pressure) or (False,) * len(materials)
        kinds = [(m.law, own) for m, own in zip(materials, mixed, strict=True)]
        terms = sorted(set(kinds), key=repr)
        term_of_cell = np.array([terms.index(kind) for kind in kinds])[link]
        cells = np.flatnonzero(free).astype(np.int32)
        self.pressure = PressureField(mesh, order - 1, cells[np.array(mixed)[link[cells]]]) if any(mixed) else None
        tags = dmesh.meshtags(mesh, mesh.topology.dim, cells, term_of_cell[cells].astype(np.int32))
        measure = ufl.Measure("dx", domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": quadrature.degree})
        self.dx = measure
        self.share = fem.Constant(mesh, PETSc.ScalarType(1.0))
        self._growth = None
        if any(stretches):
            known = [stretch or UNSTRETCHED for stretch in stretches]
            self._growth = Growth(known, self.cellwise, free=free, dim=model.dim, share=self.share)
        self._terms = [_Term(law, own, measure(tag)) for tag, (law, own) in enumerate(terms)]
        self._term_cells = [np.flatnonzero(term_of_cell == tag).astype(np.int32) for tag in range(len(terms))]

    @cached_property
    def energy_ufl(self) -> ufl.Form:
        """E(u, d), the energy of effects included, symbolic; everything else is a derivative of it."""
        if self.effects_ufl is None:
            return self._strain_ufl
        return self._strain_ufl + self.share * self.effects_ufl

    @cached_property
    def effects_ufl(self) -> ufl.Form | None:
        """The energy of all effects, None if there are none."""
        terms = [term for effect in self._effects if (term := effect(self)) is not None]
        return sum(terms[1:], start=terms[0]) if terms else None

    @cached_property
    def _strain_ufl(self) -> ufl.Form:
        volume = self._volume
        terms = [self._density(term, self._strain) * volume * term.dx for term in self._terms]
        return sum(terms[1:], start=terms[0])

    @cached_property
    def residual_ufl(self) -> ufl.Form:
        """∂E/∂u in direction of a test function."""
        return ufl.derivative(self.energy_ufl, self.u)

    @cached_property
    def energy_form(self):
        return compile_form(self.energy_ufl)

    @cached_property
    def residual_form(self):
        return compile_form(self.residual_ufl)

    @cached_property
    def tangent_form(self):
        return compile_form(ufl.derivative(self.residual_ufl, self.u))

    @cached_property
    def tangent_blocks(self) -> list[list]:
        """∂²E/∂(u, p)², where links have a pressure of their own."""
        by_p, u, p = self._pressure_ufl, self.u, self.pressure.p
        return [
            [self.tangent_form, compile_form(ufl.derivative(self.residual_ufl, p))],
            [compile_form(ufl.derivative(by_p, u)), compile_form(ufl.derivative(by_p, p))],
        ]

    def compile(self) -> None:
        """Compiles what equilibria need (collective)."""
        _ = self.energy_form, self.residual_form, self.tangent_form
        if self.pressure is not None:
            _ = self._pressure_form, self.tangent_blocks

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

    def free(self, degree: int) -> ufl.Measure:
        """The measure of all cells that can deform, with quadrature of ``degree``."""
        metadata = {"quadrature_degree": degree}
        first, *others = [term.dx(metadata=metadata) for term in self._terms]
        return sum(others, start=first)

    def contraction_energy(self, weight, *, degree: int) -> ufl.Form:
        """½ ∫ w E (F₃₃ − 1)² dV with a scalar field w, of links in plane stress."""
        terms = []
        for term in self._terms:
            contraction = self.model.contraction(term.law, self._strain, self._moduli)
            density_ = 0.5 * weight * self.youngs_modulus * contraction**2
            terms.append(density_ * self._volume * term.dx(metadata={"quadrature_degree": degree}))
        return sum(terms[1:], start=terms[0])

    def densities(self, H) -> list[tuple]:
        """Elastic energy per volume of the mesh at the gradient H on the rest shape, and where it holds, per law."""
        elastic = H if self._growth is None else self._growth.elastic(H)
        return [(self._density(term, elastic) * self._volume, term.dx) for term in self._terms]

    def curvature(self, A, B, *, degree: int) -> ufl.Form:
        """∫ A : ∂²W/∂F∂F : B dV at the present fields, for gradients A, B on the rest shape."""
        i, j, k, m = ufl.indices(4)
        H = ufl.variable(self.gradient(self.u))
        elastic = H if self._growth is None else self._growth.elastic(H)
        terms = []
        for term in self._terms:
            C = ufl.diff(ufl.diff(self._density(term, elastic), H), H)
            product = A[i, j] * C[i, j, k, m] * B[k, m] * self._volume
            terms.append(product * term.dx(metadata={"quadrature_degree": degree}))
        return sum(terms[1:], start=terms[0])

    def energy(self) -> float:
        """E at the current fields, of the whole mesh (collective); NaN where J ≤ 0."""
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(self.energy_form)))

    def strain_energy(self) -> float:
        """The elastic part of E (collective)."""
        form = self.energy_form if self.effects_ufl is None else self._strain_form
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(form)))

    @property
    def shares(self) -> bool:
        """Whether the energy depends on the share."""
        return self.effects_ufl is not None or self._growth is not None

    def share_residuals(self) -> np.ndarray:
        """The derivative of ``residuals`` by the share (collective)."""
        by_u = self.assembled(self._share_form)
        if self.pressure is None:
            return by_u
        by_p = np.zeros(len(self.pressure.unknown))
        if self._growth is not None:
            by_p = assemble_vector(self._pressure_share_form, self._sums[1])
        return np.concatenate([by_u, by_p])

    def residuals(self) -> np.ndarray:
        """∂E/∂(u, p) at this rank's owned values, those of u first, flat (collective)."""
        by_u = self.assembled(self.residual_form)
        if self.pressure is None:
            return by_u
        return np.concatenate([by_u, assemble_vector(self._pressure_form, self._sums[1])])

    def assembled(self, form) -> np.ndarray:
        """A compiled linear form on the space of u, this rank's owned values, flat (collective)."""
        return assemble_vector(form, self._sums[0]).copy()

    def create_tangent(self) -> PETSc.Mat:
        """An empty matrix for ``tangent``: per rank, the owned values of u, then those of p (collective)."""
        if self.pressure is None:
            return fem.petsc.create_matrix(self.tangent_form)
        return fem.petsc.create_matrix_block(self.tangent_blocks)

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Adds ∂²E/∂(u, p)² into ``matrix`` (collective; leaves it unassembled)."""
        if self.pressure is None:
            fem.petsc.assemble_matrix(matrix, self.tangent_form)
        else:
            fem.petsc.assemble_matrix_block(matrix, self.tangent_blocks)

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

    @cached_property
    def pressure_unit(self) -> float:
        """√(n / ∫ dV/μ) over the n unknowns of p, in whose units p is as large as u in an energy (collective).

        Volumes resist with p² / μ per volume once shear has done what it can.
        """
        first, *others = [self._volume / self._moduli.mu * term.dx for term in self._terms if term.mixed]
        volume = fem.assemble_scalar(compile_form(sum(others, start=first)))
        return float(np.sqrt(self.pressure.count / self.mesh.comm.allreduce(volume)))

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
        """Makes ghost values of u and p agree with their owners (collective)."""
        for field in self.fields:
            field.x.scatter_forward()

    def von_mises(self) -> np.ndarray:
        """Von Mises stress at the midpoint of each local cell, (cells,)."""
        values = np.zeros(sum(map(len, self._term_cells)))
        for expression, cells in zip(self._stresses, self._term_cells, strict=True):
            values[cells] = evaluate_expression(expression, self.mesh, cells)[:, 0]
        return values

    @cached_property
    def _stresses(self) -> list[fem.Expression]:
        """The compiled von Mises stress at cell midpoints, per law."""
        midpoint = np.full((1, self.model.dim), 1.0 / (self.model.dim + 1))
        # no pressure in it: von Mises stress does not see any
        stresses = [von_mises(cauchy_stress(self.model, term.law, self._strain, self._moduli)) for term in self._terms]
        return [compile_expression(stress, midpoint, self.mesh.comm) for stress in stresses]

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
        return compile_expression(
            ufl.dot(self.gradient(self.u), self._change), V.element.interpolation_points(), self.mesh.comm
        )

    @property
    def _moduli(self) -> Moduli:
        return Moduli(self.youngs_modulus, self.poissons_ratio)

    @property
    def _strain(self):
        """H of the displacement; its elastic part where links have grown."""
        H = self.gradient(self.u)
        return H if self._growth is None else self._growth.elastic(H)

    def _density(self, term: _Term, H):
        """W, or Π, of the elastic strain H."""
        strain = self.model.strain(term.law, H, self._moduli)
        if term.mixed:
            return mixed_density(term.law, strain, self._moduli, self.pressure.p)
        return density(term.law, strain, self._moduli)

    @property
    def _volume(self):
        """Strain-free volume per volume of the mesh."""
        volume = ufl.det(self.rest_gradient) * self.model.multiplier(self._depth)
        return volume if self._growth is None else volume * self._growth.volume

    @property
    def _pressure_ufl(self) -> ufl.Form:
        """∂E/∂p in direction of a test function."""
        return ufl.derivative(self._strain_ufl, self.pressure.p)

    @cached_property
    def _pressure_form(self):
        return compile_form(self._pressure_ufl)

    @cached_property
    def _pressure_share_form(self):
        return compile_form(ufl.derivative(ufl.diff(self._strain_ufl, self._growth.share), self.pressure.p))

    @cached_property
    def _strain_form(self):
        return compile_form(self._strain_ufl)

    @cached_property
    def _share_form(self):
        terms = [self.effects_ufl] if self.effects_ufl is not None else []
        if self._growth is not None:
            terms.append(ufl.diff(self._strain_ufl, self._growth.share))
        return compile_form(ufl.derivative(sum(terms[1:], start=terms[0]), self.u))

    @cached_property
    def _sums(self) -> list[fem.Function]:
        """Where vectors on the spaces of ``fields`` are assembled."""
        return [fem.Function(field.function_space) for field in self.fields]

    def cellwise(self, per_link: Sequence[float]) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        function = fem.Function(cellwise_space(self.mesh))
        function.x.array[: len(self._link)] = np.asarray(per_link, dtype=float)[self._link]
        return function
