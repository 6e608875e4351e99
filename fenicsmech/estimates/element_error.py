"""Discretisation error of a displacement or force: the difference from infinitely fine elements on the same outline.

With the errors e_u of the displacement and e_z of the adjoint z of the quantity Q, to first order

    Q(u) − Q(u_h) = ∫ ∇e_u : ∂²W/∂F∂F : ∇e_z dV.

Their gradients are estimated by recovery by averaging: G is the L² projection of the gradient to continuous
fields of the gradient's degree (at least 1), see ``recovery``,

    ∇e ≈ c (G(∇u_h) − ∇u_h),

where only one half of the links is meshed with G₁₃ = G₂₃ = G₃₁ = G₃₂ = 0 on the mid-plane, by symmetry. Where
elements are mixed, Π(F, p) takes the place of W, and the other second derivatives follow, with the errors
e_p of p and e_q of its adjoint q (``recovery``):

    + ∫ e_p ∂²Π/∂p∂F : ∇e_z + e_q ∂²Π/∂p∂F : ∇e_u + e_p ∂²Π/∂p² e_q dV.

c² was measured once per order, see ``Calibration``. Sources: Zienkiewicz & Zhu (doi:10.1002/nme.1620240206) for the
recovery, Oden & Prudhomme (doi:10.1016/S0898-1221(00)00317-5) for goal-oriented estimates.

Not included: the difference between models in the plane and in space, see ``plane_stress_error``; and, with elements of
order 1, the approximation of curved outlines by polygons.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property

import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form, destroy_garbage, owned_values, tensor_space
from fenicsmech.equilibrium import Adjoint
from fenicsmech.estimates.recovery import PressureError, Recovery
from fenicsmech.model import MechanismModel


class ElementError:
    """Discretisation errors of quantities of one model, which holds the equilibrium in question.

    Args:
        model: the discretised mechanism.
        calibration: c² of displacement elements by order.
        mixed: c² of elements with a pressure by order.
    """

    def __init__(self, model: MechanismModel, calibration: Mapping[int, float], mixed: Mapping[int, float]) -> None:
        self._model, elastic, order = model, model.elastic, model.elastic.order
        self._squares = [(mixed if own else calibration)[order] for own in model.mixed]
        names = ("adjoint", "adjoint_pressure")
        self._adjoint = [
            fem.Function(field.function_space, name=name) for field, name in zip(elastic.fields, names, strict=False)
        ]
        tensors = tensor_space(elastic.mesh, self._degree)
        self._recovered = [fem.Function(tensors, name=name) for name in ("recovered_gradient", "recovered_adjoint")]
        self._sums = fem.Function(tensors)

    def of(self, adjoint: Adjoint) -> float:
        """Q(u) − Q(u_h), from the adjoint of Q."""
        elastic = self._model.elastic
        for field, values in zip(self._adjoint, elastic.split(adjoint.nodal), strict=True):
            owned_values(field)[:] = values
            field.x.scatter_forward()
        dim = elastic.model.dim
        odd = [(k // dim == 2) != (k % dim == 2) for k in range(dim**2)]
        for field, form in zip(self._recovered, self._gradient_forms, strict=True):
            self._recovery.project(form, field, self._sums, odd)
        for pressure in self._pressures:
            pressure.update()
        error = float(elastic.mesh.comm.allreduce(fem.assemble_scalar(self._error_form)))
        destroy_garbage(self._model.mesh.comm)
        return error

    @cached_property
    def _gradient_forms(self) -> list:
        """Right-hand sides of the projections of H(u) and H(z)."""
        test = ufl.TestFunction(self._recovered[0].function_space)
        measure = self._model.elastic.free(2 * self._degree)
        return [compile_form(ufl.inner(H, test) * measure) for H in self._gradients]

    @cached_property
    def _error_form(self):
        """The sum of all second derivatives of the energy, in the directions of the errors."""
        elastic, degree = self._model.elastic, 2 * self._degree
        A, B = (self._scale * (field - H) for field, H in zip(self._recovered, self._gradients, strict=True))
        form = elastic.curvature(A, B, degree=degree)
        if not self._pressures:
            return compile_form(form)
        p, (e_p, e_q) = elastic.pressure.p, (self._scale * pressure.error for pressure in self._pressures)
        H = ufl.variable(elastic.gradient(elastic.u))
        for work, measure in elastic.densities(H):
            dx, stress = measure(metadata={"quadrature_degree": degree}), ufl.diff(work, H)
            form += ufl.derivative(ufl.inner(stress, B) * dx, p, e_p)
            form += ufl.derivative(ufl.inner(stress, A) * dx, p, e_q)
            form += ufl.derivative(ufl.derivative(work * dx, p, e_p), p, e_q)
        return compile_form(form)

    @cached_property
    def _scale(self) -> fem.Function:
        """c of each cell's link."""
        return self._model.elastic.cellwise([math.sqrt(square) for square in self._squares])

    @cached_property
    def _pressures(self) -> list[PressureError]:
        """Errors of p and its adjoint, where elements are mixed."""
        elastic = self._model.elastic
        if elastic.pressure is None:
            return []
        recovery = self._recovery if self._degree == 1 else Recovery(self._model, 1)
        return [PressureError(elastic, field, recovery) for field in (elastic.pressure.p, self._adjoint[1])]

    @cached_property
    def _recovery(self) -> Recovery:
        return Recovery(self._model, self._degree)

    @property
    def _gradients(self) -> list:
        elastic = self._model.elastic
        return [elastic.gradient(elastic.u), elastic.gradient(self._adjoint[0])]

    @property
    def _degree(self) -> int:
        """Degree of the recovered gradient."""
        return max(self._model.elastic.order - 1, 1)
