"""The state of a mechanism: displacements, poses, multipliers, controlled force; and the fields that hold it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.elasticity import ElasticBody
from fenicsmech.multibody import InterfaceMap


@dataclass(frozen=True, eq=False)
class State:
    """A point (s, λ, f) of the equilibrium equations.

    Attributes:
        u: displacements of this rank's owned nodes, then its owned pressures where links have some of their own, flat
            (owned dofs,).
        poses: poses of all bodies, on every rank, (bodies, pose_size).
        multipliers: λ, one per constraint row, on every rank.
        force: magnitude f of the controlled force.
        motors: motor value per connection.
        share: how much of the constant loads acts, 0 … 1.
        minimum_shift: least shift δ of the tangent, which zero-energy modes need, in units of the mean stiffness.
    """

    u: np.ndarray
    poses: np.ndarray
    multipliers: np.ndarray
    force: float
    motors: np.ndarray
    share: float = 1.0
    minimum_shift: float = 0.0


@dataclass(frozen=True, eq=False)
class Step:
    """A change of state; ``z`` are the poses of the free bodies, flat."""

    u: np.ndarray
    z: np.ndarray
    multipliers: np.ndarray
    force: float

    def scaled(self, factor: float) -> Step:
        """``factor`` times this step."""
        return Step(factor * self.u, factor * self.z, factor * self.multipliers, factor * self.force)

    def slower(self, other: Step) -> Step:
        """For every coordinate the smaller change of the two."""

        def smaller(one: np.ndarray, two: np.ndarray) -> np.ndarray:
            return np.where(np.abs(one) < np.abs(two), one, two)

        return Step(
            smaller(self.u, other.u),
            smaller(self.z, other.z),
            smaller(self.multipliers, other.multipliers),
            float(smaller(self.force, other.force)),
        )

    def beyond(self, steps: Sequence[Step]) -> Step:
        """How far every coordinate lies outside the span of those of ``steps``."""

        def outside(value: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
            return value - np.clip(value, np.minimum.reduce(others), np.maximum.reduce(others))

        return Step(
            outside(self.u, [step.u for step in steps]),
            outside(self.z, [step.z for step in steps]),
            outside(self.multipliers, [step.multipliers for step in steps]),
            float(outside(self.force, [step.force for step in steps])),
        )

    def __add__(self, other: Step) -> Step:
        return Step(self.u + other.u, self.z + other.z, self.multipliers + other.multipliers, self.force + other.force)


def load_fields(elastic: ElasticBody, interfaces: InterfaceMap, state: State) -> None:
    """Makes the fields of ``elastic`` hold ``state``, with interface nodes on their bodies."""
    elastic.take(state.u)
    elastic.share.value = state.share
    elastic.update()
    interfaces.place(state.poses)
