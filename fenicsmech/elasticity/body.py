"""Energy, residual, tangent and stress of all flexible links on the fixed reference mesh.

With the rest shape X = X₀ + c + d and the gradient H = F − I of ``fields``,

    E(u, d) = ∫ W(H) det(∇X) b dX₀,

b the depth of a planar link; in space 1, or 2 where only one half is meshed. Interface cells move rigidly and store no
energy: they are left out. Where links have a pressure p of their own, Π(H, p) of ``mixed`` takes the place of W, and E
has a saddle there: a minimum in u, a maximum in p.
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

from fenicsmech.compat import (
    add_blocks,
    assemble_vector,
    compile_expression,
    compile_form,
    create_block_matrix,
    evaluate_expression,
)
from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.fields import BodyFields
from fenicsmech.elasticity.growth import UNSTRETCHED, Growth, Stretch
from fenicsmech.elasticity.mixed import mixed_density
from fenicsmech.elasticity.models import ElasticModel
from fenicsmech.elasticity.quadrature import Quadrature
from fenicsmech.elasticity.stress import cauchy_stress, von_mises
from fenicsmech.mechanism import EnergyLaw, Material


@dataclass(frozen=True)
class _Term:
    """The cells of one law, all with a pressure of their own or all without."""

    law: EnergyLaw
    mixed: bool
    dx: ufl.Measure


class ElasticBody(BodyFields):
    """The flexible links as one hyperelastic body.

    Args:
        mesh: reference mesh.
        link, materials, depths, model, order, bulge: as of ``BodyFields``.
        free: whether each local cell can deform (False inside interfaces), (cells,).
        quadrature: explicit degree; never UFL's estimate.
        effects: energies beside the elastic one, as functions of this body; none costs nothing.
        stretches: of the strain-free state of each link, None where it is as drawn; none costs nothing.
        with_pressure: whether each link has a pressure of its own; none costs nothing.

    Attributes:
        dx: measure of all cells, interfaces included.
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
        mixed = tuple(with_pressure) or (False,) * len(materials)
        cells = np.flatnonzero(free).astype(np.int32)
        super().__init__(
            mesh,
            link=link,
            materials=materials,
            depths=depths,
            model=model,
            order=order,
            bulge=bulge,
            pressed=cells[np.array(mixed)[link[cells]]] if any(mixed) else None,
        )
        self._effects = tuple(effects)
        kinds = [(m.law, own) for m, own in zip(materials, mixed, strict=True)]
        terms = sorted(set(kinds), key=repr)
        term_of_cell = np.array([terms.index(kind) for kind in kinds])[link]
        tags = dmesh.meshtags(mesh, mesh.topology.dim, cells, term_of_cell[cells].astype(np.int32))
        measure = ufl.Measure("dx", domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": quadrature.degree})
        self.dx = measure
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

    def free(self, degree: int) -> ufl.Measure:
        """The measure of all cells that can deform, with quadrature of ``degree``."""
        metadata = {"quadrature_degree": degree}
        first, *others = [term.dx(metadata=metadata) for term in self._terms]
        return sum(others, start=first)

    def contraction_energy(self, weight, *, degree: int) -> ufl.Form:
        """½ ∫ w E (F₃₃ − 1)² dV with a scalar field w, of links in plane stress."""
        terms = []
        for term in self._terms:
            contraction = self.model.contraction(term.law, self._strain, self.moduli)
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
        return create_block_matrix(self.tangent_blocks)

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Adds ∂²E/∂(u, p)² into ``matrix`` (collective; leaves it unassembled)."""
        if self.pressure is None:
            fem.petsc.assemble_matrix(matrix, self.tangent_form)
        else:
            add_blocks(matrix, self.tangent_blocks)

    @cached_property
    def pressure_unit(self) -> float:
        """√(n / ∫ dV/μ) over the n unknowns of p, in whose units p is as large as u in an energy (collective).

        Volumes resist with p² / μ per volume once shear has done what it can.
        """
        first, *others = [self._volume / self.moduli.mu * term.dx for term in self._terms if term.mixed]
        volume = fem.assemble_scalar(compile_form(sum(others, start=first)))
        return float(np.sqrt(self.pressure.count / self.mesh.comm.allreduce(volume)))

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
        stresses = [von_mises(cauchy_stress(self.model, term.law, self._strain, self.moduli)) for term in self._terms]
        return [compile_expression(stress, midpoint, self.mesh.comm) for stress in stresses]

    @property
    def _strain(self):
        """H of the displacement; its elastic part where links have grown."""
        H = self.gradient(self.u)
        return H if self._growth is None else self._growth.elastic(H)

    def _density(self, term: _Term, H):
        """W, or Π, of the elastic strain H."""
        strain = self.model.strain(term.law, H, self.moduli)
        if term.mixed:
            return mixed_density(term.law, strain, self.moduli, self.pressure.p)
        return density(term.law, strain, self.moduli)

    @property
    def _volume(self):
        """Strain-free volume per volume of the mesh."""
        volume = ufl.det(self.rest_gradient) * self.model.multiplier(self.depth)
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
