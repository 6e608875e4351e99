"""Sensitivities of an equilibrium: derivatives by design field, moduli and force, one adjoint per output.

At an equilibrium F(y, p) = Gᵀ ∇L = 0 with y = (s, λ). For an output O(y), with its adjoint x,

    K x = ∂O/∂y,     dO/dp = −xᵀ ∂F/∂p.

With û = ∂u/∂y · x at all nodes, pressures included where links have some of their own, and ẑ the poses' part of x,

    xᵀ ∂F/∂d = ∂(r · û)/∂d  +  Σ_i over interface nodes [ (K_uu û)_i · (R − I) + r_i · (ẑ_r ∂R/∂r) ] ∂X_i/∂d.

The first part is a form, differentiated symbolically: elements, and effects whose energy is a form, depend on X₀ + d.
The second part is derived by hand. An interface node moves with its body, u_i = t + (R − I)(X_i − X_b): where it was
drawn enters its displacement through G, which is not a form. Nor is the work of forces at points; they stay at
the same place of their cell, or of their body, so that it depends on d through the displacements of nodes alone, and
the nodal forces r hold it.

Source: implicit function theorem, equations 8 and 9 of the paper this package follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import assemble_vector, compile_form, destroy_garbage, owned_values
from fenicsmech.equilibrium import Adjoint, Iteration, Linearisation, LoadControl, PointLoad, State
from fenicsmech.model import MechanismModel


@dataclass(frozen=True)
class Gradient:
    """Derivatives of one scalar output.

    Attributes:
        design: with respect to the design field, this rank's owned P1 values, flat.
        parameters: with respect to the parameters of the links' laws, by name, (links,).
        force: with respect to the controlled force.
    """

    design: np.ndarray
    parameters: dict[str, np.ndarray]
    force: float


class Sensitivity:
    """Sensitivities at equilibria of one model under one controlled force."""

    def __init__(self, model: MechanismModel, newton: Iteration) -> None:
        self._model, self._newton = model, newton
        self._weights = [fem.Function(field.function_space, name="adjoint") for field in model.elastic.fields]

    def gradients(self, state: State, outputs: list[PointLoad]) -> list[Gradient]:
        """The derivatives of the travel of each of ``outputs`` at the equilibrium ``state``."""
        at = self._newton.linearise(state, LoadControl(state.force))
        gradients = [self._gradient(at, output) for output in outputs]
        destroy_garbage(self._model.mesh.comm)
        return gradients

    def _gradient(self, at: Linearisation, output: PointLoad) -> Gradient:
        adjoint = Adjoint.of_travel(at, output)
        for field, values in zip(self._weights, self._model.elastic.split(adjoint.nodal), strict=True):
            owned_values(field)[:] = values
            field.x.scatter_forward()

        stiff = self._assemble("displacement")
        moved = self._model.design_nodes.transpose(self._interface_terms(at, adjoint.poses, stiff))
        return Gradient(
            design=-(self._assemble("design") + moved),
            parameters={name: -self._per_link(name) for name in self._model.elastic.parameters},
            force=adjoint.x.dot(at.travel_gradient(self._newton.system.controlled)),
        )

    def _interface_terms(self, at: Linearisation, z: np.ndarray, stiff: np.ndarray) -> np.ndarray:
        """(R − I)ᵀ (K_uu û)_i + (ẑ_r ∂R/∂r)ᵀ r_i at owned interface nodes, (owned nodes, dim)."""
        interfaces, joints = self._model.interfaces, self._model.linkage.joints
        dim = joints.space.dim
        stiff, forces = (values.reshape(-1, interfaces.block) for values in (stiff, at.residual.nodal))
        nodal = np.zeros_like(stiff)
        for body, nodes in interfaces.nodes.items():
            mine = nodes[nodes < interfaces.owned]
            turn = np.einsum(
                "a,aij->ij", z[joints.columns[body]][dim:], joints.space.rotation_gradient(at.state.poses[body])
            )
            back = joints.space.rotation_increment(at.state.poses[body])
            nodal[mine, :dim] = stiff[mine, :dim] @ back + forces[mine, :dim] @ turn
        return nodal

    @cached_property
    def _forms(self) -> dict[str, tuple[Any, fem.Function]]:
        """r · û, differentiated by design, displacement and moduli, and where each derivative is assembled."""
        elastic = self._model.elastic
        fields = {"design": elastic.d, "displacement": elastic.u, **elastic.parameters}
        weighted = zip(elastic.fields, self._weights, strict=True)
        first, *more = (ufl.derivative(elastic.energy_ufl, field, weight) for field, weight in weighted)
        work = sum(more, start=first)
        with self._model.clock.phase("compile"):
            return {
                name: (compile_form(ufl.derivative(work, field)), fem.Function(field.function_space))
                for name, field in fields.items()
            }

    def _assemble(self, name: str) -> np.ndarray:
        with self._model.clock.phase("adjoint"):
            return assemble_vector(*self._forms[name])

    def _per_link(self, name: str) -> np.ndarray:
        cells = self._assemble(name)
        link = self._model.mesh.link[: len(cells)]
        sums = np.bincount(link, weights=cells, minlength=len(self._model.mechanism.flexible_links))
        return self._model.mesh.mesh.comm.allreduce(sums, op=MPI.SUM)
