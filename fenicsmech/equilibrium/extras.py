"""The entries of K̂ that belong to poses, multipliers and the controlled force.

B = Σ_i r_i · ∂²u_i/∂z² of interface nodes − f a · ∂²u_P/∂z² of loaded points + ∂²V/∂z² of potentials
− Σ λ_k ∂²C_k/∂z², the constraint gradients −A, the control's row −a, and −ε − c on the multipliers: ε = 1/ρ is the
proximal term of the augmented Lagrangian that keeps redundant constraints regular, c the compliance of joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.potentials import BodyPotentials
from fenicsmech.equilibrium.state import State
from fenicsmech.multibody import BodyPoint, JointSystem, LinkPoint

REGULARISATION = 1e-8
"""ε in scaled units, in which rows of A have norm one and the stiffness has mean diagonal one."""


class ExtraEntries:
    """Blocks of K̂ as (global rows, global columns, values).

    Args:
        joints: the constraints.
        layout: numbering of rows.
        controlled: the controlled force.
        potentials: of body poses.
        compliances: c per constraint, (rows,).
    """

    def __init__(
        self,
        joints: JointSystem,
        layout: Layout,
        controlled: PointLoad,
        potentials: BodyPotentials,
        compliances: np.ndarray,
    ) -> None:
        self._joints, self._controlled, self._potentials, self._layout = joints, controlled, potentials, layout
        self._z = layout.first_extra_row
        self._multipliers = layout.first_extra_row + joints.size
        self._force = np.array([layout.first_extra_row + layout.force])
        self._compliances, self._proximal = compliances, np.zeros(joints.rows)
        self._idle = 0.0

    def set_regularisation(self, multipliers: np.ndarray, force: float) -> None:
        """Takes the scales of the multipliers (rows,) and of the controlled force."""
        self._proximal = -REGULARISATION / multipliers**2 - self._compliances
        self._idle = -1.0 / force**2

    def entries(
        self,
        state: State,
        control: Control,
        acting: Iterable[tuple[PointLoad, float]],
        moments: dict[int, np.ndarray],
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """All blocks at ``state``, with the loads that act and Σ r_i ⊗ (X_i − c) of each interface body."""
        joints, z, space = self._joints, self._z, self._joints.space
        for body, moment in moments.items():
            columns = z + joints.columns[body]
            yield columns, columns, space.displacement_hessian(state.poses[body], moment)
        for load, magnitude in acting:
            if isinstance(load.point, BodyPoint) and load.point.body in joints.columns:
                columns = z + joints.columns[load.point.body]
                yield columns, columns, -load.point.hessian(state.poses, magnitude * load.direction)
        for rows, columns, block in self._potentials.hessian_blocks(state):
            yield z + rows, z + columns, block
        for rows, columns, block in joints.hessian_blocks(state.poses, state.motors, state.multipliers):
            yield z + rows, z + columns, -block
        for rows, columns, block in joints.gradient_blocks(state.poses, state.motors):
            yield self._multipliers + rows, z + columns, -block
            yield z + columns, self._multipliers + rows, -block.T
        for row, value in enumerate(self._proximal, start=self._multipliers):
            yield np.array([row]), np.array([row]), np.array([[value]])
        yield from self._control_entries(state, control)

    def pattern(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Where ``entries`` may put something, as (global rows, global columns)."""
        joints, z, multipliers = self._joints, self._z, self._multipliers
        drawn, still = joints.drawn, np.zeros(len(joints.connections))
        for columns in joints.columns.values():
            yield z + columns, z + columns
        for rows, columns, _ in joints.hessian_blocks(drawn, still, np.zeros(joints.rows)):
            yield z + rows, z + columns
        for rows, columns in self._potentials.pattern():
            yield z + rows, z + columns
        for rows, columns, _ in joints.gradient_blocks(drawn, still):
            yield multipliers + rows, z + columns
            yield z + columns, multipliers + rows
        for row in range(multipliers, multipliers + joints.rows):
            yield np.array([row]), np.array([row])
        yield self._force, self._force
        yield self._force, self._loaded()
        yield self._loaded(), self._force

    def _control_entries(self, state: State, control: Control):
        if not control.constrained:
            # f is given: its equation is f = f
            yield self._force, self._force, np.array([[self._idle]])
            return
        direction = self._controlled.direction
        match self._controlled.point:
            case BodyPoint() as point:
                values = -(direction @ point.gradient(state.poses))[None]
            case LinkPoint(weights=weights):
                values = -np.outer(weights, direction).reshape(1, -1)
        yield self._force, self._loaded(), values
        yield self._loaded(), self._force, values.T

    def _loaded(self) -> np.ndarray:
        """Global rows of K̂ on which the controlled force acts."""
        match self._controlled.point:
            case BodyPoint(body=body):
                return self._z + self._joints.columns[body]
            case LinkPoint(global_nodes=nodes):
                return self._layout.rows_of(nodes)
