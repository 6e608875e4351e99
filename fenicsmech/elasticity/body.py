"""Energy, residual, tangent and stress of all flexible links on the fixed reference mesh.

With the rest shape X = X₀ + c + d and the gradient H = F − I of ``fields``,

    E(u, d) = ∫ W(H) det(∇X) b dX₀,

b the depth of a planar link; in space 1, or 2 where only one half is meshed. Interface cells move rigidly and store no
energy: they are left out. In links in the u–p formulation Π(H, p) takes the place of W, and E has a saddle there: a
minimum in u, a maximum in p.
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
from dolfinx.fem import petsc
from petsc4py import PETSc

from fenicsmech.compat import (
    add_blocks,
    assemble_vector,
    compile_expression,
    compile_form,
    create_block_matrix,
    evaluate_expression,
)
from fenicsmech.elasticity.fields import BodyFields, Growth, Stretch
from fenicsmech.elasticity.models import ElasticModel, PlaneStress, cauchy_stress
from fenicsmech.errors import DescriptionError
from fenicsmech.laws import Law
from fenicsmech.mechanism import Material


@dataclass(frozen=True)
class Quadrature:
    """Degree of the quadrature over cells.

    Raises:
        DescriptionError: it is not a whole number of at least 1.
    """

    degree: int

    def __post_init__(self) -> None:
        if not isinstance(self.degree, Integral) or self.degree < 1:
            raise DescriptionError("quadrature", f"degree {self.degree!r}", "Give a whole number of at least 1")

    @staticmethod
    def for_order(order: int, dim: int) -> Quadrature:
        """The cheapest degree whose error lies well below the discretisation error (measured), by order of u."""
        return Quadrature({1: 1, 2: 3 if dim == 3 else 4}.get(order, 2 * order))


@dataclass(frozen=True)
class _Term:
    """The cells of one kind of law, all in the u–p formulation or none; parameters of the law are fields."""

    law: Law
    mixed: bool
    dx: ufl.Measure
    cells: np.ndarray


class ElasticBody(BodyFields):
    """The flexible links as one hyperelastic body.

    Args:
        mesh: reference mesh.
        link, materials, depths, model, order, bulge: as of ``BodyFields``.
        free: whether each local cell can deform (False inside interfaces), (cells,).
        quadrature: explicit degree; never UFL's estimate.
        effects: energies beside the elastic one, as functions of this body.
        stretches: of the strain-free state of each link, None where it is as drawn.
        mixed: whether each link is in the u–p formulation.

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
        mixed: Sequence[bool] = (),
    ) -> None:
        mixed = tuple(mixed) or (False,) * len(materials)
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
        self._growth = None
        if any(stretches):
            self._growth = Growth(stretches, self.cellwise, free=free, dim=model.dim, load_factor=self.load_factor)
        kinds = [(str(type(m.law)), *m.law.parameters, own) for m, own in zip(materials, mixed, strict=True)]
        known = sorted(set(kinds), key=str)
        kind_of_cell = np.array([known.index(kind) for kind in kinds])[link]
        tags = dmesh.meshtags(mesh, mesh.topology.dim, cells, kind_of_cell[cells].astype(np.int32))
        self.dx = ufl.Measure("dx", domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": quadrature.degree})
        self._terms = []
        for tag, kind in enumerate(known):
            first = kinds.index(kind)
            law = materials[first].law.with_parameters(self.parameters)
            where = np.flatnonzero(kind_of_cell == tag).astype(np.int32)
            self._terms.append(_Term(law, mixed[first], self.dx(tag), where))

    @cached_property
    def energy_ufl(self) -> ufl.Form:
        """E(u, d), the energy of effects included, symbolic; everything else is a derivative of it."""
        return self._strain_ufl if self.effects_ufl is None else self._strain_ufl + self.load_factor * self.effects_ufl

    @cached_property
    def effects_ufl(self) -> ufl.Form | None:
        """The energy of all effects, None if there are none."""
        terms = [term for effect in self._effects if (term := effect(self)) is not None]
        return _sum(terms) if terms else None

    @cached_property
    def _strain_ufl(self) -> ufl.Form:
        return _sum(density * dx for density, dx in self.densities(self.gradient(self.u)))

    @cached_property
    def _residuals_ufl(self) -> list[ufl.Form]:
        """∂E/∂u and, where there is p, ∂E/∂p in directions of test functions."""
        return [ufl.derivative(self.energy_ufl, field) for field in self.fields]

    @cached_property
    def energy_form(self):
        return compile_form(self.energy_ufl)

    @cached_property
    def residual_forms(self) -> list:
        """∂E/∂(u, p), field by field."""
        return [compile_form(residual) for residual in self._residuals_ufl]

    @cached_property
    def tangent_forms(self) -> list[list]:
        """∂²E/∂(u, p)², block by block."""
        return [[compile_form(ufl.derivative(row, field)) for field in self.fields] for row in self._residuals_ufl]

    def compile(self) -> None:
        """Compiles all forms of equilibria."""
        _ = self.energy_form, self.residual_forms, self.tangent_forms

    def free(self, degree: int) -> ufl.Measure:
        """The measure of all cells that can deform, with quadrature of ``degree``."""
        return _sum(term.dx(metadata={"quadrature_degree": degree}) for term in self._terms)

    def densities(self, H) -> list[tuple]:
        """Elastic energy per volume of the mesh at the gradient H on the rest shape, and where it holds, per law."""
        return [(self._density(term, self._elastic(H)) * self._volume, term.dx) for term in self._terms]

    def contraction_energy(self, weight, *, degree: int) -> ufl.Form:
        """½ ∫ w E (F₃₃ − 1)² dV with a scalar field w, of links in plane stress."""
        assert isinstance(self.model, PlaneStress), "links contract freely in plane stress alone"
        H, terms = self._elastic(self.gradient(self.u)), []
        for term in self._terms:
            density = 0.5 * weight * term.law.E * self.model.contraction(term.law, H) ** 2
            terms.append(density * self._volume * term.dx(metadata={"quadrature_degree": degree}))
        return _sum(terms)

    def curvature(self, A, B, *, degree: int) -> ufl.Form:
        """∫ A : ∂²W/∂F∂F : B dV at the present fields, for gradients A, B on the rest shape."""
        i, j, k, m = ufl.indices(4)
        H, terms = ufl.variable(self.gradient(self.u)), []
        for density, dx in self.densities(H):
            C = ufl.diff(ufl.diff(density, H), H)
            terms.append(A[i, j] * C[i, j, k, m] * B[k, m] * dx(metadata={"quadrature_degree": degree}))
        return _sum(terms)

    def energy(self) -> float:
        """E at the current fields, of the whole mesh; NaN where J ≤ 0."""
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(self.energy_form)))

    def strain_energy(self) -> float:
        """The elastic part of E."""
        form = self.energy_form if self.effects_ufl is None else self._strain_form
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(form)))

    def residuals(self) -> np.ndarray:
        """∂E/∂(u, p) at this rank's owned values, those of u first, flat."""
        return np.concatenate([assemble_vector(*pair) for pair in zip(self.residual_forms, self._sums, strict=True)])

    def assembled(self, form) -> np.ndarray:
        """A compiled linear form on the space of u, this rank's owned values, flat."""
        return assemble_vector(form, self._sums[0]).copy()

    @property
    def depends_on_load_factor(self) -> bool:
        """Whether the energy depends on the load factor."""
        return self.effects_ufl is not None or self._growth is not None

    def load_factor_residuals(self) -> np.ndarray:
        """The derivative of ``residuals`` by the load factor."""
        found = np.zeros(sum(map(len, self.split(self.values()))))
        for part, form, work in zip(self.split(found), self._load_factor_forms, self._sums, strict=False):
            part[:] = assemble_vector(form, work)
        return found

    def create_tangent(self) -> PETSc.Mat:
        """An empty matrix for ``tangent``: per rank, the owned values of u, then those of p."""
        if self.pressure is None:
            return petsc.create_matrix(self.tangent_forms[0][0])
        return create_block_matrix(self.tangent_forms)

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Adds ∂²E/∂(u, p)² into ``matrix`` and leaves it unassembled."""
        if self.pressure is None:
            petsc.assemble_matrix(matrix, self.tangent_forms[0][0])
        else:
            add_blocks(matrix, self.tangent_forms)

    @cached_property
    def pressure_unit(self) -> float:
        """√(n / ∫ dV/μ) over the n unknowns of p, in whose units p is as large as u in an energy.

        Volumes resist with p² / μ per volume once shear has done what it can.
        """
        assert self.pressure is not None, "no link is in the u–p formulation"
        mixed = [term for term in self._terms if term.mixed]
        form = _sum(self._volume * 2 * (1 + term.law.nu) / term.law.E * term.dx for term in mixed)
        volume = self.mesh.comm.allreduce(fem.assemble_scalar(compile_form(form)))
        return float(np.sqrt(self.pressure.count / volume))

    def von_mises(self) -> np.ndarray:
        """Von Mises stress √(3/2 dev σ : dev σ) at the midpoint of each local cell, (cells,)."""
        values = np.zeros(sum(len(term.cells) for term in self._terms))
        for expression, term in zip(self._stresses, self._terms, strict=True):
            values[term.cells] = evaluate_expression(expression, self.mesh, term.cells)[:, 0]
        return values

    @cached_property
    def _stresses(self) -> list[fem.Expression]:
        """The compiled von Mises stress at cell midpoints, per law."""
        midpoint, H = np.full((1, self.model.dim), 1.0 / (self.model.dim + 1)), self._elastic(self.gradient(self.u))
        # without p, which does not change the deviator
        stresses = [ufl.dev(cauchy_stress(self.model, term.law, H)) for term in self._terms]
        return [compile_expression(ufl.sqrt(1.5 * ufl.inner(s, s)), midpoint, self.mesh.comm) for s in stresses]

    def _elastic(self, H):
        """The elastic part of H."""
        return H if self._growth is None else self._growth.elastic(H)

    def _density(self, term: _Term, H):
        """W, or Π, of the elastic gradient H."""
        strain = self.model.strain(term.law, H)
        if self.pressure is None or not term.mixed:
            return term.law.energy(strain)
        return term.law.mixed_energy(strain, self.pressure.p)

    @property
    def _volume(self):
        """Strain-free volume per volume of the mesh."""
        volume = ufl.det(self.rest_gradient) * self.model.multiplier(self.depth)
        return volume if self._growth is None else volume * self._growth.volume

    @cached_property
    def _strain_form(self):
        return compile_form(self._strain_ufl)

    @cached_property
    def _load_factor_forms(self) -> list:
        """The derivatives of ``residual_forms`` by the load factor; only growth has one of ∂E/∂p."""
        terms = [self.effects_ufl] if self.effects_ufl is not None else []
        if self._growth is not None:
            terms.append(ufl.diff(self._strain_ufl, self._growth.load_factor))
        concerned = self.fields if self._growth is not None else [self.u]
        return [compile_form(ufl.derivative(_sum(terms), field)) for field in concerned]

    @cached_property
    def _sums(self) -> list[fem.Function]:
        """Functions on the spaces of ``fields`` in which vectors are assembled."""
        return [fem.Function(field.function_space) for field in self.fields]


def _sum(terms):
    """The sum of forms or measures, which have no zero to start from."""
    first, *others = terms
    return sum(others, start=first)
