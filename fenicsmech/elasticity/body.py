"""Energy, residual, tangent and stress of all flexible links on the fixed reference mesh.

With reference coordinates X₀, design d, rest shape X = X₀ + d and displacement u from the rest shape:

    H = F − I = ∇u (I + ∇d)⁻¹,     E(u, d) = ∫ W(H) det(I + ∇d) b dX₀,

b the depth of a planar link (1 in space). Interface cells move rigidly and store no energy: they are left out.
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
    cellwise_space,
    compile_expression,
    compile_form,
    evaluate_expression,
    petsc_vector,
    vector_space,
)
from fenicsmech.elasticity.energies import density
from fenicsmech.elasticity.growth import UNSTRETCHED, Growth, Stretch
from fenicsmech.elasticity.models import ElasticModel
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


class ElasticBody:
    """The flexible links as one hyperelastic body.

    Args:
        mesh: reference mesh.
        link: index of the link of each local cell, (cells,).
        free: whether each local cell can deform (False inside interfaces), (cells,).
        materials: material of each link.
        depths: depth of each link, used by planar models.
        model: 3D, plane strain or plane stress.
        order: degree of the displacement field.
        quadrature: explicit degree; never UFL's estimate.
        effects: energies beside the elastic one, as functions of this body; none costs nothing.
        stretches: of the strain-free state of each link, None where it is as drawn; none costs nothing.

    Attributes:
        u: displacement field, vector P_order.
        d: design field, vector P1.
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
    ) -> None:
        self.mesh, self.model, self.order = mesh, model, order
        self.u = fem.Function(vector_space(mesh, order), name="displacement")
        self.d = fem.Function(vector_space(mesh, 1), name="design")
        self._link, self._effects = link, tuple(effects)
        self.youngs_modulus = self.cellwise([m.youngs_modulus for m in materials])
        self.poissons_ratio = self.cellwise([m.poissons_ratio for m in materials])
        self._depth = self.cellwise(depths)
        laws = sorted({m.law for m in materials}, key=repr)
        law_of_cell = np.array([laws.index(m.law) for m in materials])[link]
        cells = np.flatnonzero(free).astype(np.int32)
        tags = dmesh.meshtags(mesh, mesh.topology.dim, cells, law_of_cell[cells].astype(np.int32))
        measure = ufl.Measure("dx", domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": quadrature.degree})
        self.dx = measure
        self.share = fem.Constant(mesh, PETSc.ScalarType(1.0))
        self._growth = None
        if any(stretches):
            known = [stretch or UNSTRETCHED for stretch in stretches]
            self._growth = Growth(known, self.cellwise, free=free, dim=model.dim, share=self.share)
        self._terms = [(law, measure(tag)) for tag, law in enumerate(laws)]
        self._law_cells = [np.flatnonzero(law_of_cell == tag).astype(np.int32) for tag in range(len(laws))]

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
        thick = self._depth if self.model.dim == 2 else 1.0
        volume = ufl.det(self._design_gradient) * thick
        if self._growth is not None:
            volume *= self._growth.volume
        terms = [self._density(law) * volume * dx for law, dx in self._terms]
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

    def gradient(self, field: fem.Function):
        """H = ∇field (I + ∇d)⁻¹, the gradient of a field on the rest shape, symbolic."""
        return ufl.dot(ufl.grad(field), ufl.inv(self._design_gradient))

    def free(self, degree: int) -> ufl.Measure:
        """The measure of all cells that can deform, with quadrature of ``degree``."""
        metadata = {"quadrature_degree": degree}
        return sum((dx(metadata=metadata) for _, dx in self._terms[1:]), start=self._terms[0][1](metadata=metadata))

    def curvature(self, A, B, *, degree: int) -> ufl.Form:
        """∫ A : ∂²W/∂F∂F : B dV at the present displacement, for gradients A, B on the rest shape."""
        i, j, k, m = ufl.indices(4)
        H = ufl.variable(self.gradient(self.u))
        elastic = H if self._growth is None else self._growth.elastic(H)
        scale = self._depth if self.model.dim == 2 else 1.0
        if self._growth is not None:
            scale *= self._growth.volume
        terms = []
        for law, dx in self._terms:
            density_ = density(law, self.model.strain(law, elastic, self._moduli), self._moduli)
            C = ufl.diff(ufl.diff(density_, H), H)
            product = A[i, j] * C[i, j, k, m] * B[k, m] * ufl.det(self._design_gradient) * scale
            terms.append(product * dx(metadata={"quadrature_degree": degree}))
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

    def share_residual(self, vector: PETSc.Vec) -> None:
        """Assembles the derivative of the residual by the share into the ghosted ``vector`` (collective)."""
        self._assemble(self._share_form, vector)

    def residual(self, vector: PETSc.Vec) -> None:
        """Assembles ∂E/∂u into the ghosted ``vector`` (collective)."""
        self._assemble(self.residual_form, vector)

    def assembled(self, form) -> np.ndarray:
        """A compiled linear form on the space of u, this rank's owned values, flat (collective)."""
        vector = petsc_vector(self.u).duplicate()
        self._assemble(form, vector)
        return vector.array_r.copy()

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Adds ∂²E/∂u² into ``matrix`` (collective; leaves it unassembled)."""
        fem.petsc.assemble_matrix(matrix, self.tangent_form)

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
        """Makes ghost values of u agree with their owners (collective)."""
        petsc_vector(self.u).ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)

    def von_mises(self) -> np.ndarray:
        """Von Mises stress at the midpoint of each local cell, (cells,)."""
        values = np.zeros(sum(map(len, self._law_cells)))
        for expression, cells in zip(self._stresses, self._law_cells, strict=True):
            values[cells] = evaluate_expression(expression, self.mesh, cells)[:, 0]
        return values

    @cached_property
    def _stresses(self) -> list[fem.Expression]:
        """The compiled von Mises stress at cell midpoints, per law."""
        midpoint = np.full((1, self.model.dim), 1.0 / (self.model.dim + 1))
        stresses = [von_mises(cauchy_stress(self.model, law, self._strain, self._moduli)) for law, _ in self._terms]
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
    def _design_gradient(self):
        """I + ∇d."""
        return ufl.Identity(self.model.dim) + ufl.grad(self.d)

    @property
    def _strain(self):
        """H of the displacement; its elastic part where links have grown."""
        H = self.gradient(self.u)
        return H if self._growth is None else self._growth.elastic(H)

    def _density(self, law: EnergyLaw):
        return density(law, self.model.strain(law, self._strain, self._moduli), self._moduli)

    @cached_property
    def _strain_form(self):
        return compile_form(self._strain_ufl)

    @cached_property
    def _share_form(self):
        terms = [self.effects_ufl] if self.effects_ufl is not None else []
        if self._growth is not None:
            terms.append(ufl.diff(self._strain_ufl, self._growth.share))
        return compile_form(ufl.derivative(sum(terms[1:], start=terms[0]), self.u))

    def _assemble(self, form, vector: PETSc.Vec) -> None:
        with vector.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(vector, form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def cellwise(self, per_link: Sequence[float]) -> fem.Function:
        """A field with one value per cell from one value per link, (links,)."""
        function = fem.Function(cellwise_space(self.mesh))
        function.x.array[: len(self._link)] = np.asarray(per_link, dtype=float)[self._link]
        return function
