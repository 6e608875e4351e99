"""First guesses of the next equilibrium on a path, from the ones before."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem

_REACH = 4.0  # widths between two equilibria that their cubic is trusted to go on for: its error grows as t⁴


@dataclass(frozen=True)
class Anchor:
    """A known equilibrium: control value, state, and the state's rate with that value."""

    value: float
    state: State
    tangent: Step


class Predictor(ABC):
    """Extrapolates a path."""

    @abstractmethod
    def predict(self, system: EquilibriumSystem, anchors: Sequence[Anchor], value: float) -> State:
        """The guess at ``value`` from at most the last two anchors, the latest last (collective)."""


class Constant(Predictor):
    """The last equilibrium again."""

    def predict(self, system, anchors, value):
        return anchors[-1].state


class Tangent(Predictor):
    """y(v) = y₀ + (v − v₀) y₀′."""

    def predict(self, system, anchors, value):
        last = anchors[-1]
        return system.moved(last.state, last.tangent.scaled(value - last.value))


class Hermite(Predictor):
    """The cubic through the last two equilibria and their tangents.

    While there is only one, and where the two lie close together compared with the step, along the tangent.

    With t = (v − v₀) / w, w = v₀ − v₋₁:

        y(v) = y₀ + t² (3 + 2 t) (y₋₁ − y₀) + w t² (1 + t) y₋₁′ + w t (1 + t)² y₀′.
    """

    def predict(self, system, anchors, value):
        if len(anchors) == 1:
            return Tangent().predict(system, anchors, value)
        before, last = anchors[-2:]
        width = last.value - before.value
        t = (value - last.value) / width
        if abs(t) > _REACH:
            return Tangent().predict(system, anchors, value)
        step = (
            system.difference(before.state, last.state).scaled(t * t * (3.0 + 2.0 * t))
            + before.tangent.scaled(width * t * t * (1.0 + t))
            + last.tangent.scaled(width * t * (1.0 + t) ** 2)
        )
        return system.moved(last.state, step)
