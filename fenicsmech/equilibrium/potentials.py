"""Potentials of body poses that effects add: value, gradient, blocks of the Hessian, times the factor σ that acts.

σ is 1 for what holds the mechanism, and the load factor for all else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from fenicsmech.effects import PosePotential
from fenicsmech.equilibrium.state import State
from fenicsmech.multibody import JointSystem


class BodyPotentials:
    """Σ V over all ``potentials``, by the pose unknowns z of the free bodies of ``joints``."""

    def __init__(self, potentials: Sequence[PosePotential], joints: JointSystem) -> None:
        self._joints = joints
        self._parts = [(potential, self._places(potential)) for potential in potentials]

    def value(self, state: State) -> float:
        """Σ σ V."""
        return sum(_acting(potential, state) * potential.value(state.poses) for potential, _ in self._parts)

    def gradient(self, state: State) -> np.ndarray:
        """Σ σ ∂V/∂z, (size,)."""
        return self._slope(state, lambda potential: _acting(potential, state))

    def rate(self, state: State) -> np.ndarray:
        """The derivative of the gradient by the load factor, (size,)."""
        return self._slope(state, lambda potential: 0.0 if potential.holds else 1.0)

    def hessian_blocks(self, state: State) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """σ ∂²V/∂z² as (columns, columns, block) triples."""
        for potential, places in self._parts:
            curvature = _acting(potential, state) * potential.hessian(state.poses)
            for rows, row_columns in places:
                for columns, column_columns in places:
                    yield row_columns, column_columns, curvature[rows, columns]

    def pattern(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Where ``hessian_blocks`` may put something."""
        for _, places in self._parts:
            for _, rows in places:
                for _, columns in places:
                    yield rows, columns

    def _slope(self, state: State, factor: Callable[[PosePotential], float]) -> np.ndarray:
        """Σ factor · ∂V/∂z, (size,)."""
        total = np.zeros(self._joints.size)
        for potential, places in self._parts:
            slope = factor(potential) * potential.gradient(state.poses)
            for local, columns in places:
                total[columns] += slope[local]
        return total

    def _places(self, potential: PosePotential) -> list[tuple[slice, np.ndarray]]:
        """Which part of a potential's derivatives belongs to which columns; fixed bodies have none."""
        size = self._joints.space.pose_size
        return [
            (slice(k * size, (k + 1) * size), self._joints.columns[body])
            for k, body in enumerate(potential.bodies)
            if body in self._joints.columns
        ]


def _acting(potential: PosePotential, state: State) -> float:
    """σ."""
    return 1.0 if potential.holds else state.load_factor
