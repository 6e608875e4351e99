"""How far a displacement is from that of infinitely fine elements on the same outline: a goal-oriented estimate.

With the errors e_u of the displacement and e_z of its adjoint z (the answer to a unit of the force), to first order

    Q(u) − Q(u_h) = ∫ ∇e_u : ∂²W/∂F∂F : ∇e_z dV.

Their gradients are estimated by what recovery by averaging adds: G is the L² projection of the gradient to continuous
fields of the gradient's degree (at least 1), over all cells that can deform,

    ∇e ≈ c (G(∇u_h) − ∇u_h),

where only one half of the links is meshed with G₁₃ = G₂₃ = G₃₁ = G₃₂ = 0 on the mid-plane, as symmetry has it, and
with c² measured once per order on five problems, see ``_CALIBRATION``. Sources: Zienkiewicz & Zhu
(doi:10.1002/nme.1620240206) for the recovery, Oden & Prudhomme (doi:10.1016/S0898-1221(00)00317-5) for the goal.

Not included: the difference between models in the plane and in space, see ``depth_error``; and, with elements of order
1, that polygons stand for curved outlines.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fenicsmech.compat import (
    assemble_matrix,
    assemble_vector,
    compile_form,
    destroy_garbage,
    owned_values,
    scalar_space,
    tensor_space,
)
from fenicsmech.equilibrium import Iteration
from fenicsmech.linkage import Freedom
from fenicsmech.meshing.mid_plane import on_mid_plane
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.influence import influence
from fenicsmech.simulation.model import MechanismModel

_CALIBRATION = {1: 1.3, 2: 1.6, 3: 2.6}  # c², so that effectivities lie around 1 (tests/simulation/test_goal_error.py)
_WITH_PRESSURE = 1.0  # c² where links have a pressure of their own, the error of which is left out


class GoalError:
    """Error estimates of the travel of one force's point; all methods are collective.

    Args:
        model: of the simulation.
        newton: its solver for this force.
    """

    def __init__(self, model: MechanismModel, newton: Iteration) -> None:
        self._model, self._newton, elastic = model, newton, model.elastic
        self._adjoint = fem.Function(elastic.u.function_space, name="adjoint")
        tensors = tensor_space(elastic.mesh, self._degree)
        self._recovered = [fem.Function(tensors, name=name) for name in ("recovered_gradient", "recovered_adjoint")]
        self._sums = fem.Function(tensors)

    def estimate(self, frame: Frame, freedom: Freedom) -> float:
        """Q(u) − Q(u_h) of a frame."""
        model = self._model
        with model.clock.phase("estimate"), influence(model, self._newton, frame, freedom) as z:
            owned_values(self._adjoint)[:] = model.elastic.split(z)[0]
            self._adjoint.x.scatter_forward()
            for field, form in zip(self._recovered, self._gradient_forms, strict=True):
                self._project(form, field)
            energy = model.mesh.mesh.comm.allreduce(fem.assemble_scalar(self._error_form))
        destroy_garbage(model.mesh.comm)
        plain = model.elastic.pressure is None
        return (_CALIBRATION[model.elastic.order] if plain else _WITH_PRESSURE) * float(energy)

    def _project(self, form, field: fem.Function) -> None:
        """Makes ``field`` the L² projection whose right-hand side ``form`` is."""
        right = assemble_vector(form, self._sums)
        values, part = self._mass.createVecs()
        components, dim = field.function_space.dofmap.index_map_bs, self._model.elastic.model.dim
        for k in range(components):
            part.array_w[:] = right[k::components]
            solver = self._solver
            if self._model.elastic.model.symmetric and (k // dim == 2) != (k % dim == 2):
                part.array_w[self._mid_plane] = 0.0
                solver = self._solver_off_mid_plane
            solver.solve(part, values)
            owned_values(field)[k::components] = values.array_r
        field.x.scatter_forward()

    @cached_property
    def _mass(self) -> PETSc.Mat:
        """The mass matrix of continuous fields over the cells that can deform."""
        V = scalar_space(self._model.elastic.mesh, self._degree)
        test, trial = ufl.TestFunction(V), ufl.TrialFunction(V)
        mass = assemble_matrix(compile_form(test * trial * self._free(2 * self._degree)), self._model.mesh.comm)
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
        V = scalar_space(self._model.elastic.mesh, self._degree)
        owned = V.dofmap.index_map.size_local
        return np.flatnonzero(on_mid_plane(V.tabulate_dof_coordinates()[:owned], V.mesh.comm)).astype(PETSc.IntType)

    @cached_property
    def _solver_off_mid_plane(self) -> PETSc.KSP:
        """For fields that vanish on the mid-plane."""
        mass = self._mass.copy()
        mass.zeroRowsColumns(mass.getOwnershipRange()[0] + self._mid_plane)
        return _solver_of(mass)

    @cached_property
    def _gradient_forms(self) -> list:
        """Right-hand sides of the projections of H(u) and H(z)."""
        test = ufl.TestFunction(self._recovered[0].function_space)
        return [compile_form(ufl.inner(H, test) * self._free(2 * self._degree)) for H in self._gradients]

    @cached_property
    def _error_form(self):
        """∫ (G − H)(u) : ∂²W/∂F∂F : (G − H)(z) dV."""
        errors = [field - H for field, H in zip(self._recovered, self._gradients, strict=True)]
        return compile_form(self._model.elastic.curvature(*errors, degree=2 * self._degree))

    @property
    def _gradients(self) -> list:
        elastic = self._model.elastic
        return [elastic.gradient(elastic.u), elastic.gradient(self._adjoint)]

    @property
    def _degree(self) -> int:
        """Of the recovered gradient."""
        return max(self._model.elastic.order - 1, 1)

    def _free(self, degree: int) -> ufl.Measure:
        return self._model.elastic.free(degree)


def _solver_of(mass: PETSc.Mat) -> PETSc.KSP:
    solver = PETSc.KSP().create(mass.comm)
    solver.setOperators(mass)
    solver.setType("cg")
    solver.getPC().setType("jacobi")
    solver.setTolerances(rtol=1e-8)
    return solver
