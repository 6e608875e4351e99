"""The state of a mechanism: displacements, poses, multipliers, controlled force; and the fields that hold it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
        load_factor: part of the constant loads and effects that acts, 0 … 1.
        minimum_shift: least shift δ of the tangent, which zero-energy modes need, in units of the mean stiffness.
    """

    u: np.ndarray
    poses: np.ndarray
    multipliers: np.ndarray
    force: float
    motors: np.ndarray
    load_factor: float = 1.0
    minimum_shift: float = 0.0


@dataclass(frozen=True, eq=False)
class Step:
    """A change of state; ``z`` are the poses of the free bodies, flat.

    Solves give the unknowns u, z, λ and f; motors and load factor change where a control prescribes them.
    """

    u: np.ndarray
    z: np.ndarray
    multipliers: np.ndarray
    force: float
    motors: np.ndarray | float = 0.0
    load_factor: float = 0.0

    def scaled(self, factor: float) -> Step:
        """``factor`` times this step."""
        return Step(*(factor * values for values in vars(self).values()))

    def __add__(self, other: Step) -> Step:
        return Step(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    def slower(self, other: Step) -> Step:
        """This step with the smaller change of the two for every displacement and pose."""

        def smaller(one: np.ndarray, two: np.ndarray) -> np.ndarray:
            return np.where(np.abs(one) < np.abs(two), one, two)

        return replace(self, u=smaller(self.u, other.u), z=smaller(self.z, other.z))

    def beyond(self, steps: Sequence[Step]) -> Step:
        """This step with how far every displacement and pose lies outside the span of those of ``steps``."""

        def outside(value: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
            return value - np.clip(value, np.minimum.reduce(others), np.maximum.reduce(others))

        u, z = outside(self.u, [step.u for step in steps]), outside(self.z, [step.z for step in steps])
        return replace(self, u=u, z=z)


def load_fields(elastic: ElasticBody, interfaces: InterfaceMap, state: State) -> None:
    """Makes the fields of ``elastic`` hold ``state``, with interface nodes on their bodies."""
    elastic.take(state.u)
    elastic.load_factor.value = state.load_factor
    elastic.update()
    interfaces.place(state.poses)
