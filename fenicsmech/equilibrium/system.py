"""The equilibrium equations of a mechanism and their KKT matrix, distributed.

    L(s, λ, f) = E(u(s)) + V(z) − Σ loads − f (a · u_P) − λᵀ C(s) − ½ λᵀ c λ,     s = (u_free, z)

    K̂ = [[∂²E/∂u², 0    , 0  , −a_u],          unknowns x = scaled increments of (u_free, z, λ, f):
         [0       , B    , −Aᵀ, −a_z],             x ↦ (u, z, λ, f) = G x,   G = diag(∂u/∂s, 1) · D
         [0       , −A   , −ε−c, 0 ],           KKT = Gᵀ K̂ G,   right-hand side −Gᵀ ∇L
         [−a_uᵀ   , −a_zᵀ, 0  , 0   ]]

B is the curvature of the rigid coordinates, c the compliance of joints, 0 unless an effect softens them. One sparse
triple product forms the whole matrix; D makes x dimensionless.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from petsc4py import PETSc

from fenicsmech.bodies import BodyPoint, InterfaceMap, LinkPoint
from fenicsmech.clock import Clock
from fenicsmech.compat import petsc_vector
from fenicsmech.effects import PosePotential
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.extras import ExtraEntries
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.matrices import create_extended_matrix, create_map_matrix, update_map_matrix
from fenicsmech.equilibrium.potentials import BodyPotentials
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.linkage import JointSystem


@dataclass(frozen=True)
class Balance:
    """The gradient of the Lagrangian at a state.

    Attributes:
        vector: Gᵀ ∇L, dimensionless.
        norm: its norm.
        forces: norm of the loads and reactions that should cancel in it.
        moments: Σ r_i ⊗ (X_i − c) of each interface body.
    """

    vector: PETSc.Vec
    norm: float
    forces: float
    moments: dict[int, np.ndarray]


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

    Attributes:
        unit: a residual of this norm is a displacement of the mechanism's length against the mean stiffness.
        unit_u, scale: what a unit of each scaled unknown stands for: displacements; (z, λ, f).
        poses: those of the last ``balance``, which the KKT matrix is at.
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
    ) -> None:
        self.elastic, self.interfaces, self.joints = elastic, interfaces, joints
        self.controlled, self.loads, self.clock = controlled, loads, clock
        self.layout = Layout(elastic.mesh.comm, interfaces, joints)
        self._potentials = BodyPotentials(potentials, joints)
        self._compliances = np.array([compliances.get(row, 0.0) for row in range(joints.rows)])
        self._extras = ExtraEntries(joints, self.layout, controlled, self._potentials, self._compliances)
        self._u = petsc_vector(elastic.u)
        self._nodal = self._u.duplicate()
        with clock.phase("compile"):
            self._forms = (elastic.energy_form, elastic.residual_form, elastic.tangent_form)
        with clock.phase("setup"):
            self._u.set(0.0)
            self._hat = create_extended_matrix(elastic, self.layout, self._extras.pattern())
            # mean diagonal of the stiffness k: D = (ℓ, 1, …) / (ℓ √k) makes the KKT matrix dimensionless
            diagonal = self._hat.getDiagonal().array_r[self.layout.free]
            comm = self.layout.comm
            mean = comm.allreduce(float(diagonal.sum())) / comm.allreduce(len(self.layout.free))
            self.unit = float(np.sqrt(mean)) * joints.length
            self.unit_u = joints.length / self.unit
            self.scale = np.concatenate(
                [joints.pose_scale / self.unit, joints.row_scale * self.unit, [self.unit / joints.length]]
            )
            self._extras.set_regularisation(self.scale[self.layout.multipliers], self.scale[self.layout.force])
            self._map = create_map_matrix(self.layout, interfaces, joints, self.unit_u, self.scale)
        self.poses = joints.drawn
        self._rows = self._hat.createVecLeft()
        self._matrix: PETSc.Mat | None = None
        self._diagonal: PETSc.Vec | None = None

    # -- states --------------------------------------------------------------------------------------------

    def moved(self, state: State, step: Step) -> State:
        """``state`` after ``step``: rotations back on their manifold, interface nodes on their bodies (collective)."""
        z = self.joints.unknowns(state.poses) + step.z
        poses = self.joints.with_unknowns(state.poses, z)
        moved = replace(
            state,
            u=state.u + step.u,
            poses=poses,
            multipliers=state.multipliers + step.multipliers,
            force=state.force + step.force,
        )
        self.load(moved)
        return replace(moved, u=self._u.array_r.copy())

    def load(self, state: State) -> None:
        """Makes the finite-element field hold ``state`` (collective)."""
        self._u.array_w[:] = state.u
        self.elastic.share.value = state.share
        self.elastic.update()
        self.interfaces.place(state.poses)

    def difference(self, later: State, earlier: State) -> Step:
        """``later`` − ``earlier``."""
        return Step(
            later.u - earlier.u,
            self.joints.unknowns(later.poses) - self.joints.unknowns(earlier.poses),
            later.multipliers - earlier.multipliers,
            later.force - earlier.force,
        )

    def size(self, step: Step) -> float:
        """Largest displacement over the mechanism's length, or rotation, in ``step`` (collective)."""
        nodes = float(np.max(np.abs(step.u), initial=0.0)) / self.joints.length
        bodies = float(np.max(np.abs(step.z / self.joints.pose_scale), initial=0.0))
        return max(self.layout.comm.allgather(max(nodes, bodies)))

    # -- values at the loaded state ------------------------------------------------------------------------

    def elastic_energy(self) -> float:
        """E_int; NaN where an element is inverted (collective)."""
        with self.clock.phase("energy"):
            return self.elastic.energy()

    def load_displacement(self, state: State) -> float:
        """a · u_P, how far the controlled force's point has moved along it (collective)."""
        return self._travel(self.controlled, state)

    def potential(self, state: State, force: float) -> float:
        """E_int − Σ loads − f a · u_P with ``force`` for f (collective)."""
        work = force * self._travel(self.controlled, state)
        work += state.share * sum(magnitude * self._travel(load, state) for load, magnitude in self.loads)
        return self.elastic_energy() + self._potentials.value(state) - work

    def constraints(self, state: State, multipliers: np.ndarray) -> np.ndarray:
        """C(s) + c λ at ``multipliers`` λ, (rows,)."""
        return self.joints.value(state.poses, state.motors) + self._compliances * multipliers

    def balance(self, state: State, control: Control) -> Balance:
        """Gᵀ ∇L (collective). Brings G to the poses of ``state``."""
        with self.clock.phase("residual"):
            update_map_matrix(self._map, self.layout, self.interfaces, self.joints, state.poses, self.scale)
            self.poses = state.poses
            self.elastic.residual(self._nodal)
            layout, dim = self.layout, self.joints.space.dim
            r = self._nodal.array_r[: layout.owned].copy()
            loads = np.zeros_like(r)
            g = np.zeros(layout.extras)
            for load, magnitude in self._acting(state):
                self._add_load(load, magnitude, state, loads, g)
            r -= loads
            reactions = self.joints.gradient(state.poses, state.motors).T @ state.multipliers
            forces = np.linalg.norm(g * self.scale) ** 2 + np.linalg.norm(reactions * self.scale[layout.z]) ** 2
            forces += layout.comm.allreduce(float(np.linalg.norm(loads * self.unit_u) ** 2))
            moments = layout.comm.allreduce(self.interfaces.moments(r.reshape(-1, dim)), op=_add_moments)
            extras = -g
            extras[layout.z] += self._potentials.gradient(state) - reactions
            extras[layout.multipliers] = -self.constraints(state, state.multipliers)
            if control.constrained:
                extras[layout.force] = -(self.load_displacement(state) - control.target)
            rows = self._rows.array_w
            rows[: layout.owned] = r
            if layout.last:
                rows[layout.owned : layout.owned + layout.extras] = extras
            vector = self._map.createVecRight()
            self._map.multTranspose(self._rows, vector)
            return Balance(vector, vector.norm(), float(np.sqrt(forces)), moments)

    # -- derivatives at the loaded state -------------------------------------------------------------------

    def kkt(self, state: State, control: Control, balance: Balance) -> PETSc.Mat:
        """The KKT matrix (collective); the same object at every call."""
        layout = self.layout
        with self.clock.phase("assemble"):
            self._hat.zeroEntries()
            self.elastic.tangent(self._hat)
            self._hat.assemble()
            if layout.last:
                entries = self._extras.entries(state, control, self._acting(state), balance.moments)
                for rows, columns, block in entries:
                    # petsc4py reads transposed arrays in memory order
                    self._hat.setValues(
                        rows.astype(PETSc.IntType),
                        columns.astype(PETSc.IntType),
                        np.ascontiguousarray(block),
                        addv=PETSc.InsertMode.ADD,
                    )
            self._hat.assemble()
        with self.clock.phase("project"):
            self._matrix = self._hat.ptap(self._map, result=self._matrix)
            self._diagonal = self._matrix.getDiagonal()
        return self._matrix

    def shift(self, shift: float) -> None:
        """Makes the KKT matrix hold ``shift`` · I more than it was assembled with, in the block of s (collective)."""
        shifted = self._diagonal.copy()
        shifted.array_w[: len(self.layout.free) + (self.joints.size if self.layout.last else 0)] += shift
        self._matrix.setDiagonal(shifted)

    def force_rate(self, state: State) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the controlled force (collective)."""
        return self.travel_gradient(self.controlled, state)

    def travel_gradient(self, load: PointLoad, state: State) -> PETSc.Vec:
        """Gᵀ ∂(a · u_P), of a load's travel with respect to the scaled unknowns x (collective)."""
        nodal, extras = np.zeros(self.layout.owned), np.zeros(self.layout.extras)
        self._add_load(load, 1.0, state, nodal, extras)
        return self._right_hand_side(nodal, extras)

    def share_rate(self, state: State) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the share of the constant loads (collective)."""
        nodal, extras = np.zeros(self.layout.owned), np.zeros(self.layout.extras)
        for load, magnitude in self.loads:
            self._add_load(load, magnitude, state, nodal, extras)
        extras[self.layout.z] -= self._potentials.rate(state)
        if self.elastic.shares:
            self.elastic.share_residual(self._nodal)
            nodal -= self._nodal.array_r[: self.layout.owned]
        return self._right_hand_side(nodal, extras)

    def target_rate(self) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with the controlled displacement (collective)."""
        extras = np.zeros(self.layout.extras)
        extras[self.layout.force] = -1.0
        return self._right_hand_side(np.zeros(self.layout.owned), extras)

    def motor_rate(self, state: State, direction: np.ndarray) -> PETSc.Vec:
        """Right-hand side whose KKT solution is the rate of x with motor values along ``direction`` (collective)."""
        extras = np.zeros(self.layout.extras)
        rate, twist = self.joints.motor_rate(state.poses, state.motors, state.multipliers, direction)
        extras[self.layout.multipliers], extras[self.layout.z] = rate, twist
        return self._right_hand_side(np.zeros(self.layout.owned), extras)

    def expand(self, x: PETSc.Vec) -> tuple[np.ndarray, np.ndarray]:
        """∂u/∂x · x at the owned nodes, interface nodes too, (owned dofs,), and the poses' part z (collective)."""
        rows = self._hat.createVecLeft()
        self._map.mult(x, rows)
        return rows.array_r[: self.layout.owned].copy(), self.step(x).z

    def nodal_forces(self) -> np.ndarray:
        """∂E/∂u minus the loads on links of the last ``balance``, (owned dofs,)."""
        return self._rows.array_r[: self.layout.owned].copy()

    def control_row(self) -> PETSc.Vec:
        """The unit vector of the unknown f (collective)."""
        vector = self._map.createVecRight()
        if self.layout.last:
            vector.array_w[-1] = 1.0
        return vector

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state that the scaled unknowns ``x`` stand for (collective)."""
        local, layout = x.array_r, self.layout
        free = len(layout.free)
        u = np.zeros(layout.owned)
        u[layout.free] = self.unit_u * local[:free]
        extras = self.scale * local[free:] if layout.last else None
        extras = layout.comm.bcast(extras, root=layout.comm.size - 1)
        return Step(u, extras[layout.z], extras[layout.multipliers], float(extras[layout.force]))

    # -- pieces --------------------------------------------------------------------------------------------

    def _right_hand_side(self, nodal: np.ndarray, extras: np.ndarray) -> PETSc.Vec:
        rows = self._rows.array_w
        rows[: self.layout.owned] = nodal
        if self.layout.last:
            rows[self.layout.owned : self.layout.owned + self.layout.extras] = extras
        vector = self._map.createVecRight()
        self._map.multTranspose(self._rows, vector)
        return vector

    def _acting(self, state: State) -> list[tuple[PointLoad, float]]:
        return [(self.controlled, state.force), *((load, state.share * size) for load, size in self.loads)]

    def _travel(self, load: PointLoad, state: State) -> float:
        return float(load.direction @ load.point.displacement(self.elastic.u, state.poses))

    def _add_load(self, load: PointLoad, magnitude: float, state: State, nodal: np.ndarray, extras: np.ndarray) -> None:
        """Adds magnitude · a · ∂u_P/∂(u, z) to owned ``nodal`` forces and ``extras``."""
        match load.point:
            case BodyPoint(body=body) as point:
                if body in self.joints.columns:
                    extras[self.joints.columns[body]] += magnitude * load.direction @ point.gradient(state.poses)
            case LinkPoint(global_nodes=nodes, weights=weights):
                dim = self.joints.space.dim
                first = self.layout.first_row // dim
                mine = (nodes >= first) & (nodes < first + self.layout.owned // dim)
                forces = nodal.reshape(-1, dim)
                np.add.at(forces, nodes[mine] - first, magnitude * np.outer(weights[mine], load.direction))


def _add_moments(a: dict[int, np.ndarray], b: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """Sum of two ranks' moments; a rank may hold no node of some body."""
    return {body: a.get(body, 0.0) + b.get(body, 0.0) for body in sorted(a.keys() | b.keys())}
