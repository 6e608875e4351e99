"""The loads on a mechanism: one whose magnitude is controlled, and constant ones."""

from __future__ import annotations

import numpy as np

from fenicsmech.elasticity import ElasticBody
from fenicsmech.equilibrium.layout import Layout
from fenicsmech.equilibrium.load import PointLoad
from fenicsmech.equilibrium.state import State
from fenicsmech.multibody import BodyPoint, JointSystem, LinkPoint


class Loads:
    """What point loads do to the equilibrium equations.

    Args:
        controlled: the load whose magnitude f is controlled.
        constant: the others, with their magnitudes.
        elastic: the flexible links.
        joints: the constraints.
        layout: numbering of rows.
    """

    def __init__(
        self,
        controlled: PointLoad,
        constant: tuple[tuple[PointLoad, float], ...],
        elastic: ElasticBody,
        joints: JointSystem,
        layout: Layout,
    ) -> None:
        self.controlled, self.constant = controlled, constant
        self._elastic, self._joints, self._layout = elastic, joints, layout

    def acting(self, state: State) -> list[tuple[PointLoad, float]]:
        """All of them with their magnitudes at ``state``."""
        return [(self.controlled, state.force), *((load, state.load_factor * size) for load, size in self.constant)]

    def travel(self, load: PointLoad, state: State) -> float:
        """a · u_P, how far a load's point has moved along it in the loaded ``state`` (collective)."""
        return float(load.direction @ load.point.displacement(self._elastic.u, state.poses))

    def work(self, state: State, force: float) -> float:
        """Σ loads · u_P + f a · u_P with ``force`` for f (collective)."""
        constant = sum(magnitude * self.travel(load, state) for load, magnitude in self.constant)
        return force * self.travel(self.controlled, state) + state.load_factor * constant

    def add(self, load: PointLoad, magnitude: float, state: State, nodal: np.ndarray, extras: np.ndarray) -> None:
        """Adds magnitude · a · ∂u_P/∂(u, z) to owned ``nodal`` forces and ``extras``."""
        match load.point:
            case BodyPoint(body=body) as point:
                if body in self._joints.columns:
                    extras[self._joints.columns[body]] += magnitude * load.direction @ point.gradient(state.poses)
            case LinkPoint(global_nodes=nodes, weights=weights):
                first = self._layout.first_node
                forces = nodal[: self._layout.displacements].reshape(-1, self._layout.per_node)
                mine = (nodes >= first) & (nodes < first + len(forces))
                np.add.at(forces, nodes[mine] - first, magnitude * np.outer(weights[mine], load.direction))
