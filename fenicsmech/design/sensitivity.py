"""Adjoint sensitivities of an equilibrium: design field, moduli and force, one linear solve per output.

At an equilibrium F(y, p) = Gᵀ ∇L = 0 with y = (s, λ). For an output O(y), with the symmetric KKT matrix ∂F/∂y,

    KKT x = ∂O/∂y,     dO/dp = −xᵀ ∂F/∂p.

With û = ∂u/∂y · x at all nodes, pressures included where links have some of their own, and ẑ the poses' part of x,

    xᵀ ∂F/∂d = ∂(r · û)/∂d  +  Σ_i over interface nodes [ (K û)_i · (R − I) + r_i · (ẑ_r ∂R/∂r) ] ∂X_i/∂d,

the second part because an interface node's displacement depends on where it was drawn. Source: implicit function
theorem, equations 8 and 9 of the paper this package follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import assemble_vector, compile_form, destroy_garbage, owned_values
from fenicsmech.equilibrium import Iteration, LoadControl, PointLoad, State
from fenicsmech.simulation import MechanismModel


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


class Adjoint:
    """Sensitivities at equilibria of one model under one controlled force."""

    def __init__(self, model: MechanismModel, newton: Iteration) -> None:
        self._model, self._newton, self._system = model, newton, newton.system
        self._weights = [fem.Function(field.function_space, name="adjoint") for field in model.elastic.fields]

    def gradients(self, state: State, outputs: list[PointLoad], *, floor: float = 0.0) -> list[Gradient]:
        """The derivatives of the travel of each of ``outputs`` at the equilibrium ``state`` (collective)."""
        system, control = self._system, LoadControl(state.force)
        system.load(state)
        balance = system.balance(state, control)
        forces = system.nodal_forces()
        self._newton.factor(state, control, balance, floor)
        gradients = [self._gradient(state, output, forces) for output in outputs]
        destroy_garbage(system.layout.comm)
        return gradients

    def _gradient(self, state: State, output: PointLoad, forces: np.ndarray) -> Gradient:
        system = self._system
        right = system.travel_gradient(output, state)
        x = self._newton.solve_linear(right)
        u, z = system.unknowns.push(x), system.unknowns.step(x).z
        for field, values in zip(self._weights, self._model.elastic.split(u), strict=True):
            owned_values(field)[:] = values
            field.x.scatter_forward()

        stiff = self._assemble("displacement")
        moved = self._model.design_nodes.transpose(self._interface_terms(state, z, stiff, forces))
        return Gradient(
            design=-(self._assemble("design") + moved),
            parameters={name: -self._per_link(name) for name in self._model.elastic.parameters},
            force=x.dot(system.force_rate(state)),
        )

    def _interface_terms(self, state: State, z: np.ndarray, stiff: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """(R − I)ᵀ (K û)_i + (ẑ_r ∂R/∂r)ᵀ r_i at owned interface nodes, (owned nodes, dim)."""
        interfaces, joints = self._model.interfaces, self._model.linkage.joints
        dim = joints.space.dim
        stiff, forces = stiff.reshape(-1, interfaces.block), forces.reshape(-1, interfaces.block)
        nodal = np.zeros_like(stiff)
        for body, nodes in interfaces.nodes.items():
            mine = nodes[nodes < interfaces.owned]
            turn = np.einsum(
                "a,aij->ij", z[joints.columns[body]][dim:], joints.space.rotation_gradient(state.poses[body])
            )
            back = joints.space.rotation_increment(state.poses[body])
            nodal[mine, :dim] = stiff[mine, :dim] @ back + forces[mine, :dim] @ turn
        return nodal

    @cached_property
    def _by(self) -> dict[str, fem.Function]:
        """What r · û is differentiated by."""
        elastic = self._model.elastic
        return {"design": elastic.d, "displacement": elastic.u, **elastic.parameters}

    @cached_property
    def _sums(self) -> dict[str, fem.Function]:
        """Where the derivatives are assembled."""
        return {name: fem.Function(field.function_space) for name, field in self._by.items()}

    @cached_property
    def _forms(self) -> dict:
        """r · û, differentiated by the design, the displacement and the moduli."""
        elastic = self._model.elastic
        works = [
            ufl.derivative(elastic.energy_ufl, field, weight)
            for field, weight in zip(elastic.fields, self._weights, strict=True)
        ]
        work = sum(works[1:], start=works[0])
        with self._model.clock.phase("compile"):
            return {name: compile_form(ufl.derivative(work, field)) for name, field in self._by.items()}

    def _assemble(self, name: str) -> np.ndarray:
        with self._model.clock.phase("adjoint"):
            return assemble_vector(self._forms[name], self._sums[name])

    def _per_link(self, name: str) -> np.ndarray:
        cells = self._assemble(name)
        link = self._model.mesh.link[: len(cells)]
        sums = np.bincount(link, weights=cells, minlength=len(self._model.mechanism.flexible_links))
        return self._model.mesh.mesh.comm.allreduce(sums, op=MPI.SUM)
