"""The stress predicted by a step of Newton's method, for the geometric part of the next tangent.

A step that turns a slender link also stretches it, at second order, and stretching is stiffer than bending by the
square of length over thickness: the stress S(u + δu) of the displacements is then far larger than the one that the step
solved for, S(u) + ∂S/∂E : δE with δE = sym(Fᵀ ∇δu). Newton's method with S as an unknown of its own at the
integration points, S eliminated, has the same residual as the one in displacements, and the tangent

    K_uu + ∫ ∇v ΔS : ∇w dV,     ΔS = S(u) + ∂S/∂E : δE − S(u + δu),

which is K_uu once steps are small. Source: Magisano, Leonetti, Garcea, "How to improve efficiency and robustness of the
Newton method in geometrically non-linear structural problem discretized via displacement-based finite elements"
(Computer Methods in Applied Mechanics and Engineering 313, 2017, doi:10.1016/j.cma.2016.10.023), the MIP Newton.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from petsc4py import PETSc

from fenicsmech.compat import compile_form, owned_values
from fenicsmech.elasticity.body import ElasticBody


class MixedStress:
    """ΔS of the last step, at the displacements that ``body`` holds.

    Args:
        body: the flexible links.
    """

    def __init__(self, body: ElasticBody) -> None:
        self._body, space = body, body.u.function_space
        self._before, self._motion = (fem.Function(space, name=name) for name in ("before", "motion"))
        v, w = (body.gradient(argument) for argument in (ufl.TestFunction(space), ufl.TrialFunction(space)))
        F = ufl.Identity(body.model.dim) + body.gradient(body.u)
        forces, stiffness = [], []
        for (before, measure), (present, _) in zip(self._stresses(self._before), self._stresses(body.u), strict=True):
            change = before + ufl.derivative(before, self._before, self._motion) - present
            forces.append(ufl.inner(ufl.dot(F, change), v) * measure)
            stiffness.append(ufl.inner(ufl.dot(w, change), v) * measure)
        self._forces = compile_form(sum(forces[1:], start=forces[0]))
        self._stiffness = compile_form(sum(stiffness[1:], start=stiffness[0]))

    def follow(self, before: np.ndarray, motion: np.ndarray) -> None:
        """Takes the displacements u before the step, and the step δu, of this rank's owned nodes, flat."""
        for field, values in ((self._before, before), (self._motion, motion)):
            owned_values(field)[:] = values
            field.x.scatter_forward()

    def forces(self) -> np.ndarray:
        """∫ F ΔS : ∇v dV, this rank's owned values, flat."""
        return self._body.assembled(self._forces)

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Adds ∫ ∇v ΔS : ∇w dV into ``matrix`` and leaves it unassembled."""
        petsc.assemble_matrix(matrix, self._stiffness)

    def _stresses(self, u: fem.Function):
        """Second Piola–Kirchhoff stress S = F⁻¹ ∂W/∂F per volume of the mesh, and where it holds, per law."""
        H = ufl.variable(self._body.gradient(u))
        F = ufl.Identity(self._body.model.dim) + H
        for work, measure in self._body.densities(H):
            stress = ufl.dot(ufl.inv(F), ufl.diff(work, H))
            yield 0.5 * (stress + ufl.transpose(stress)), measure
