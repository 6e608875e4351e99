"""Load steps: from a known equilibrium to the wanted control value, by predictor and Newton.

The predictor extrapolates the cubic Hermite polynomial through the last two equilibria and their tangents
(only the tangent at the first). Steps halve when Newton fails and double when it was easy; equilibria that
were reached are never lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium.load import Control
from fenicsmech.equilibrium.newton import Newton, NotConverged, Solution
from fenicsmech.equilibrium.state import State, Step

_SMALLEST = 1.0 / 1024.0  # of the distance asked for
_EASY = 5  # iterations


@dataclass(frozen=True)
class Anchor:
    """A known equilibrium: control value, state and tangent."""

    value: float
    state: State
    tangent: Step


class PathFailed(Exception):
    """Load stepping ended before the target.

    Attributes:
        last: the last equilibrium reached, or None.
        reached: its control value.
        reason: what Newton said.
        tried: control values tried in vain.
    """

    def __init__(self, last: Solution | None, reached: float, reason: str, tried: tuple[float, ...]) -> None:
        super().__init__(reason)
        self.last, self.reached, self.reason, self.tried = last, reached, reason, tried


class Path:
    """Follows equilibria as the value of one control changes.

    Args:
        newton: the solver.
        start: a first guess at ``value``.
        value: its control value.
    """

    def __init__(self, newton: Newton, start: State, value: float) -> None:
        self._newton, self._start, self._value = newton, start, value
        self._anchors: list[Anchor] = []
        self.iterations = 0

    def advance(self, control: Control) -> Solution:
        """The equilibrium at ``control``'s target, reached in as many steps as it takes (collective).

        Raises:
            PathFailed: the smallest step failed.
        """
        origin = self._value
        distance = control.target - origin
        step, solution, tried = distance, None, []
        while True:
            remaining = control.target - self._value
            if abs(step) >= abs(remaining) * (1.0 - 1e-9):
                step = remaining
            value = self._value + step
            try:
                solution = self._newton.solve(self._predict(value), control.at(value))
            except NotConverged as failure:
                self.iterations += failure.iterations
                tried.append(value)
                step *= 0.5
                if abs(step) <= _SMALLEST * abs(distance) or distance == 0.0:
                    raise PathFailed(solution, self._value, failure.reason, tuple(tried)) from failure
                continue
            self.iterations += solution.iterations
            self._anchors = [*self._anchors[-1:], Anchor(value, solution.state, solution.tangent)]
            self._value = value
            if value == control.target:
                return solution
            if solution.iterations <= _EASY:
                step *= 2.0

    def _predict(self, value: float) -> State:
        """The extrapolated state at ``value``."""
        system = self._newton.system
        if not self._anchors:
            return State(
                self._start.u, self._start.poses, self._start.multipliers, self._start.force, self._start.motors
            )
        last = self._anchors[-1]
        ahead = value - last.value
        if len(self._anchors) == 1 or self._anchors[0].value == last.value:
            return system.moved(last.state, last.tangent.scaled(ahead))
        before = self._anchors[0]
        width = last.value - before.value
        t = ahead / width
        # cubic Hermite basis on [−1, 0] evaluated at t, relative to the last state
        back = system.difference(before.state, last.state)
        weights = np.array([t * t * (3.0 + 2.0 * t), width * t * t * (1.0 + t), width * t * (1.0 + t) ** 2])
        return system.moved(last.state, _combine(weights, (back, before.tangent, last.tangent)))


def _combine(weights: np.ndarray, steps: tuple[Step, ...]) -> Step:
    """Σ weight · step."""
    return Step(
        sum(w * s.u for w, s in zip(weights, steps, strict=True)),
        sum(w * s.z for w, s in zip(weights, steps, strict=True)),
        sum(w * s.multipliers for w, s in zip(weights, steps, strict=True)),
        float(sum(w * s.force for w, s in zip(weights, steps, strict=True))),
    )
