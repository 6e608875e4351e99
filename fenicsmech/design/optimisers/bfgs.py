"""BFGS with backtracking, the quasi-Newton method of section V-B of the paper.

    H_{k+1} = (I − ρ s yᵀ) H_k (I − ρ y sᵀ) + ρ s sᵀ,     ρ = 1 / yᵀ s,

H_0 = diag(ℓ²) with the lengths ℓ of the parameters; steps along −H ∂O/∂p, halved until O falls enough (Armijo);
infeasible points count as too far.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenicsmech.checks import positive
from fenicsmech.design.optimisers.problem import (
    Evaluation,
    Infeasible,
    Iterate,
    LeastSquaresProblem,
    Optimiser,
    Reason,
    Start,
)


@dataclass(frozen=True)
class BFGS(Optimiser):
    """Stops when the expected reduction is below ``tolerance`` times the objective, or after ``iterations``.

    The expected reduction depends on an approximate Hessian: with a large tolerance it ends far from a minimum.

    Attributes:
        iterations: largest number.
        tolerance: least reduction worth a step, over O.
        armijo: fraction of the decrease predicted by the slope that a step must reach.
        halvings: of a step, at most.

    Raises:
        DescriptionError: the tolerance is not a positive number.
    """

    iterations: int = 300
    tolerance: float = 1e-6
    armijo: float = 1e-4
    halvings: int = 30

    def __post_init__(self) -> None:
        positive("tolerance of BFGS", self.tolerance)

    @property
    def least_promise(self) -> float:
        return self.tolerance

    def minimise(self, problem: LeastSquaresProblem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        here, size = problem.evaluate(start.parameters), len(start.parameters)
        inverse = np.diag(problem.lengths**2) if start.memory is None else start.memory.reshape(size, size)
        last = _iterate(start.number, start.evaluations + 1, here, inverse)
        watch(last)
        while last.reason is None:
            last = self._advance(problem, last)
            watch(last)
        return last

    def _advance(self, problem: LeastSquaresProblem, last: Iterate) -> Iterate:
        here, number, evaluations = last.evaluation, last.number, last.evaluations
        inverse = last.memory.reshape(len(here.parameters), -1)
        if last.promise <= self.tolerance:
            return _iterate(number, evaluations, here, inverse, Reason.CONVERGED)
        there, tried = self._search(problem, here, -inverse @ here.gradient)
        if there is None:
            return _iterate(number, evaluations + tried, here, inverse, Reason.NO_DESCENT)
        inverse = _updated(inverse, here, there, first=number == 0)
        reason = Reason.ITERATIONS if number + 1 >= self.iterations else None
        return _iterate(number + 1, evaluations + tried, there, inverse, reason)

    def _search(
        self, problem: LeastSquaresProblem, here: Evaluation, step: np.ndarray
    ) -> tuple[Evaluation | None, int]:
        slope, length = float(here.gradient @ step), 1.0
        for tried in range(1, self.halvings + 1):
            try:
                return problem.evaluate(
                    here.parameters + length * step, here.value + self.armijo * length * slope
                ), tried
            except Infeasible:
                length *= 0.5
        return None, self.halvings


def _iterate(
    number: int, evaluations: int, evaluation: Evaluation, inverse: np.ndarray, reason: Reason | None = None
) -> Iterate:
    """The iterate with the reduction predicted for the quasi-Newton step."""
    gradient = evaluation.gradient
    promise = 0.5 * float(gradient @ inverse @ gradient) / max(evaluation.value, 1e-30)
    return Iterate(number, evaluations, evaluation, inverse.ravel(), promise, reason)


def _updated(inverse: np.ndarray, here: Evaluation, there: Evaluation, *, first: bool) -> np.ndarray:
    """The BFGS update of the inverse Hessian; skipped where the curvature along the step is not positive."""
    s, y = there.parameters - here.parameters, there.gradient - here.gradient
    curvature = float(y @ s)
    if curvature <= 1e-10 * np.linalg.norm(y) * np.linalg.norm(s):
        return inverse
    if first:
        inverse = inverse * curvature / float(y @ inverse @ y)
    rho = 1.0 / curvature
    left = np.eye(len(s)) - rho * np.outer(s, y)
    return left @ inverse @ left.T + rho * np.outer(s, s)
