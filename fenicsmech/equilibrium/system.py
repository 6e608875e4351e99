"""The equilibrium equations of a mechanism and their KKT matrix.

    L(s, λ, f) = E(u(s)) + V(z) − Σ loads − f (a · u_P) − λᵀ C(s) − ½ λᵀ c λ,     s = (u_free, z)

    residual   Gᵀ ∇L,     KKT matrix   Gᵀ ∇²L G,     x ↦ (u, z, λ, f) = G x

E is the energy of links and effects; where links are in u–p form, u stands for (u, p) and E is a saddle. The other
terms of L are those of ``border``, the blocks of the equations those of ``unknowns``, their matrix that of ``kkt``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.collective import from_one
from fenicsmech.compat import destroy_garbage
from fenicsmech.effects import OneSided, TouchingPoints
from fenicsmech.elasticity import ElasticBody, PredictedStress
from fenicsmech.equilibrium.active_set import ActiveSet
from fenicsmech.equilibrium.border import BorderTerms, PointLoad
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.kkt import KktMatrix, create_extended_matrix
from fenicsmech.equilibrium.spinning import SpinningLinks
from fenicsmech.equilibrium.state import State, Step, load_fields
from fenicsmech.equilibrium.turning import TurningLink, TurningLinks
from fenicsmech.equilibrium.unknowns import Numbering, ScaledUnknowns
from fenicsmech.log import Clock
from fenicsmech.multibody import InterfaceMap, JointSystem, PosePotential, Spin

_SHARED = ("u", "multipliers", "force", "motors", "load_factor")  # of states and steps


@dataclass(frozen=True)
class Residual:
    """The gradient of the Lagrangian at a state.

    Attributes:
        vector: Gᵀ ∇L, dimensionless.
        norm: its norm.
        forces: norm of the loads and reactions that should cancel in it.
        gap: largest violation of a joint, over the mechanism's length, or rad.
        motion: largest displacement from the drawn configuration over the mechanism's length, or rotation.
        moments: Σ r_i ⊗ (X_i − c) of each interface body.
        nodal: r = ∂E/∂u minus the loads on links, (owned displacements,).
        rigid: ∂L/∂z without the nodes that bodies move, (size,).
    """

    vector: PETSc.Vec
    norm: float
    forces: float
    gap: float
    motion: float
    moments: dict[int, np.ndarray]
    nodal: np.ndarray
    rigid: np.ndarray


class EquilibriumSystem:
    """Energy, residual and KKT matrix at a state.

    Args:
        elastic: the flexible links.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        links: bodies and nodes of each flexible link.
        controlled: the load whose magnitude f is controlled.
        loads: constant ones, whose magnitudes states hold.
        potentials: of body poses.
        compliances: c by constraint row; 0 where none is given.
        idle: spins that nothing but obstacles resists, whose gauge K fixes where their links touch none.
        resisted: spins that loads or obstacles may resist, each with the owned nodes of its flexible links.
        one_sided: constraints on links, whose energy is in that of the links.
        clock: of the phases.
        comm: the processes that share the links.

    Attributes:
        numbering: of rows and unknowns.
        blocks: of the unknowns.
        unknowns: x and G, at the poses of the last ``residual``.
        kkt: the KKT matrix last linearised; take it before another ``residual``.
        spinning: links whose spins loads or obstacles may resist.
        surfaces: of ``one_sided``.
        contact: the points of these, and those of rigid links; None without any.
    """

    def __init__(
        self,
        elastic: ElasticBody,
        interfaces: InterfaceMap,
        joints: JointSystem,
        links: Sequence[TurningLink],
        *,
        controlled: PointLoad,
        loads: Sequence[PointLoad] = (),
        potentials: Sequence[PosePotential] = (),
        compliances: Mapping[int, float] = MappingProxyType({}),
        idle: Sequence[Spin] = (),
        resisted: Sequence[tuple[Spin, np.ndarray]] = (),
        one_sided: Sequence[OneSided] = (),
        clock: Clock,
        comm: MPI.Comm,
    ) -> None:
        destroy_garbage(comm)  # objects of earlier systems
        self.elastic, self.interfaces, self.joints = elastic, interfaces, joints
        self.controlled, self.clock, self.comm = controlled, clock, comm
        self.numbering = numbering = Numbering(comm, interfaces, joints, elastic.pressure)
        self.blocks = numbering.unknowns
        self.spinning = SpinningLinks(resisted, interfaces, joints)
        self._turning = TurningLinks(links, interfaces, joints, comm)
        self.idle, self.potentials, self.surfaces = tuple(idle), tuple(potentials), tuple(one_sided)
        self.compliances = np.array([compliances.get(row, 0.0) for row in range(joints.rows)])
        self._border = BorderTerms(
            elastic, joints, numbering, controlled, loads, potentials=potentials, compliances=self.compliances
        )
        with clock.phase("compile"):
            elastic.compile()
        with clock.phase("setup"):
            elastic.take(np.zeros(numbering.rows.links.count))
            elastic.update()
            extended = create_extended_matrix(
                elastic, numbering, self._border.pattern([*self.idle, *self.spinning.spins])
            )
            self.unknowns = ScaledUnknowns(elastic, numbering, interfaces, joints, extended.getDiagonal().array_r)
            self.kkt = KktMatrix(elastic, numbering, self.unknowns, extended, clock=clock)
            rigid = [
                (own, joints.columns[own.bodies[0]])
                for own in potentials
                if isinstance(own, TouchingPoints) and own.bodies[0] in joints.columns
            ]
            self.contact = ActiveSet(one_sided, rigid, self.unknowns, comm) if one_sided or rigid else None

    @cached_property
    def _predicted_stress(self) -> PredictedStress:
        return PredictedStress(self.elastic)

    @property
    def ideal_compliance(self) -> float:
        """Displacement per force that counts as none, over the mechanism's length: that of ideal joints."""
        return 1e-6 * self.joints.length / self.unknowns.unit**2

    @property
    def rigid_rows(self) -> np.ndarray:
        """Constraints without compliance, (n,)."""
        return np.flatnonzero(self.compliances == 0.0)

    @property
    def negative_where_stable(self) -> int:
        """Negative eigenvalues of K where stable: one per multiplier and pressure, one for the controlled force."""
        return self.joints.rows + 1 + self.blocks.pressures.size

    # -- states --------------------------------------------------------------------------------------------

    def moved(self, state: State, step: Step) -> State:
        """``state`` plus ``step``: rotations back on their manifold, interface nodes on their bodies."""
        if self.spinning.spins:
            u, poses = self.spinning.turned(state, step)
        else:
            u, poses = (
                state.u + step.u,
                self.joints.with_unknowns(state.poses, self.joints.unknowns(state.poses) + step.z),
            )
        return self._after(state, step, u, poses)

    def turned(self, state: State, step: Step) -> State:
        """``state`` after ``step``, the turns of links as rotations, and joints as far closed as by the step itself."""
        return self._after(state, step, *self._turning.turned(state, step))

    def _after(self, state: State, step: Step, u: np.ndarray, poses: np.ndarray) -> State:
        """``state`` plus ``step`` with displacements ``u`` and ``poses``, loaded."""
        sums = {name: getattr(state, name) + getattr(step, name) for name in _SHARED}
        moved = replace(state, poses=poses, **{**sums, "u": u})
        self.load(moved)
        return replace(moved, u=self.elastic.values())

    def pressed(self, state: State, step: Step) -> tuple[State, Step]:
        """``state`` with the pressures that ``step`` leads to, and the rest of ``step``. Local."""
        if self.elastic.pressure is None:
            return state, step
        pressures, u, rest = self.numbering.rows.pressures.local, state.u.copy(), step.u.copy()
        u[pressures] += step.u[pressures]
        rest[pressures] = 0.0
        return replace(state, u=u), replace(step, u=rest)

    def load(self, state: State) -> None:
        """Makes the finite-element fields hold ``state``."""
        load_fields(self.elastic, self.interfaces, state)
        if self.contact is not None:
            self.contact.poses = state.poses

    def touching(self, state: State) -> np.ndarray:
        """Loads ``state``, and says whether each of this rank's points touches an obstacle there, (n,). Local."""
        if self.contact is None:
            return np.zeros(0, bool)
        self.load(state)
        return self.contact.touching()

    def difference(self, later: State, earlier: State) -> Step:
        """``later`` − ``earlier``. Local."""
        z = self.joints.unknowns(later.poses) - self.joints.unknowns(earlier.poses)
        return Step(z=z, **{name: getattr(later, name) - getattr(earlier, name) for name in _SHARED})

    def settled_difference(self, later: State, earlier: State) -> Step:
        """``later`` − ``earlier`` without the turns of links that spin loosely in ``later``. Local."""
        return self.difference(self.spinning.turned_back(later, earlier) if later.loose else later, earlier)

    def settled(self, step: Step, state: State) -> Step:
        """``step`` from ``state`` without the turns of links that spin loosely there. Local."""
        return self.spinning.unspun(state, step) if state.loose else step

    def independent(self, step: Step, state: State) -> Step:
        """``step`` to ``state`` without the displacements of nodes that bodies move, and of links that spin loosely:
        these turn at once, whatever little changes. Local."""
        free, u = self.numbering.free, np.zeros_like(step.u)
        u[free] = step.u[free]
        step = replace(step, u=u)
        return self.spinning.without(step) if state.loose else step

    def size(self, step: Step) -> float:
        """Largest displacement over the mechanism's length, or rotation, in ``step``."""
        return max(self.comm.allgather(self._size(step)))

    def _size(self, step: Step) -> float:
        """``size`` of the bodies and this rank's nodes. Local."""
        displacements = step.u[self.numbering.rows.nodes.local]
        nodes = float(np.max(np.abs(displacements), initial=0.0)) / self.joints.length
        bodies = float(np.max(np.abs(step.z / self.joints.pose_scale), initial=0.0))
        return max(nodes, bodies)

    def mean_product(self, a: Step, b: Step) -> float:
        """Mean product of two motions of free nodes and bodies, displacements over the mechanism's length."""
        free, joints = self.numbering.free[self.blocks.nodes.local], self.joints
        # of bodies, whose motions all know, the product of one process: decisions depend on it
        bodies = float(np.sum(a.z * b.z / joints.pose_scale**2)) if self.comm.rank == 0 else 0.0
        own = np.array([float(a.u[free] @ b.u[free]) / joints.length**2, float(len(free)), bodies])
        nodes, count, bodies = self.comm.allreduce(own)
        return nodes / max(count, 1.0) + bodies / max(len(a.z), 1)

    # -- values at the loaded state ------------------------------------------------------------------------

    def elastic_energy(self) -> float:
        """E_int; NaN where an element is inverted."""
        with self.clock.phase("energy"):
            return self.elastic.energy()

    def load_displacement(self, state: State) -> float:
        """a · u_P, the travel of the controlled force's point."""
        return self._border.travel(self.controlled, state)

    def potential(self, state: State, force: float) -> float:
        """E_int + V − Σ loads − f a · u_P with ``force`` for f."""
        return self.elastic_energy() + self._border.pose_potential(state) - self._border.work(state, force)

    def nodal_loads(self, state: State) -> np.ndarray:
        """The nodal forces of loads on links at ``state``, without those of effects, (owned displacements,). Local."""
        links, _ = self._border.load_forces(self._border.loads(state), state)
        return links[self.numbering.rows.nodes.local]

    def volume_violation(self) -> float:
        """Norm of ∂E/∂p of the loaded state in scaled units."""
        if self.elastic.pressure is None:
            return 0.0
        links = self.elastic.residuals()[self.numbering.free] * self.unknowns.units[self.blocks.links.local]
        missed = links[self.blocks.pressures.local]
        return float(np.sqrt(self.comm.allreduce(float(missed @ missed))))

    def without_self_stress(self, state: State) -> State:
        """``state`` with the least of all multipliers that balance the same forces."""
        on_joints = state.multipliers, state.poses, state.motors, self.compliances
        # of one process: their number of self-stresses is a decision that depends on rounding
        least = from_one(self.comm, lambda: self.joints.without_self_stress(*on_joints))
        return replace(state, multipliers=least)

    def constraints(self, state: State, multipliers: np.ndarray) -> np.ndarray:
        """C(s) + c λ at ``multipliers`` λ, (rows,). Local."""
        return self.joints.value(state.poses, state.motors) + self.compliances * multipliers

    def residual(self, state: State, control: Control) -> Residual:
        """Gᵀ ∇L. Brings G to the poses of ``state``.

        links         ∂E/∂(u, p) − loads
        poses         ∂V/∂z − loads − Aᵀ λ
        multipliers   −(C + c λ)
        load          −(a · u_P − v), or 0 where f is given
        """
        with self.clock.phase("residual"):
            self.unknowns.turn(state.poses)
            scale, joints = self.unknowns.scale, self.joints
            r = self.elastic.residuals()
            loads, rigid_loads = self._border.load_forces(self._border.loads(state), state)
            r -= loads
            reactions = joints.gradient(state.poses, state.motors).T @ state.multipliers
            border = -rigid_loads
            poses, multipliers, load = self.blocks.restrict_border(border)
            poses += self._border.pose_gradient(state) - reactions
            violation = self.constraints(state, state.multipliers)
            multipliers[:] = -violation
            if control.constrained:
                load[:] = -control.gap(self, state)
            vector = self.unknowns.apply_transpose(r, border)

            border_forces = np.linalg.norm(rigid_loads * scale) ** 2
            border_forces += np.linalg.norm(reactions * self.blocks.restrict_border(scale).poses) ** 2
            link_forces = float(np.linalg.norm(loads * self.unknowns.unit_u) ** 2)
            gap = float(np.max(np.abs(joints.row_scale * violation), initial=0.0))
            z = joints.unknowns(state.poses) - joints.unknowns(joints.drawn)
            motion = self._size(Step(state.u, z, state.multipliers, state.force))
            # of the border, which all know, those of one process: decisions depend on them
            links, motions, borders = zip(
                *self.comm.allgather((link_forces, motion, (float(border_forces), gap))), strict=True
            )
            border_forces, gap = borders[0]
            forces = math.sqrt(border_forces + sum(links))
            nodal = r[self.numbering.rows.nodes.local]
            moments = self._moments(nodal)
            return Residual(vector, vector.norm(), forces, gap, max(motions), moments, nodal, poses.copy())

    # -- derivatives at the loaded state -------------------------------------------------------------------

    def linearise(
        self,
        state: State,
        control: Control,
        residual: Residual,
        last: tuple[State, np.ndarray] | None = None,
        contact: ActiveSet | None = None,
        *,
        held: bool = False,
    ) -> None:
        """Brings ``kkt`` to the loaded ``state``, with the stress predicted by the ``last`` step if that is given.

        It is the state before the step and δu of owned nodes, linear in it on interface nodes too, (owned dofs,).
        Points touch obstacles as the state has it, or as ``contact`` expects; links with such points do not spin idly.
        Spins that loads or obstacles may resist can be ``held``.
        """
        self.kkt.set_stiffness()
        moments = residual.moments
        if contact is not None:
            with self.clock.phase("assemble"):
                contact.add_stiffness(self.kkt.extended)
        if last is not None:
            with self.clock.phase("assemble"):
                self._predicted_stress.take(last[0].u, last[1])
                self._predicted_stress.add_stiffness(self.kkt.extended)
                moments = _added(moments, self._moments(self._predicted_stress.forces()))
        idle = self._now_idle(expected=contact is not None)
        resisted = self.spinning.spins if held else ()
        fixed = [*resisted, *(spin for spin in idle if spin not in resisted)]
        self.kkt.linearise(self._border.entries(state, control, moments, self.unknowns.scale, fixed))

    def _now_idle(self, *, expected: bool) -> list[Spin]:
        """The idle spins whose links touch no obstacle, or are not ``expected`` to."""
        if not self.idle or self.contact is None:
            return list(self.idle)
        touched = self.contact.touched(expected=expected)
        return [spin for spin in self.idle if spin.links.isdisjoint(touched)]

    def holds(self, state: State) -> list[PETSc.Vec]:
        """h of each spin that loads, or obstacles in the loaded ``state``, resist: K + Σ h hᵀ is that of held ones."""
        idle, found = self._now_idle(expected=False), []
        resisted = [spin for spin in self.spinning.spins if spin not in idle]
        for body, gauge in self._border.gauges(resisted, state, self.unknowns.scale):
            border = np.zeros(self.blocks.border.size)
            self.blocks.restrict_border(border).poses[self.joints.columns[body]] = gauge
            found.append(self.unknowns.apply_transpose(np.zeros(self.numbering.rows.links.count), border))
        return found

    # -- right-hand sides whose KKT solutions are rates of x -----------------------------------------------------

    def travel_gradient(self, load: PointLoad, state: State) -> PETSc.Vec:
        """Right-hand side for the magnitude of a load: Gᵀ ∂(a · u_P), the gradient of its travel by x."""
        return self.unknowns.apply_transpose(*self.travel_slopes(load, state))

    def travel_slopes(self, load: PointLoad, state: State) -> tuple[np.ndarray, np.ndarray]:
        """The gradient of a load's travel by this rank's (u, p), (owned dofs,), and by (z, λ, f), (border,). Local."""
        return self._border.load_forces([(load, 1.0)], state)

    def load_factor_rate(self, state: State) -> PETSc.Vec:
        """Right-hand side for the load factor of the constant loads."""
        links, border = self._border.load_factor_rate(state)
        if self.elastic.depends_on_load_factor:
            links -= self.elastic.load_factor_residuals()
        return self.unknowns.apply_transpose(links, border)

    def border_rate(self, *, poses=0.0, multipliers=0.0, load=0.0) -> PETSc.Vec:
        """Right-hand side that acts on the border alone, by its blocks."""
        border = np.zeros(self.blocks.border.size)
        for part, values in zip(self.blocks.restrict_border(border), (poses, multipliers, load), strict=True):
            part[:] = values
        return self.unknowns.apply_transpose(np.zeros(self.numbering.rows.links.count), border)

    def _moments(self, nodal: np.ndarray) -> dict[int, np.ndarray]:
        """Σ f_i ⊗ (X_i − c) of each interface body, from forces on owned nodes, (owned displacements,)."""
        own = self.interfaces.moments(nodal.reshape(-1, self.numbering.per_node))
        return self.comm.allreduce(own, op=_added)


def _added(a: dict[int, np.ndarray], b: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """Sum of two ranks' moments; a rank may hold no node of some body."""
    return {body: np.sum([own[body] for own in (a, b) if body in own], axis=0) for body in sorted(a.keys() | b.keys())}
