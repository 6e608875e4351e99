"""The equilibrium equations of a mechanism and their KKT matrix, distributed.

    L(s, λ, f) = E(u(s)) + V(z) − Σ loads − f (a · u_P) − λᵀ C(s) − ½ λᵀ c λ,     s = (u_free, z)

    K̂ = [[∂²E/∂u², 0    , 0  , −a_u],          unknowns x = scaled increments of (u_free, z, λ, f):
         [0       , B    , −Aᵀ, −a_z],             x ↦ (u, z, λ, f) = G x,   G = diag(∂u/∂s, 1) · D
         [0       , −A   , −ε−c, 0 ],           KKT = Gᵀ K̂ G,   right-hand side −Gᵀ ∇L
         [−a_uᵀ   , −a_zᵀ, 0  , 0   ]]

Where links have a pressure p of their own, u stands for (u, p) in all of this; E is a saddle then, stationary in p.
B is the curvature of the rigid coordinates, c the compliance of joints, 0 unless an effect softens them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from fenicsmech.clock import Clock
from fenicsmech.compat import destroy_garbage
from fenicsmech.effects import PosePotential
from fenicsmech.elasticity import ElasticBody, MixedStress
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.extras import ExtraEntries
from fenicsmech.equilibrium.fields import load_fields
from fenicsmech.equilibrium.kkt import KktMatrix
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.loads import Loads
from fenicsmech.equilibrium.matrices import create_extended_matrix
from fenicsmech.equilibrium.potentials import BodyPotentials
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.unknowns import ScaledUnknowns
from fenicsmech.multibody import InterfaceMap, JointSystem


@dataclass(frozen=True)
class Residual:
    """The gradient of the Lagrangian at a state.

    Attributes:
        vector: Gᵀ ∇L, dimensionless.
        norm: its norm.
        forces: norm of the loads and reactions that should cancel in it.
        gap: how far joints are from closed, over the mechanism's length, or rad.
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
    """Energy, gradient and KKT matrix at a state.

    Args:
        elastic: the flexible links.
        interfaces: interface nodes as functions of poses.
        joints: the constraints.
        controlled: the load whose magnitude f is controlled.
        loads: fixed loads, with their magnitudes.
        potentials: of body poses.
        compliances: c by constraint row; 0 where none is given.
        clock: where time is counted.
        comm: the processes that share the links.

    Attributes:
        layout: numbering of rows and unknowns.
        unknowns: x and G, at the poses of the last ``residual``.
        kkt: the KKT matrix last linearised; take it before another ``residual``.
        compliances: c, (rows,).
    """

    def __init__(
        self,
        elastic: ElasticBody,
        interfaces: InterfaceMap,
        joints: JointSystem,
        *,
        controlled: PointLoad,
        loads: tuple[tuple[PointLoad, float], ...] = (),
        potentials: Sequence[PosePotential] = (),
        compliances: Mapping[int, float] = MappingProxyType({}),
        clock: Clock,
        comm: MPI.Comm,
    ) -> None:
        destroy_garbage(comm)  # of systems before this one
        self.elastic, self.interfaces, self.joints = elastic, interfaces, joints
        self.controlled, self.clock = controlled, clock
        self.layout = Layout(comm, interfaces, joints, elastic.pressure)
        self._loads = Loads(controlled, loads, elastic, joints, self.layout)
        self._potentials = BodyPotentials(potentials, joints)
        self.compliances = np.array([compliances.get(row, 0.0) for row in range(joints.rows)])
        self._extras = ExtraEntries(joints, self.layout, controlled, self._potentials, self.compliances)
        with clock.phase("compile"):
            elastic.compile()
        with clock.phase("setup"):
            elastic.take(np.zeros(self.layout.owned))
            elastic.update()
            extended = create_extended_matrix(elastic, self.layout, self._extras.pattern())
            self.unknowns = ScaledUnknowns(elastic, self.layout, interfaces, joints, extended.getDiagonal().array_r)
            scale = self.unknowns.scale
            self._extras.set_regularisation(scale[self.layout.multipliers], scale[self.layout.force])
            self.kkt = KktMatrix(elastic, self.layout, self.unknowns, extended, clock=clock)

    @cached_property
    def _mixed(self) -> MixedStress:
        return MixedStress(self.elastic)

    @property
    def rigid_rows(self) -> np.ndarray:
        """Constraints that do not give way, (n,)."""
        return np.flatnonzero(self.compliances == 0.0)

    # -- states --------------------------------------------------------------------------------------------

    def moved(self, state: State, step: Step) -> State:
        """``state`` after ``step``: rotations back on their manifold, interface nodes on their bodies (collective)."""
        poses = self.joints.with_unknowns(state.poses, self.joints.unknowns(state.poses) + step.z)
        moved = replace(
            state,
            u=state.u + step.u,
            poses=poses,
            multipliers=state.multipliers + step.multipliers,
            force=state.force + step.force,
            motors=state.motors + step.motors,
            load_factor=state.load_factor + step.load_factor,
        )
        self.load(moved)
        return replace(moved, u=self.elastic.values())

    def pressed(self, state: State, step: Step) -> tuple[State, Step]:
        """``state`` with the pressures that ``step`` leads to, and the rest of ``step``."""
        first = self.layout.displacements
        if self.elastic.pressure is None:
            return state, step
        u, rest = state.u.copy(), step.u.copy()
        u[first:] += step.u[first:]
        rest[first:] = 0.0
        return replace(state, u=u), replace(step, u=rest)

    def load(self, state: State) -> None:
        """Makes the finite-element fields hold ``state`` (collective)."""
        load_fields(self.elastic, self.interfaces, state)

    def difference(self, later: State, earlier: State) -> Step:
        """``later`` − ``earlier``."""
        return Step(
            later.u - earlier.u,
            self.joints.unknowns(later.poses) - self.joints.unknowns(earlier.poses),
            later.multipliers - earlier.multipliers,
            later.force - earlier.force,
            later.motors - earlier.motors,
            later.load_factor - earlier.load_factor,
        )

    def independent(self, step: Step) -> Step:
        """``step`` without the displacements of nodes that bodies move."""
        free, u = self.layout.free, np.zeros_like(step.u)
        u[free] = step.u[free]
        return replace(step, u=u)

    def size(self, step: Step) -> float:
        """Largest displacement over the mechanism's length, or rotation, in ``step`` (collective)."""
        nodes = float(np.max(np.abs(step.u[: self.layout.displacements]), initial=0.0)) / self.joints.length
        bodies = float(np.max(np.abs(step.z / self.joints.pose_scale), initial=0.0))
        return max(self.layout.comm.allgather(max(nodes, bodies)))

    # -- values at the loaded state ------------------------------------------------------------------------

    def elastic_energy(self) -> float:
        """E_int; NaN where an element is inverted (collective)."""
        with self.clock.phase("energy"):
            return self.elastic.energy()

    def load_displacement(self, state: State) -> float:
        """a · u_P, how far the controlled force's point has moved along it (collective)."""
        return self._loads.travel(self.controlled, state)

    def potential(self, state: State, force: float) -> float:
        """E_int − Σ loads − f a · u_P with ``force`` for f (collective)."""
        return self.elastic_energy() + self._potentials.value(state) - self._loads.work(state, force)

    def volume_violation(self) -> float:
        """Norm of ∂E/∂p of the loaded state in scaled units: by how much volumes miss their pressures (collective)."""
        if self.elastic.pressure is None:
            return 0.0
        layout = self.layout
        missed = (self.elastic.residuals()[layout.free] * self.unknowns.units)[layout.free_displacements :]
        return float(np.sqrt(layout.comm.allreduce(float(missed @ missed))))

    def constraints(self, state: State, multipliers: np.ndarray) -> np.ndarray:
        """C(s) + c λ at ``multipliers`` λ, (rows,)."""
        return self.joints.value(state.poses, state.motors) + self.compliances * multipliers

    def residual(self, state: State, control: Control) -> Residual:
        """Gᵀ ∇L (collective). Brings G to the poses of ``state``."""
        with self.clock.phase("residual"):
            self.unknowns.turn(state.poses)
            layout, scale = self.layout, self.unknowns.scale
            r = self.elastic.residuals()
            loads = np.zeros_like(r)
            g = np.zeros(layout.extras)
            for load, magnitude in self._loads.acting(state):
                self._loads.add(load, magnitude, state, loads, g)
            r -= loads
            reactions = self.joints.gradient(state.poses, state.motors).T @ state.multipliers
            forces = np.linalg.norm(g * scale) ** 2 + np.linalg.norm(reactions * scale[layout.z]) ** 2
            forces += layout.comm.allreduce(float(np.linalg.norm(loads * self.unknowns.unit_u) ** 2))
            nodal = r[: layout.displacements]
            moments = self.interfaces.moments(nodal.reshape(-1, layout.per_node))
            moments = layout.comm.allreduce(moments, op=_add_moments)
            extras = -g
            extras[layout.z] += self._potentials.gradient(state) - reactions
            rigid = extras[layout.z].copy()
            violation = self.constraints(state, state.multipliers)
            extras[layout.multipliers] = -violation
            gap = float(np.max(np.abs(self.joints.row_scale * violation), initial=0.0))
            if control.constrained:
                extras[layout.force] = -(self.load_displacement(state) - control.target)
            vector = self.unknowns.apply_transpose(r, extras)
            return Residual(
                vector, vector.norm(), float(np.sqrt(forces)), gap, self._motion(state), moments, nodal, rigid
            )

    # -- derivatives at the loaded state -------------------------------------------------------------------

    def linearise(self, state: State, control: Control, residual: Residual) -> None:
        """Brings ``kkt`` to the loaded ``state`` (collective)."""
        self.kkt.tangent()
        self._linearise(state, control, residual.moments)

    def linearise_mixed(
        self, state: State, control: Control, residual: Residual, before: State, motion: np.ndarray
    ) -> None:
        """``linearise``, with the stress that the step δu = ``motion`` from ``before`` promised (collective).

        Args:
            state, control, residual: as in ``linearise``.
            before: the state before the step.
            motion: δu of owned nodes, linear in the step on interface nodes too, (owned dofs,).
        """
        with self.clock.phase("assemble"):
            self._mixed.follow(before.u, motion)
            self.kkt.tangent()
            self._mixed.tangent(self.kkt.extended)
            promised = self.interfaces.moments(self._mixed.forces().reshape(-1, self.layout.per_node))
            moments = _add_moments(residual.moments, self.layout.comm.allreduce(promised, op=_add_moments))
        self._linearise(state, control, moments)

    def _linearise(self, state: State, control: Control, moments: dict[int, np.ndarray]) -> None:
        self.kkt.linearise(self._extras.entries(state, control, self._loads.acting(state), moments))

    def travel_gradient(self, load: PointLoad, state: State) -> PETSc.Vec:
        """Gᵀ ∂(a · u_P), of a load's travel with respect to the scaled unknowns x (collective)."""
        nodal, extras = np.zeros(self.layout.owned), np.zeros(self.layout.extras)
        self._loads.add(load, 1.0, state, nodal, extras)
        return self.unknowns.apply_transpose(nodal, extras)

    def load_factor_rate(self, state: State) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the factor of the constant loads (collective)."""
        nodal, extras = np.zeros(self.layout.owned), np.zeros(self.layout.extras)
        for load, magnitude in self._loads.constant:
            self._loads.add(load, magnitude, state, nodal, extras)
        extras[self.layout.z] -= self._potentials.rate(state)
        if self.elastic.shares:
            nodal -= self.elastic.share_residuals()
        return self.unknowns.apply_transpose(nodal, extras)

    def target_rate(self) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the controlled displacement (collective)."""
        extras = np.zeros(self.layout.extras)
        extras[self.layout.force] = -1.0
        return self.unknowns.apply_transpose(np.zeros(self.layout.owned), extras)

    def motor_rate(self, state: State, direction: np.ndarray) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with motor values along ``direction`` (collective)."""
        extras = np.zeros(self.layout.extras)
        rate, twist = self.joints.motor_rate(state.poses, state.motors, state.multipliers, direction)
        extras[self.layout.multipliers], extras[self.layout.z] = rate, twist
        return self.unknowns.apply_transpose(np.zeros(self.layout.owned), extras)

    # -- pieces --------------------------------------------------------------------------------------------

    def _motion(self, state: State) -> float:
        """Largest displacement from the drawn configuration over the mechanism's length, or rotation (collective)."""
        z = self.joints.unknowns(state.poses) - self.joints.unknowns(self.joints.drawn)
        return self.size(Step(state.u, z, state.multipliers, state.force))


def _add_moments(a: dict[int, np.ndarray], b: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """Sum of two ranks' moments; a rank may hold no node of some body."""
    return {body: a.get(body, 0.0) + b.get(body, 0.0) for body in sorted(a.keys() | b.keys())}
