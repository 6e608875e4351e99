"""Sensitivities of quantities at an equilibrium, one adjoint per component.

At an equilibrium F(y, p) = Gᵀ ∇L = 0 with y = (s, λ, f). For a quantity Q(y, p), with its adjoint x,

    K x = ∂Q/∂y,     dQ/dp = ∂Q/∂p − xᵀ ∂F/∂p,     dQ/dv = x · r

where v is the value of the control, whose rate is K⁻¹ r. With û = ∂u/∂y · x at all nodes, pressures included where
links are in u–p form, ẑ the poses' part of x and f̂ that of the controlled force,

    xᵀ ∂F/∂d = ∂(r · û)/∂d  +  Σ_i over interface nodes [ (K_uu û − a f̂)_i · (R − I) + r_i · (ẑ_r ∂R/∂r) ] ∂X_i/∂d.

The first part is a form, differentiated symbolically: elements, and effects whose energy is a form, depend on X.
The second part is derived by hand. An interface node moves with its body, u_i = t + (R − I)(X_i − X_b): where it was
drawn enters its displacement through G, which is not a form; a quantity of such nodes has ∂Q/∂u_i · (R − I) in ∂Q/∂d.
The work of forces at points, a of the controlled one, is not a form either. Such points stay at the same place of their
cell, or of their body: their work depends on d through the displacements of nodes alone, and the nodal forces r contain
it.

Numbers of parts (``number``) add one product with the same x each.

Source: implicit function theorem, equations 8 and 9 of the paper this package follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import destroy_garbage, owned_values
from fenicsmech.equilibrium import Adjoint, Control, EquilibriumSolver, State
from fenicsmech.model import MechanismModel
from fenicsmech.quantities.number import NumberKind, NumberTerms
from fenicsmech.quantities.quantity import FormValue, Observable, Partial, RestObservable


@dataclass(frozen=True, eq=False)
class Gradient:
    """Total derivatives of one component.

    Attributes:
        design: by the design field, this rank's owned values, flat.
        numbers: by the numbers of parts that were requested, (numbers,).
        control: by the value of the control.
    """

    design: np.ndarray
    numbers: np.ndarray
    control: float = 0.0

    def __add__(self, other: Gradient) -> Gradient:
        return Gradient(self.design + other.design, self.numbers + other.numbers, self.control + other.control)

    def __mul__(self, factor: float) -> Gradient:
        return Gradient(factor * self.design, factor * self.numbers, factor * self.control)

    __rmul__ = __mul__


class Sensitivity:
    """Sensitivities at equilibria of one model, which holds their design.

    Args:
        model: the model.
        numbers: with respect to which derivatives are wanted, in addition to those by the design field.
    """

    def __init__(self, model: MechanismModel, numbers: Sequence[NumberKind] = ()) -> None:
        self._model, self._numbers = model, [model.number(kind) for kind in numbers]
        self._weights = [fem.Function(field.function_space, name="adjoint") for field in model.elastic.fields]

    def with_numbers(self, numbers: Sequence[NumberKind]) -> Sensitivity:
        """The same with other numbers, which shares what is compiled."""
        other = Sensitivity(self._model, numbers)
        other._weights, other._work = self._weights, self._work
        return other

    def gradients(
        self, solver: EquilibriumSolver, state: State, control: Control, observables: Sequence[Observable]
    ) -> list[Gradient]:
        """The derivatives of all components of some quantities at an equilibrium.

        Args:
            solver: that found the equilibrium.
            state: the equilibrium.
            control: under which it was found.
            observables: the quantities.
        """
        self._model.load(state)
        partials = [part for own in observables for part in own.partials(solver.system, state)]
        return self.of(solver, state, control, partials)

    def of(
        self, solver: EquilibriumSolver, state: State, control: Control, partials: Sequence[Partial]
    ) -> list[Gradient]:
        """The total derivatives that belong to partial ones."""
        adjoints = self.adjoints(solver, state, control, partials)
        gradients = [self._gradient(*pair) for pair in zip(adjoints, partials, strict=True)]
        destroy_garbage(self._model.mesh.comm)
        return gradients

    def at_rest(self, observable: RestObservable) -> Gradient:
        """The derivatives of a quantity of links at rest."""
        return self._gradient(None, observable.slope())

    def adjoints(
        self, solver: EquilibriumSolver, state: State, control: Control, partials: Sequence[Partial]
    ) -> list[Adjoint | None]:
        """The adjoint of each component, from one factor; None where it does not depend on the state."""
        if not any(partial.of_state for partial in partials):
            return [None] * len(partials)
        at, blocks = solver.linearise(state, control), solver.system.blocks
        nothing = np.zeros(len(state.u)), np.zeros(blocks.border.size)
        return [
            Adjoint.of(at, at.transpose(nothing[0] + own.links, nothing[1] + own.border)) if own.of_state else None
            for own in partials
        ]

    def _gradient(self, adjoint: Adjoint | None, partial: Partial) -> Gradient:
        model = self._model
        design = np.zeros(len(owned_values(model.elastic.shape))) + partial.design
        if adjoint is None:
            return Gradient(design, self._by_numbers(design, None, partial))
        for weight, values in zip(self._weights, model.elastic.split(adjoint.nodal), strict=True):
            owned_values(weight)[:] = values
            weight.x.scatter_forward()
        at, size = adjoint.at, len(adjoint.at.residual.nodal)
        held = adjoint.load * at.controlled_slopes() + partial.links
        stiff = self._work.slope("displacement") - held[:size]
        design -= self._work.slope("design") + model.design_nodes.transpose(self._interface_terms(adjoint, stiff))
        return Gradient(design, self._by_numbers(design, adjoint, partial), adjoint.by_control())

    def _by_numbers(self, design: np.ndarray, adjoint: Adjoint | None, partial: Partial) -> np.ndarray:
        """The derivatives by numbers, of a component whose derivative by the design field is ``design``, (numbers,)."""
        links = len(self._model.mechanism.flexible_links)

        @cache
        def by_link(name: str) -> np.ndarray:
            found = np.zeros(links) + partial.per_link.get(name, 0.0)
            concerned = adjoint is not None and name in self._model.elastic.numbers
            return found - self._work.per_link(name) if concerned else found

        terms = NumberTerms(partial, adjoint, by_link)
        own = np.array([number.through_field(design) for number in self._numbers])
        shares = self._model.mesh.comm.allreduce(own, op=MPI.SUM)
        return shares + [number.slope(terms) for number in self._numbers]

    def _interface_terms(self, adjoint: Adjoint, stiff: np.ndarray) -> np.ndarray:
        """(R − I)ᵀ ``stiff``_i + (ẑ_r ∂R/∂r)ᵀ r_i at owned interface nodes, (owned nodes, dim)."""
        interfaces, joints, at = self._model.interfaces, self._model.linkage.joints, adjoint.at
        dim = joints.space.dim
        stiff, forces = (values.reshape(-1, interfaces.block) for values in (stiff, at.residual.nodal))
        nodal = np.zeros_like(stiff)
        for body, nodes in interfaces.nodes.items():
            mine = nodes[nodes < interfaces.owned]
            turn = np.einsum(
                "a,aij->ij",
                adjoint.poses[joints.columns[body]][dim:],
                joints.space.rotation_gradient(at.state.poses[body]),
            )
            back = joints.space.rotation_increment(at.state.poses[body])
            nodal[mine, :dim] = stiff[mine, :dim] @ back + forces[mine, :dim] @ turn
        return nodal

    @cached_property
    def _work(self) -> FormValue:
        """r · û."""
        elastic = self._model.elastic
        first, *more = (
            ufl.derivative(elastic.energy_ufl, own, weight)
            for own, weight in zip(elastic.fields, self._weights, strict=True)
        )
        by = {"design": elastic.shape, "displacement": elastic.u, **elastic.numbers}
        return FormValue(self._model, sum(more, start=first), by)
