"""BFGS with backtracking: the quasi-Newton method of the paper this package follows (section V-B).

    H_{k+1} = (I − ρ s yᵀ) H_k (I − ρ y sᵀ) + ρ s sᵀ,     ρ = 1 / yᵀ s,

steps along −H ∂O/∂p, halved until O falls enough (Armijo); infeasible points count as too far.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.optimisers.problem import (
    Evaluation,
    Infeasible,
    Iterate,
    LeastSquaresProblem,
    Minimiser,
    Reason,
)

_ARMIJO = 1e-4
_HALVINGS = 30


@dataclass(frozen=True)
class Bfgs(Minimiser):
    """Stops when the expected reduction is below ``tolerance`` times the objective, or after ``iterations``."""

    iterations: int = 300
    tolerance: float = 1e-6

    def minimise(self, problem: LeastSquaresProblem, start: np.ndarray, *, watch: Callable[[Iterate], None]) -> Iterate:
        here = problem.evaluate(start)
        inverse = np.eye(len(start))
        last = Iterate(0, 1, here, 0.0, None)
        watch(last)
        while last.reason is None:
            here = last.evaluation
            step = -inverse @ here.gradient
            if -float(here.gradient @ step) <= self.tolerance * max(here.value, 1e-30):
                last = Iterate(last.number, last.evaluations, here, 0.0, Reason.CONVERGED)
            else:
                there, tried = self._search(problem, here, step)
                evaluations, number = last.evaluations + tried, last.number + 1
                if there is None:
                    last = Iterate(last.number, evaluations, here, 0.0, Reason.NO_DESCENT)
                else:
                    inverse = _updated(inverse, here, there, first=last.number == 0)
                    reason = Reason.ITERATIONS if number >= self.iterations else None
                    last = Iterate(number, evaluations, there, 0.0, reason)
            watch(last)
        return last

    def _search(
        self, problem: LeastSquaresProblem, here: Evaluation, step: np.ndarray
    ) -> tuple[Evaluation | None, int]:
        slope, length = float(here.gradient @ step), 1.0
        for tried in range(1, _HALVINGS + 1):
            try:
                there = problem.evaluate(here.parameters + length * step)
                if there.value <= here.value + _ARMIJO * length * slope:
                    return there, tried
            except Infeasible:
                pass
            length *= 0.5
        return None, _HALVINGS


def _updated(inverse: np.ndarray, here: Evaluation, there: Evaluation, *, first: bool) -> np.ndarray:
    """The BFGS update of the inverse Hessian; skipped where the curvature along the step is not positive."""
    s, y = there.parameters - here.parameters, there.gradient - here.gradient
    curvature = float(y @ s)
    if curvature <= 1e-10 * np.linalg.norm(y) * np.linalg.norm(s):
        return inverse
    if first:
        inverse = np.eye(len(s)) * curvature / float(y @ y)
    rho = 1.0 / curvature
    left = np.eye(len(s)) - rho * np.outer(s, y)
    return left @ inverse @ left.T + rho * np.outer(s, s)
