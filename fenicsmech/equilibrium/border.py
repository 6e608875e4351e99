"""The border of the equations: loads, potentials of poses and joints, which act on poses, multipliers and the load.

    L_b = V(z) − Σ f_k (a_k · u_k) − f (a · u_P) − λᵀ C(z) − ½ λᵀ c λ

V and the constant loads f_k are multiplied by the load factor σ, except the part of V that holds the mechanism, which
always acts in full. A load acts on a point of a body, whose displacement u_P is a function of z, or of a link.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.effects import PosePotential
from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.blocks import Numbering
from fenicsmech.equilibrium.control import Control, DisplacementControl, LoadControl
from fenicsmech.equilibrium.state import State
from fenicsmech.multibody import BodyPoint, JointSystem, LinkPoint

REGULARISATION = 1e-8
"""ε = 1/ρ of the multipliers, the proximal term of the augmented Lagrangian: keeps redundant constraints regular. In
scaled units, in which rows of A have norm one and the stiffness has mean diagonal one."""

Entries = Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class PointLoad:
    """A dead force along ``direction``, of as many coordinates as u(point): work f · direction · u(point)."""

    name: str
    point: BodyPoint | LinkPoint
    direction: np.ndarray


class BorderTerms:
    """Values, gradients and Hessian entries of L_b.

    Args:
        elastic: the flexible links.
        joints: the constraints.
        numbering: of rows.
        controlled: the load whose magnitude f is controlled.
        constant: the other loads, with their magnitudes.
        potentials: V, of the poses of bodies.
        compliances: c by constraint row; 0 where none is given.

    Attributes:
        compliances: c, (rows,).
    """

    def __init__(
        self,
        elastic: ElasticBody,
        joints: JointSystem,
        numbering: Numbering,
        *,
        controlled: PointLoad,
        constant: tuple[tuple[PointLoad, float], ...],
        potentials: Sequence[PosePotential],
        compliances: Mapping[int, float],
    ) -> None:
        self._elastic, self._joints, self._numbering = elastic, joints, numbering
        self._controlled, self._constant = controlled, constant
        self._potentials = [(potential, self._places(potential)) for potential in potentials]
        self.compliances = np.array([compliances.get(row, 0.0) for row in range(joints.rows)])

    # -- values --------------------------------------------------------------------------------------------

    def travel(self, load: PointLoad, state: State) -> float:
        """a · u_P, the travel of a load's point in the loaded ``state``."""
        return float(load.direction @ load.point.displacement(self._elastic.u, state.poses))

    def work(self, state: State, force: float) -> float:
        """Σ f_k (a_k · u_k) + f (a · u_P) with ``force`` for f."""
        constant = sum(magnitude * self.travel(load, state) for load, magnitude in self._constant)
        return force * self.travel(self._controlled, state) + state.load_factor * constant

    def pose_potential(self, state: State) -> float:
        """V. Local."""
        return sum(_factor(potential, state) * potential.value(state.poses) for potential, _ in self._potentials)

    def constraints(self, state: State, multipliers: np.ndarray) -> np.ndarray:
        """C + c λ at ``multipliers`` λ, (rows,). Local."""
        return self._joints.value(state.poses, state.motors) + self.compliances * multipliers

    # -- gradients: by this rank's (u, p), (owned dofs,), and by (z, λ, f), (border,) --------------------------

    def loads(self, state: State) -> list[tuple[PointLoad, float]]:
        """All loads with their magnitudes at ``state``. Local."""
        return [(self._controlled, state.force), *((load, state.load_factor * size) for load, size in self._constant)]

    def load_forces(self, loads: Iterable[tuple[PointLoad, float]], state: State) -> tuple[np.ndarray, np.ndarray]:
        """Σ magnitude · ∂(a · u_P) over ``loads``. Local."""
        numbering = self._numbering
        links, border = np.zeros(numbering.rows.links.count), np.zeros(numbering.rows.border.size)
        nodal = links[numbering.rows.nodes.local].reshape(-1, numbering.per_node)
        for load, magnitude in loads:
            match load.point:
                case BodyPoint(body=body) as point:
                    if body in self._joints.columns:
                        border[self._joints.columns[body]] += magnitude * load.direction @ point.gradient(state.poses)
                case LinkPoint(global_nodes=nodes, weights=weights):
                    own = nodes - numbering.first_node
                    mine = (own >= 0) & (own < len(nodal))
                    np.add.at(nodal, own[mine], magnitude * np.outer(weights[mine], load.direction))
        return links, border

    def pose_gradient(self, state: State) -> np.ndarray:
        """∂V/∂z, (poses,). Local."""
        total = np.zeros(self._joints.size)
        for potential, places in self._potentials:
            _add(total, places, _factor(potential, state) * potential.gradient(state.poses))
        return total

    def load_factor_rate(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """−∂²L_b/∂(u, z)∂σ. Local."""
        links, border = self.load_forces(self._constant, state)
        weights = np.zeros(self._joints.size)
        for potential, places in self._potentials:
            if not potential.holds:
                _add(weights, places, potential.gradient(state.poses))
        self._numbering.rows.restrict_border(border).poses[:] -= weights
        return links, border

    # -- Hessian: entries of K̂ as (global rows, global columns, values) ------------------------------------------

    def entries(
        self, state: State, control: Control, moments: Mapping[int, np.ndarray], regularisation: np.ndarray
    ) -> Entries:
        """All entries at ``state``.

            B = Σ_i r_i · ∂²u_i/∂z² − Σ f_k a_k · ∂²u_k/∂z² + ∂²V/∂z² − Σ λ_k ∂²C_k/∂z²

        Args:
            state: displacements, poses and multipliers.
            control: of the load.
            moments: Σ r_i ⊗ (X_i − c) over the nodes on the interfaces of each body.
            regularisation: ε by constraint row and that of a given load, in the units of K̂, (rows + 1,).
        """
        joints, rows = self._joints, self._numbering.rows
        z, multipliers, load = rows.poses.first, rows.multipliers.first, np.array([rows.load.first])
        for body, moment in moments.items():
            columns = z + joints.columns[body]
            yield columns, columns, joints.space.displacement_hessian(state.poses[body], moment)
        for acting, magnitude in self.loads(state):
            if isinstance(acting.point, BodyPoint) and acting.point.body in joints.columns:
                columns = z + joints.columns[acting.point.body]
                yield columns, columns, -acting.point.hessian(state.poses, magnitude * acting.direction)
        for potential, places in self._potentials:
            curvature = _factor(potential, state) * potential.hessian(state.poses)
            for one, columns in places:
                for other, other_columns in places:
                    yield z + columns, z + other_columns, curvature[one, other]
        for poses, other_poses, block in joints.hessian_blocks(state.poses, state.motors, state.multipliers):
            yield z + poses, z + other_poses, -block
        for constraints, columns, block in joints.gradient_blocks(state.poses, state.motors):
            yield multipliers + constraints, z + columns, -block
            yield z + columns, multipliers + constraints, -block.T
        for row, value in enumerate(-regularisation[:-1] - self.compliances, start=multipliers):
            yield np.array([row]), np.array([row]), np.array([[value]])
        if control.constrained:
            values = -self._travel_row(state)
            yield load, self._loaded(), values
            yield self._loaded(), load, values.T
        else:  # f is given: its equation is f = f
            yield load, load, np.array([[-regularisation[-1]]])

    def pattern(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pattern of ``entries``, as (global rows, global columns). Local."""
        joints, dim = self._joints, self._joints.space.dim
        drawn = State(np.zeros(0), joints.drawn, np.zeros(joints.rows), 0.0, np.zeros(len(joints.connections)))
        moments = {body: np.zeros((dim, dim)) for body in joints.columns}
        for control in (LoadControl(0.0), DisplacementControl(0.0)):
            for rows, columns, _ in self.entries(drawn, control, moments, np.zeros(joints.rows + 1)):
                yield rows, columns

    def _travel_row(self, state: State) -> np.ndarray:
        """∂(a · u_P) of the controlled load by the unknowns in rows ``_loaded``, (1, n)."""
        direction = self._controlled.direction
        match self._controlled.point:
            case BodyPoint() as point:
                return (direction @ point.gradient(state.poses))[None]
            case LinkPoint(weights=weights):
                return np.outer(weights, direction).reshape(1, -1)

    def _loaded(self) -> np.ndarray:
        """Global rows of K̂ on which the controlled load acts."""
        match self._controlled.point:
            case BodyPoint(body=body):
                return self._numbering.rows.poses.first + self._joints.columns[body]
            case LinkPoint(global_nodes=nodes):
                return self._numbering.rows_of(nodes)

    def _places(self, potential: PosePotential) -> list[tuple[slice, np.ndarray]]:
        """Parts of a potential's derivatives, and the pose unknowns they belong to; fixed bodies have none."""
        size = self._joints.space.pose_size
        return [
            (slice(k * size, (k + 1) * size), self._joints.columns[body])
            for k, body in enumerate(potential.bodies)
            if body in self._joints.columns
        ]


def _factor(potential: PosePotential, state: State) -> float:
    """The load factor that a potential counts with."""
    return 1.0 if potential.holds else state.load_factor


def _add(total: np.ndarray, places: list[tuple[slice, np.ndarray]], gradient: np.ndarray) -> None:
    """Adds a potential's gradient at its pose unknowns."""
    for local, columns in places:
        total[columns] += gradient[local]
