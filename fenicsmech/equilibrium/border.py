"""The border of the equations: loads, potentials of poses and joints, which act on poses, multipliers and the load.

    L_b = V(z) − Σ f_k (a_k · u_k) − f (a · u_P) − λᵀ C(z) − ½ λᵀ c λ

V and the constant loads f_k are multiplied by the load factor σ, except the part of V that holds the mechanism, which
always acts in full. A load acts on a point of a body, whose displacement u_P is a function of z, or of a link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl
from fenicsmech.equilibrium.state import State
from fenicsmech.equilibrium.unknowns import Numbering
from fenicsmech.mechanism import Link
from fenicsmech.multibody import BodyPoint, JointSystem, LinkPoint, PosePotential, Spin

REGULARISATION = 1e-8
"""ε = 1/ρ of the multipliers, the proximal term of the augmented Lagrangian: keeps redundant constraints regular. In
scaled units, in which rows of A have norm one and the stiffness has mean diagonal one."""

Entries = Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class PointLoad:
    """Dead forces that share one magnitude f: work f Σ direction · u(point).

    Attributes:
        name: for messages.
        acting: points and directions, of as many coordinates as u(point), times the ratio of each force to f.
        places: links that carry the points, and where these are in the shapes at rest, (dim,); infinite for averages
            over regions.
    """

    name: str
    acting: tuple[tuple[BodyPoint | LinkPoint, np.ndarray], ...]
    places: tuple[tuple[Link, np.ndarray], ...]

    def travel(self, u: fem.Function, poses: np.ndarray) -> float:
        """Σ direction · u(point)."""
        return sum(float(direction @ point.displacement(u, poses)) for point, direction in self.acting)


class BorderTerms:
    """Values, gradients and Hessian entries of L_b, of a ``controlled`` load and ``constant`` ones."""

    def __init__(
        self,
        elastic: ElasticBody,
        joints: JointSystem,
        numbering: Numbering,
        controlled: PointLoad,
        constant: Sequence[PointLoad],
        *,
        potentials: Sequence[PosePotential],
        compliances: np.ndarray,
    ) -> None:
        self._elastic, self._joints, self._numbering = elastic, joints, numbering
        self._controlled, self._constant = controlled, tuple(constant)
        self._potentials = [(potential, self._places(potential)) for potential in potentials]
        self._compliances = compliances

    # -- values --------------------------------------------------------------------------------------------

    def travel(self, load: PointLoad, state: State) -> float:
        """a · u_P, the travel of a load's point in the loaded ``state``."""
        return load.travel(self._elastic.u, state.poses)

    def work(self, state: State, force: float) -> float:
        """Σ f_k (a_k · u_k) + f (a · u_P) with ``force`` for f."""
        constant = sum(magnitude * self.travel(load, state) for load, magnitude in self._held(state))
        return force * self.travel(self._controlled, state) + state.load_factor * constant

    def pose_potential(self, state: State) -> float:
        """V. Local."""
        return sum(own.factor(state.load_factor) * own.value(state.poses) for own, _ in self._potentials)

    # -- gradients: by this rank's (u, p), (owned dofs,), and by (z, λ, f), (border,) --------------------------

    def loads(self, state: State) -> list[tuple[PointLoad, float]]:
        """All loads with their magnitudes at ``state``. Local."""
        return [
            (self._controlled, state.force),
            *((load, state.load_factor * size) for load, size in self._held(state)),
        ]

    def _held(self, state: State) -> list[tuple[PointLoad, float]]:
        """The constant loads with their magnitudes f_k."""
        return list(zip(self._constant, state.constant.tolist(), strict=True))

    def load_forces(self, loads: Iterable[tuple[PointLoad, float]], state: State) -> tuple[np.ndarray, np.ndarray]:
        """Σ magnitude · ∂(a · u_P) over ``loads``. Local."""
        numbering = self._numbering
        links, border = np.zeros(numbering.rows.links.count), np.zeros(numbering.rows.border.size)
        nodal = links[numbering.rows.nodes.local].reshape(-1, numbering.per_node)
        for point, direction in ((point, size * along) for load, size in loads for point, along in load.acting):
            match point:
                case BodyPoint(body=body):
                    if body in self._joints.columns:
                        border[self._joints.columns[body]] += direction @ point.gradient(state.poses)
                case LinkPoint(global_nodes=nodes, weights=weights):
                    own = nodes - numbering.first_node
                    mine = (own >= 0) & (own < len(nodal))
                    np.add.at(nodal, own[mine], np.outer(weights[mine], direction))
        return links, border

    def pose_gradient(self, state: State) -> np.ndarray:
        """∂V/∂z, (poses,). Local."""
        return self._pose_gradient(state, lambda potential: potential.factor(state.load_factor))

    def load_factor_rate(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """−∂²L_b/∂(u, z)∂σ. Local."""
        links, border = self.load_forces(self._held(state), state)
        weights = self._pose_gradient(state, lambda potential: float(not potential.holds))
        self._numbering.rows.restrict_border(border).poses[:] -= weights
        return links, border

    def _pose_gradient(self, state: State, factor: Callable[[PosePotential], float]) -> np.ndarray:
        """Σ factor · ∂V/∂z over the potentials."""
        total = np.zeros(self._joints.size)
        for potential, places in self._potentials:
            gradient = factor(potential) * potential.gradient(state.poses)
            for local, columns in places:
                total[columns] += gradient[local]
        return total

    # -- Hessian: entries of K̂ as (global rows, global columns, values) ------------------------------------------

    def entries(
        self, state: State, control: Control, moments: Mapping[int, np.ndarray], scale: np.ndarray, idle: Iterable[Spin]
    ) -> Entries:
        """All entries at ``state``.

            B = Σ_i r_i · ∂²u_i/∂z² − Σ f_k a_k · ∂²u_k/∂z² + ∂²V/∂z² − Σ λ_k ∂²C_k/∂z² + Σ e eᵀ

        ``moments`` are Σ r_i ⊗ (X_i − c) over the nodes on the interfaces of each body, ``scale`` are the units of the
        border's unknowns, (border,), in which e, the gauge of each of the ``idle`` spins, has the size of one.
        """
        joints, rows = self._joints, self._numbering.rows
        units = self._numbering.unknowns.restrict_border(scale)
        z, multipliers, load = rows.poses.first, rows.multipliers.first, np.array([rows.load.first])
        for body, moment in moments.items():
            columns = z + joints.columns[body]
            yield columns, columns, joints.space.displacement_hessian(state.poses[body], moment)
        for acting, magnitude in self.loads(state):
            for point, direction in acting.acting:
                if isinstance(point, BodyPoint) and point.body in joints.columns:
                    columns = z + joints.columns[point.body]
                    yield columns, columns, -point.hessian(state.poses, magnitude * direction)
        for potential, places in self._potentials:
            curvature = potential.factor(state.load_factor) * potential.hessian(state.poses)
            for one, columns in places:
                for other, other_columns in places:
                    yield z + columns, z + other_columns, curvature[one, other]
        for body, gauge in self.gauges(idle, state, scale):
            columns = joints.columns[body]
            yield z + columns, z + columns, np.outer(gauge, gauge)
        for poses, other_poses, block in joints.hessian_blocks(state.poses, state.motors, state.multipliers):
            yield z + poses, z + other_poses, -block
        for constraints, columns, block in joints.gradient_blocks(state.poses, state.motors):
            yield multipliers + constraints, z + columns, -block
            yield z + columns, multipliers + constraints, -block.T
        regularisation = REGULARISATION / units.multipliers**2
        for row, value in enumerate(-regularisation - self._compliances, start=multipliers):
            yield np.array([row]), np.array([row]), np.array([[value]])
        if control.constrained:
            for loaded, travel in self._travel_rows(state):
                yield load, loaded, -travel
                yield loaded, load, -travel.T
        else:  # f is given: its equation is f = f
            yield load, load, -1.0 / units.load[:, None] ** 2

    def gauges(self, spins: Iterable[Spin], state: State, scale: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """e of each spin, in the units ``scale`` of the border of size one: a body, and its rate (pose_size,)."""
        units = self._numbering.unknowns.restrict_border(scale).poses
        for spin in spins:
            body, gauge = spin.gauge(self._joints, state.poses)
            yield body, gauge / units[self._joints.columns[body]]

    def pattern(self, idle: Sequence[Spin]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pattern of ``entries``, as (global rows, global columns). Local."""
        joints, dim = self._joints, self._joints.space.dim
        motors, constant = np.zeros(len(joints.connections)), np.zeros(len(self._constant))
        drawn = State(np.zeros(0), joints.drawn, np.zeros(joints.rows), 0.0, motors, constant=constant)
        moments = {body: np.zeros((dim, dim)) for body in joints.columns}
        scale = np.ones(self._numbering.unknowns.border.size)
        for control in (LoadControl(0.0), DisplacementControl(0.0)):
            for rows, columns, _ in self.entries(drawn, control, moments, scale, idle):
                yield rows, columns

    def _travel_rows(self, state: State) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """∂(a · u_P) of the controlled load by the unknowns in some global rows of K̂, (1, n)."""
        for point, direction in self._controlled.acting:
            match point:
                case BodyPoint(body=body):
                    rows = self._numbering.rows.poses.first + self._joints.columns[body]
                    yield rows, (direction @ point.gradient(state.poses))[None]
                case LinkPoint(global_nodes=nodes, weights=weights):
                    yield self._numbering.rows_of(nodes), np.outer(weights, direction).reshape(1, -1)

    def _places(self, potential: PosePotential) -> list[tuple[slice, np.ndarray]]:
        """Parts of a potential's derivatives, and the pose unknowns they belong to; fixed bodies have none."""
        size = self._joints.space.pose_size
        return [
            (slice(k * size, (k + 1) * size), self._joints.columns[body])
            for k, body in enumerate(potential.bodies)
            if body in self._joints.columns
        ]
