"""Energy, residual, stiffness and stress of all flexible links on the fixed reference mesh.

With the rest shape X = X₀ + s, s = c + d, and the gradient H = F − I of ``fields``,

    E(u, d) = ∫ W(H) det(∇X) b dX₀,

b the depth of a planar link; in space 1, or 2 where only one half is meshed. Interface cells move rigidly and store no
energy: they are left out. In links in the u–p formulation Π(H, p) takes the place of W, and E has a saddle there: a
minimum in u, a maximum in p.

Equilibria balance ∂E/∂u in the form of S, equal to ∂W/∂F in exact arithmetic:

    ∂E/∂u · v = ∫ S : sym(Fᵀ ∇v) dV,     S = sym(F⁻¹ ∂W/∂F).

Rounding of S does no work along motions that strain nothing, while that of ∂W/∂F, μ ε per volume, does: along rigid
motions of a stiff link it is larger than small forces, springs and weights.

A step of Newton's method that turns a slender link also stretches it, at second order, and stretching is stiffer than
bending by the square of length over thickness: the stress S(u + δu) of the displacements is then far larger than the
one that the step solved for, S(u) + ∂S/∂E : δE with δE = sym(Fᵀ ∇δu). Newton's method with S as an unknown of its own
at the integration points, S eliminated, has the same residual as the one in displacements, and the stiffness

    K_uu + ∫ ∇v ΔS : ∇w dV,     ΔS = S(u) + ∂S/∂E : δE − S(u + δu),

which is K_uu once steps are small. In u–p form S(u, p) is predicted with δp too. Source: Magisano, Leonetti, Garcea,
"How to improve efficiency and robustness of the Newton method in geometrically non-linear structural problem
discretized via displacement-based finite elements" (Computer Methods in Applied Mechanics and Engineering 313, 2017,
doi:10.1016/j.cma.2016.10.023), the MIP Newton.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import repeat
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives

from fenicsmech.compat import (
    add_blocks,
    assemble_vector,
    compile_expression,
    compile_form,
    create_block_matrix,
    evaluate_expression,
    owned_values,
    quadrature_space,
)
from fenicsmech.elasticity.fields import BodyFields
from fenicsmech.elasticity.models import PlaneStress, cauchy_stress

_CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}


class ElasticBody(BodyFields):
    """The flexible links as one hyperelastic body; arguments as those of ``BodyFields``."""

    # -- symbolic -----------------------------------------------------------------------------------------------

    @cached_property
    def energy_ufl(self) -> ufl.Form:
        """E(u, d), the energy of effects included, symbolic; everything else is a derivative of it."""
        return self._strain_ufl if self.effects_ufl is None else self._strain_ufl + self.load_factor * self.effects_ufl

    @cached_property
    def effects_ufl(self) -> ufl.Form | None:
        """The energy of all effects, None if there are none."""
        return _sum(self._effect_terms) if self._effect_terms else None

    @cached_property
    def _effect_terms(self) -> list[ufl.Form]:
        return [term for effect in self.effects if (term := effect(self)) is not None]

    @cached_property
    def _strain_ufl(self) -> ufl.Form:
        return _sum(density * dx for density, dx in self.densities(self.gradient(self.u)))

    @cached_property
    def _residuals_ufl(self) -> list[ufl.Form]:
        """∂E/∂u, with the work of links as ∫ S : sym(Fᵀ∇v) dV, and where there is p, ∂E/∂p, of test functions."""
        H = ufl.variable(self.gradient(self.u))
        change = ufl.dot(ufl.transpose(_deformation(H)), self.gradient(ufl.TestFunction(self.u.function_space)))
        balance = _sum(ufl.inner(S, ufl.sym(change)) * dx for S, dx in self.material_stresses(H))
        if self.effects_ufl is not None:
            balance += ufl.derivative(self.load_factor * self.effects_ufl, self.u)
        return [balance, *(ufl.derivative(self.energy_ufl, field) for field in self.fields[1:])]

    def free(self, degree: int) -> ufl.Measure:
        """The measure of all cells that can deform, with quadrature of ``degree``."""
        return _sum(term.dx(metadata={"quadrature_degree": degree}) for term in self.terms)

    def densities(self, H, p=None) -> list[tuple]:
        """Elastic energy per volume of the mesh at the gradient H on the rest shape and the pressure p (default: the
        body's), and where it holds, per law."""
        found, elastic = [], self._elastic(H)
        for term in self.terms:
            strain = self.model.strain(term.law, elastic)
            if self.pressure is not None and term.mixed:
                density = term.law.mixed_energy(strain, self.pressure.p if p is None else p)
            else:
                density = term.law.energy(strain)
            found.append((density * self._volume, term.dx))
        return found

    def material_stresses(self, H, p=None) -> list[tuple]:
        """Second Piola–Kirchhoff stress S = sym(F⁻¹ ∂W/∂F) per volume of the mesh, and where it holds, per law.

        Args:
            H: a variable, the gradient on the rest shape.
            p: the pressure, by default the body's.
        """
        return [(ufl.sym(ufl.dot(ufl.inv(_deformation(H)), ufl.diff(W, H))), dx) for W, dx in self.densities(H, p)]

    def contraction_energy(self, a, v, p, q, pressures: Sequence[float], *, degree: int) -> ufl.Form:
        """Energy of links in plane stress that contract by a instead of h = F₃₃ − 1 and curl across their depth by v.

        ½ ∫ E₃ ((a − p)² − 2 q h) / g² + μ b²/12 |s|² + b⁴/720 E/(1 − ν²) ((1 − ν) G : G + ν (tr G)²) + 2 P a det F dV

        with s = F_p⁻ᵀ (∇a − Fᵀv / g), G = F_p⁻ᵀ sym(Fᵀ∇v) F_p⁻¹ and p the projection of h, whose derivatives are those
        of the term in q, that of a − p. F_p is the growth, g that of the depth. P is the load factor times the
        ``pressures`` on the faces of each link across its depth. dV is of the strain-free state, but in the term of P
        of the rest shape, from which F and a count.
        """
        assert isinstance(self.model, PlaneStress), "links contract freely in plane stress alone"
        H, b, terms = self.gradient(self.u), self.depth, []
        F = _deformation(H)
        squeezing = self.load_factor * self.cellwise(pressures) * a * ufl.det(F)
        grown, shear = 1, self.gradient(a) - ufl.dot(F.T, v)
        G = ufl.sym(ufl.dot(F.T, self.gradient(v)))
        if self.growth is not None:
            grown, inverse = self.growth.depth, self.growth.inverse
            shear = ufl.dot(inverse.T, self.gradient(a) - ufl.dot(F.T, v) / grown)
            G = ufl.dot(inverse.T, ufl.dot(G, inverse))
        for term in self.terms:
            E, nu, h = term.law.E, term.law.nu, grown * (1 + self.model.contraction(term.law, self._elastic(H))) - 1
            contraction = term.law.E_across_plane * ((a - p) ** 2 - 2 * q * h) / grown**2
            curling = b**2 / 12 * E / (2 * (1 + nu)) * ufl.inner(shear, shear)
            membrane = b**4 / 720 * E / (1 - nu**2) * ((1 - nu) * ufl.inner(G, G) + nu * ufl.tr(G) ** 2)
            density = 0.5 * (contraction + curling + membrane) * self._volume + squeezing * self._rest_volume
            terms.append(density * term.dx(metadata={"quadrature_degree": degree}))
        return _sum(terms)

    def curvature(self, A, B, *, degree: int) -> ufl.Form:
        """∫ A : ∂²W/∂F∂F : B dV at the present fields, for gradients A, B on the rest shape."""
        i, j, k, m = ufl.indices(4)
        H, terms = ufl.variable(self.gradient(self.u)), []
        for density, dx in self.densities(H):
            C = ufl.diff(ufl.diff(density, H), H)
            terms.append(A[i, j] * C[i, j, k, m] * B[k, m] * dx(metadata={"quadrature_degree": degree}))
        return _sum(terms)

    @property
    def stresses_ufl(self) -> list:
        """σ, 3 × 3, symbolic, per law."""
        return self._stresses(self.gradient(self.u))

    def _stresses(self, H) -> list:
        """σ at the gradient H on the rest shape, 3 × 3, symbolic, per law."""
        H, found = self._elastic(H), []
        for term in self.terms:
            p = self.pressure.p if self.pressure is not None and term.mixed else None
            found.append(cauchy_stress(self.model, term.law, H, p))
        return found

    @property
    def elastic_ufl(self):
        """The elastic part of F on the mesh, (dim, dim), symbolic."""
        return self._elastic_at(self.gradient(self.u))

    def _elastic_at(self, H):
        """The elastic part of F at the gradient H on the rest shape, (dim, dim), symbolic."""
        H, axes = self._elastic(H), range(self.model.dim)
        return ufl.as_matrix([[H[i, j] + float(i == j) for j in axes] for i in axes])

    def _elastic(self, H):
        """The elastic part of H."""
        return H if self.growth is None else self.growth.elastic(H)

    @property
    def _volume(self):
        """Strain-free volume per volume of the mesh."""
        return self._rest_volume if self.growth is None else self._rest_volume * self.growth.volume

    @property
    def _rest_volume(self):
        """Volume of the rest shape per volume of the mesh."""
        return ufl.det(self.rest_gradient) * self.model.multiplier(self.depth)

    # -- compiled -----------------------------------------------------------------------------------------------

    @cached_property
    def energy_form(self):
        """E."""
        return compile_form(self.energy_ufl)

    @cached_property
    def residual_forms(self) -> list:
        """∂E/∂(u, p), field by field."""
        return [compile_form(residual) for residual in self._residuals_ufl]

    @cached_property
    def stiffness_forms(self) -> list[list]:
        """∂²E/∂(u, p)², block by block."""
        gradients = [ufl.derivative(self.energy_ufl, field) for field in self.fields]
        return [[compile_form(ufl.derivative(row, field)) for field in self.fields] for row in gradients]

    @cached_property
    def _strain_form(self):
        return self.energy_form if self.effects_ufl is None else compile_form(self._strain_ufl)

    @cached_property
    def _load_factor_forms(self) -> list:
        """The derivatives of ``residual_forms`` with respect to the load factor; only growth has one of ∂E/∂p."""
        terms = [self.effects_ufl] if self.effects_ufl is not None else []
        if self.growth is not None:
            terms.append(ufl.diff(self._strain_ufl, self.growth.load_factor))
        concerned = self.fields if self.growth is not None else [self.u]
        return [compile_form(ufl.derivative(_sum(terms), field)) for field in concerned]

    @cached_property
    def _effect_load_forms(self) -> list[tuple[bool, Any]]:
        """Of each effect with an energy, whether this is linear in u, and its gradient by u."""
        found = []
        for term in self._effect_terms:
            gradient = ufl.derivative(term, self.u)
            dead = expand_derivatives(ufl.derivative(gradient, self.u)).empty()
            found.append((dead, compile_form(gradient)))
        return found

    @cached_property
    def _sums(self) -> list[fem.Function]:
        """Functions on the spaces of ``fields`` in which vectors are assembled."""
        return [fem.Function(field.function_space) for field in self.fields]

    def compile(self) -> None:
        """Compiles all forms of equilibria."""
        _ = self.energy_form, self.residual_forms, self.stiffness_forms

    # -- values -------------------------------------------------------------------------------------------------

    def energy(self) -> float:
        """E at the current fields, of the whole mesh; NaN where J ≤ 0."""
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(self.energy_form)))

    def strain_energy(self) -> float:
        """The elastic part of E."""
        return float(self.mesh.comm.allreduce(fem.assemble_scalar(self._strain_form)))

    def residuals(self) -> np.ndarray:
        """∂E/∂(u, p) at this rank's owned values, those of u first, flat."""
        return np.concatenate([assemble_vector(*pair) for pair in zip(self.residual_forms, self._sums, strict=True)])

    def assembled(self, form) -> np.ndarray:
        """A compiled linear form on the space of u, this rank's owned values, flat."""
        return assemble_vector(form, self._sums[0]).copy()

    @property
    def depends_on_load_factor(self) -> bool:
        """Whether the energy depends on the load factor."""
        return self.effects_ufl is not None or self.growth is not None

    def load_factor_residuals(self) -> np.ndarray:
        """The derivative of ``residuals`` with respect to the load factor."""
        found = np.zeros(len(self.values()))
        for part, form, work in zip(self.split(found), self._load_factor_forms, self._sums, strict=False):
            part[:] = assemble_vector(form, work)
        return found

    @property
    def has_other_than_dead_loads(self) -> bool:
        """Whether loads of effects change with u."""
        return any(not dead for dead, _ in self._effect_load_forms)

    def effect_loads(self, among: Sequence[bool] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Nodal forces of effects at load factor 1: of dead loads, and of others, which change with u.

        Args:
            among: mask of the effects with an energy; by default all of them.

        Returns:
            Each of this rank's owned values of u, flat.
        """
        loads = np.zeros((2, len(owned_values(self.u))))
        for (dead, form), chosen in zip(self._effect_load_forms, among or repeat(True), strict=False):
            if chosen:
                loads[0 if dead else 1] -= self.assembled(form)
        return loads[0], loads[1]

    def create_stiffness(self) -> PETSc.Mat:
        """An empty matrix for ``add_stiffness``: per rank, the owned values of u, then those of p."""
        if self.pressure is None:
            return petsc.create_matrix(self.stiffness_forms[0][0])
        return create_block_matrix(self.stiffness_forms)

    def add_stiffness(self, matrix: PETSc.Mat) -> None:
        """Adds ∂²E/∂(u, p)² into ``matrix`` and leaves it unassembled."""
        if self.pressure is None:
            petsc.assemble_matrix(matrix, self.stiffness_forms[0][0])
        else:
            add_blocks(matrix, self.stiffness_forms)

    @cached_property
    def pressure_unit(self) -> float:
        """√(n / ∫ dV/μ) over the n unknowns of p, in whose units p is as large as u in an energy.

        Volumes resist with p² / μ per volume once shear has given way.
        """
        assert self.pressure is not None, "no link is in the u–p formulation"
        mixed = [term for term in self.terms if term.mixed]
        form = _sum(self._volume * 2 * (1 + term.law.nu) / term.law.E * term.dx for term in mixed)
        volume = self.mesh.comm.allreduce(fem.assemble_scalar(compile_form(form)))
        return float(np.sqrt(self.pressure.count / volume))

    def stress_samples(self) -> tuple[np.ndarray, np.ndarray]:
        """σ, (cells, q, 3, 3), and F of the mesh, (cells, q, dim, dim), at ``sample_points`` of each local cell.

        Zero in cells that cannot deform. Both are without the ``gradient_errors``.
        """
        dim, q = self.model.dim, len(self.sample_points)
        values = np.zeros((len(self._link), q * (9 + dim**2)))
        for expression, term in zip(self._samples, self.terms, strict=True):
            values[term.cells] = evaluate_expression(expression, self.mesh, term.cells)
        values = values.reshape(-1, q, 9 + dim**2)
        return values[..., :9].reshape(-1, q, 3, 3), values[..., 9:].reshape(-1, q, dim, dim)

    def elastic_samples(self) -> np.ndarray:
        """The elastic part of F at ``sample_points`` of each local cell, (cells, q, dim, dim); else as there."""
        dim, q = self.model.dim, len(self.sample_points)
        values = np.zeros((len(self._link), q * dim**2))
        for term in self.terms:
            values[term.cells] = evaluate_expression(self._elastic_samples, self.mesh, term.cells)
        return values.reshape(-1, q, dim, dim)

    @cached_property
    def _elastic_samples(self) -> fem.Expression:
        """The compiled components of the elastic part of F at the points of samples."""
        F = self._elastic_at(self._sampled_gradient)
        parts = [F[i, j] for i in range(self.model.dim) for j in range(self.model.dim)]
        return compile_expression(ufl.as_vector(parts), self.sample_points, self.mesh.comm)

    def spatial_samples(self) -> np.ndarray:
        """The elastic part of F as the model completes it, (cells, q, 3, 3); else as ``elastic_samples``."""
        values = np.zeros((len(self._link), 9 * len(self.sample_points)))
        for expression, term in zip(self._spatial_samples, self.terms, strict=True):
            values[term.cells] = evaluate_expression(expression, self.mesh, term.cells)
        return values.reshape(len(self._link), -1, 3, 3)

    @cached_property
    def _spatial_samples(self) -> list[fem.Expression]:
        """The compiled components of that, per law."""
        found, H = [], self._elastic(self.gradient(self.u))
        for term in self.terms:
            F = self.model.strain(term.law, H).F
            parts = ufl.as_vector([F[i, j] for i in range(3) for j in range(3)])
            found.append(compile_expression(parts, self.sample_points, self.mesh.comm))
        return found

    @property
    def sample_points(self) -> np.ndarray:
        """Points of the reference cell where stresses are most accurate: of Gauss quadrature, (q, dim)."""
        return self.sample_rule[0]

    @property
    def sample_degree(self) -> int:
        """Degree of the quadrature whose points those of samples are."""
        return max(2 * self.order - 2, 1)

    @cached_property
    def sample_rule(self) -> tuple[np.ndarray, np.ndarray]:
        """Its points, (q, dim), and weights, (q,)."""
        points, weights = basix.make_quadrature(_CELLS[self.model.dim], self.sample_degree)
        return points, weights

    @cached_property
    def gradient_errors(self) -> fem.Function:
        """Errors of H at ``sample_points``, row by row, that samples leave out; none unless they are set."""
        return fem.Function(quadrature_space(self.mesh, self.sample_degree, self.model.dim**2))

    @property
    def _sampled_gradient(self):
        """H without its errors, symbolic."""
        dim, errors = self.model.dim, self.gradient_errors
        return self.gradient(self.u) - ufl.as_matrix([[errors[dim * i + j] for j in range(dim)] for i in range(dim)])

    @cached_property
    def _samples(self) -> list[fem.Expression]:
        """The compiled components of σ and F at the points of samples, per law."""
        H, found = self._sampled_gradient, []
        F = _deformation(H)
        for stress in self._stresses(H):
            parts = [stress[i, j] for i in range(3) for j in range(3)]
            parts += [F[i, j] for i in range(self.model.dim) for j in range(self.model.dim)]
            found.append(compile_expression(ufl.as_vector(parts), self.sample_points, self.mesh.comm))
        return found


class PredictedStress:
    """ΔS of the last step of Newton's method, at the displacements that ``body`` holds.

    Args:
        body: the flexible links.
    """

    def __init__(self, body: ElasticBody) -> None:
        self._body, space = body, body.u.function_space
        self._before, self._motion = (
            [fem.Function(field.function_space, name=name) for field in body.fields] for name in ("before", "motion")
        )
        v, w = (body.gradient(argument) for argument in (ufl.TestFunction(space), ufl.TrialFunction(space)))
        F = _deformation(body.gradient(body.u))
        forces, stiffness = [], []
        stresses = [
            body.material_stresses(ufl.variable(body.gradient(fields[0])), *fields[1:])
            for fields in (self._before, body.fields)
        ]
        for (before, measure), (present, _) in zip(*stresses, strict=True):
            rates = [ufl.derivative(before, *pair) for pair in zip(self._before, self._motion, strict=True)]
            change = sum(rates, start=before) - present
            forces.append(ufl.inner(ufl.dot(F, change), v) * measure)
            stiffness.append(ufl.inner(ufl.dot(w, change), v) * measure)
        self._forces, self._stiffness = compile_form(_sum(forces)), compile_form(_sum(stiffness))

    @cached_property
    def _no_compliance(self):
        """The zero block of p, which dolfinx needs to know its space."""
        space = self._body.pressure.p.function_space
        p, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        return compile_form(fem.Constant(self._body.mesh, 0.0) * p * q * self._body.dx)

    def take(self, before: np.ndarray, motion: np.ndarray) -> None:
        """Takes (u, p) before the step, and the step of both, of this rank's owned values, flat."""
        for fields, values in ((self._before, before), (self._motion, motion)):
            for field, own in zip(fields, self._body.split(values), strict=True):
                owned_values(field)[:] = own
                field.x.scatter_forward()

    def forces(self) -> np.ndarray:
        """∫ F ΔS : ∇v dV, this rank's owned values, flat."""
        return self._body.assembled(self._forces)

    def add_stiffness(self, matrix: PETSc.Mat) -> None:
        """Adds ∫ ∇v ΔS : ∇w dV into ``matrix`` and leaves it unassembled."""
        if self._body.pressure is None:
            petsc.assemble_matrix(matrix, self._stiffness)
        else:
            add_blocks(matrix, [[self._stiffness, None], [None, self._no_compliance]])


def _deformation(H):
    """F = I + H, symbolic."""
    return ufl.Identity(H.ufl_shape[0]) + H


def _sum(terms):
    """The sum of forms or measures, which have no zero to start from."""
    first, *others = terms
    return sum(others, start=first)
