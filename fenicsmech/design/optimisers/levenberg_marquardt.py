"""Levenberg–Marquardt: Gauss–Newton steps with exact curvature of the penalties, damped until they descend.

    (Jᵀ J + ∂²R/∂p² + μ D) s = −∂O/∂p,     D the diagonal of Jᵀ J + ∂²R/∂p².

A step is accepted if it lowers O by a share of what the quadratic model promises; μ falls after good steps and
grows after bad or infeasible ones. Source: Nocedal & Wright, Numerical Optimization
(doi:10.1007/978-0-387-40065-5), chapter 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.optimisers.problem import Infeasible, Iterate, LeastSquaresProblem, Minimiser, Reason

_POOR, _GOOD = 0.1, 0.75  # actual over promised reduction: below, the step is refused; above, damping falls
_REFUSALS = 20


@dataclass(frozen=True)
class LevenbergMarquardt(Minimiser):
    """Stops when the reduction promised without damping is below ``tolerance`` of O, or after ``iterations``."""

    iterations: int = 60
    tolerance: float = 1e-6
    damping: float = 1e-3

    def minimise(self, problem: LeastSquaresProblem, start: np.ndarray, *, watch: Callable[[Iterate], None]) -> Iterate:
        best = Iterate(0, 1, problem.evaluate(start), self.damping, None)
        watch(best)
        while best.reason is None:
            best = self._advance(problem, best)
            watch(best)
        return best

    def _advance(self, problem: LeastSquaresProblem, last: Iterate) -> Iterate:
        here, damping, evaluations = last.evaluation, last.damping, last.evaluations
        gradient, curvature = here.gradient, here.curvature
        scale = np.maximum(np.diag(curvature), 1e-12 * np.max(np.diag(curvature)))
        undamped = np.linalg.solve(curvature + 1e-12 * np.diag(scale), -gradient)
        if -0.5 * float(gradient @ undamped) <= self.tolerance * max(here.value, 1e-30):
            return Iterate(last.number, evaluations, here, damping, Reason.CONVERGED)
        for _ in range(_REFUSALS):
            step = np.linalg.solve(curvature + damping * np.diag(scale), -gradient)
            promised = -float(gradient @ step) - 0.5 * float(step @ curvature @ step)
            evaluations += 1
            try:
                there = problem.evaluate(here.parameters + step)
            except Infeasible:
                damping *= 10.0
                continue
            ratio = (here.value - there.value) / promised
            if ratio < _POOR:
                damping *= 4.0
                continue
            damping = max(damping / 5.0, 1e-12) if ratio > _GOOD else damping
            number = last.number + 1
            reason = Reason.ITERATIONS if number >= self.iterations else None
            return Iterate(number, evaluations, there, damping, reason)
        return Iterate(last.number, evaluations, here, damping, Reason.NO_DESCENT)
