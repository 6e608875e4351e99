"""Recovery by averaging: discontinuous gradients as continuous fields, by L² projection over deformable cells.

The gradient of a linear pressure p, recovered as a continuous linear field G and integrated along the edges of each
cell from its vertices, where p is most accurate, gives a quadratic p*. With w = p − ½ G · X and I w its interpolation
at the vertices,

    e_p ≈ p* − p = I w − w,

where p is linear ½ Σ λ_i λ_j (G_i − G_j) · (X_j − X_i) over the edges of a cell.

Source: Zienkiewicz & Zhu (doi:10.1002/nme.1620240206).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fenicsmech.compat import (
    assemble_matrix,
    assemble_vector,
    compile_expression,
    compile_form,
    interpolation_points,
    owned_values,
    scalar_space,
    vector_space,
)
from fenicsmech.elasticity import ElasticBody
from fenicsmech.meshing import on_mid_plane
from fenicsmech.model import MechanismModel


class Recovery:
    """The projection to continuous fields of one degree.

    Args:
        model: the discretised mechanism.
        degree: of the fields.
    """

    def __init__(self, model: MechanismModel, degree: int) -> None:
        self._elastic, self._comm, self._degree = model.elastic, model.mesh.comm, degree

    def project(self, right_hand_side, field: fem.Function, work: fem.Function, odd: Sequence[bool]) -> None:
        """Sets ``field`` to the projection with the given compiled right-hand side.

        Args:
            right_hand_side: a linear form on the field's space.
            field: of the degree of this projection, with any number of components.
            work: another one on the same space, for sums.
            odd: mask of components odd across the mid-plane: they vanish there where only one half is meshed.
        """
        right = assemble_vector(right_hand_side, work)
        values, part = self._mass.createVecs()
        for k, vanishes in enumerate(odd):
            part.array_w[:] = right[k :: len(odd)]
            solver = self._solver
            if vanishes and self._elastic.model.half:
                part.array_w[self._mid_plane] = 0.0
                solver = self._solver_off_mid_plane
            solver.solve(part, values)
            owned_values(field)[k :: len(odd)] = values.array_r
        field.x.scatter_forward()

    @cached_property
    def _mass(self) -> PETSc.Mat:
        """The mass matrix over the cells that can deform."""
        V = scalar_space(self._elastic.mesh, self._degree)
        test, trial = ufl.TestFunction(V), ufl.TrialFunction(V)
        mass = assemble_matrix(compile_form(test * trial * self._elastic.free(2 * self._degree)), self._comm)
        diagonal = mass.getDiagonal()
        # vertices inside interfaces, where nothing deforms
        diagonal.array_w[diagonal.array_r == 0.0] = 1.0
        mass.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        mass.setDiagonal(diagonal)
        return mass

    @cached_property
    def _solver(self) -> PETSc.KSP:
        return _solver_of(self._mass)

    @cached_property
    def _mid_plane(self) -> np.ndarray:
        """This rank's owned nodes on the mid-plane."""
        V = scalar_space(self._elastic.mesh, self._degree)
        owned = V.dofmap.index_map.size_local
        return np.flatnonzero(on_mid_plane(V.tabulate_dof_coordinates()[:owned], V.mesh.comm)).astype(PETSc.IntType)

    @cached_property
    def _solver_off_mid_plane(self) -> PETSc.KSP:
        """Solver for components that vanish on the mid-plane."""
        mass = self._mass.copy()
        mass.zeroRowsColumns(mass.getOwnershipRange()[0] + self._mid_plane)
        return _solver_of(mass)


class PressureError:
    """e_p of one field of pressures.

    Args:
        elastic: the links.
        field: their pressure, or its adjoint.
        recovery: of degree 1.

    Attributes:
        error: e_p, symbolic, of the values of the field at the last ``update``.
    """

    def __init__(self, elastic: ElasticBody, field: fem.Function, recovery: Recovery) -> None:
        self._recovery, self._dim = recovery, elastic.model.dim
        self._gradient = fem.Function(vector_space(elastic.mesh, 1), name=f"recovered_gradient_of_{field.name}")
        self._sums = fem.Function(self._gradient.function_space)
        test = ufl.TestFunction(self._gradient.function_space)
        self._right = compile_form(ufl.inner(ufl.grad(field), test) * elastic.free(2))
        w = field - 0.5 * ufl.dot(self._gradient, ufl.SpatialCoordinate(elastic.mesh))
        V = scalar_space(elastic.mesh, 1)
        self._interpolated = fem.Function(V, name=f"interpolated_{field.name}")
        self._expression = compile_expression(w, interpolation_points(V), elastic.mesh.comm)
        self.error = self._interpolated - w

    def update(self) -> None:
        """Follows the field."""
        self._recovery.project(self._right, self._gradient, self._sums, [k == 2 for k in range(self._dim)])
        self._interpolated.interpolate(self._expression)
        self._interpolated.x.scatter_forward()


def _solver_of(mass: PETSc.Mat) -> PETSc.KSP:
    solver = PETSc.KSP().create(mass.comm)
    solver.setOperators(mass)
    solver.setType("cg")
    solver.getPC().setType("jacobi")
    solver.setTolerances(rtol=1e-8)
    return solver
