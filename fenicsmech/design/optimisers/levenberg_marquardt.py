"""Levenberg–Marquardt for least squares with a regulariser of negligible cost.

Only the residuals r are linearised; the regulariser R, barriers included, enters each step exactly:

    s = argmin ½ |r + J s|² + R(p + s) + ½ μ |s / ℓ|²,     ℓ the lengths of the parameters.

A step is accepted if it lowers O by a part of the predicted reduction; μ falls after good steps and grows after bad or
infeasible ones. Sources: Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapter 10; for
the composite model: Fletcher, Practical Methods of Optimization (doi:10.1002/9781118723203), chapter 14.

Residuals have errors e_k, those of the finite elements. It is enough if the undamped step s would change no residual by
more than a tenth of its error, and O by no more than the errors do:

    |J s|_k ≤ φ e_k  for all k,     O(p) − min O ≤ Σ (|r_k| e_k + ½ e_k²),     φ = 0.1.

Further iterations would change results by less than their errors; regularisers count, as part of O.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

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
    TooHigh,
    exact,
)


@dataclass(frozen=True)
class LevenbergMarquardt(Optimiser):
    """Ends when the predicted reduction is below ``tolerance`` times O, or three steps in a row gained less.

    Attributes:
        iterations: largest number.
        tolerance: least reduction worth a step, over O. By default 0.005, or earlier where the errors of the finite
            elements exceed the remaining reduction.
        damping: μ at the start.
        least_damping: least μ, which keeps parameters without influence in place.
        poor, good: actual over predicted reduction; below the first a step is refused, above the second damping falls.
        refusals: most steps refused in a row.
        stalls: steps in a row that gain less than ``tolerance`` of O, after which it ends.
        resolved: φ, the part of a residual's error that the step to the minimum may change it by.
        again: fraction of the remaining reduction at the last estimate of errors, at which they are estimated again.

    Raises:
        DescriptionError: tolerance or damping is not a positive number.
    """

    iterations: int = 60
    tolerance: float | None = None
    damping: float = 1e-2
    least_damping: float = 1e-9
    poor: float = 0.1
    good: float = 0.75
    refusals: int = 20
    stalls: int = 3
    resolved: float = 0.1
    again: float = 0.1

    def __post_init__(self) -> None:
        positive("tolerance of Levenberg–Marquardt", self.least_promise)
        positive("damping of Levenberg–Marquardt", self.damping)

    @property
    def least_promise(self) -> float:
        return 5e-3 if self.tolerance is None else self.tolerance

    def minimise(self, problem: LeastSquaresProblem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        here, metric = problem.evaluate(start.parameters), 1.0 / problem.lengths**2
        memory = (self.damping, 0) if start.memory is None else start.memory
        last = self._iterate(start.number, start.evaluations + 1, here, memory, metric)
        watch(last)
        resolution = Resolution(self, last)
        while last.reason is None:
            undecided = self.tolerance is None and last.promise > self.least_promise
            if undecided and resolution.reached(last, metric):
                last = replace(last, reason=Reason.RESOLVED)
            else:
                last = self._advance(problem, last, metric)
            watch(last)
        return last

    def _advance(self, problem: LeastSquaresProblem, last: Iterate, metric: np.ndarray) -> Iterate:
        here, (damping, stalls), evaluations = last.evaluation, last.memory, last.evaluations
        if last.promise <= self.least_promise or stalls >= self.stalls:
            return replace(last, reason=Reason.CONVERGED)
        for _ in range(self.refusals):
            there, promised = _step(here, damping, metric)
            if promised <= 0.0:
                break  # damped to a standstill
            evaluations += 1
            try:
                new = problem.evaluate(there, here.value - self.poor * promised)
            except TooHigh:
                damping *= 4.0
                continue
            except Infeasible:
                damping *= 10.0
                continue
            gain, number = here.value - new.value, last.number + 1
            if gain > self.good * promised:
                damping = max(damping / 5.0, self.least_damping)
            stalls = stalls + 1 if gain < self.least_promise * here.value else 0
            reason = Reason.ITERATIONS if number >= self.iterations else None
            return self._iterate(number, evaluations, new, (damping, stalls), metric, reason)
        return replace(last, evaluations=evaluations, reason=Reason.NO_DESCENT)

    def _iterate(
        self,
        number: int,
        evaluations: int,
        evaluation: Evaluation,
        memory: tuple[float, int] | np.ndarray,
        metric: np.ndarray,
        reason: Reason | None = None,
    ) -> Iterate:
        """The iterate with the reduction predicted for the undamped step; memory: μ, number of stalled steps."""
        promise = _step(evaluation, self.least_damping, metric)[1] / max(evaluation.value, 1e-30)
        return Iterate(number, evaluations, evaluation, np.array(memory, dtype=float), promise, reason)


def _step(here: Evaluation, damping: float, metric: np.ndarray) -> tuple[np.ndarray, float]:
    """The minimum p + s of the damped model by Newton's method, and the reduction that the model predicts."""
    p, value = here.parameters, here.value
    for _ in range(50):
        model, away = here.model(p), p - here.parameters
        gradient = model.gradient + damping * metric * away
        newton = np.linalg.solve(model.curvature + np.diag(damping * metric), -gradient)
        slope = float(gradient @ newton)
        if -slope <= 1e-10 * here.value:
            break
        length = 1.0
        while length > 1e-8:
            trial = p + length * newton
            away = trial - here.parameters
            damped = here.model(trial).value + 0.5 * damping * float(away @ (metric * away))
            if damped <= value + 0.1 * length * slope:
                p, value = trial, damped
                break
            length *= 0.5
        else:
            break
    return p, here.value - here.model(p).value


class Resolution:
    """Test of the remaining reduction against the errors, which are estimated a few times from ``start`` on."""

    def __init__(self, options: LevenbergMarquardt, start: Iterate) -> None:
        self._options, self._errors = options, exact()
        self._estimated: Evaluation | None = None
        self._below = options.again * _gain(start)

    def reached(self, last: Iterate, metric: np.ndarray) -> bool:
        """Whether the best point so far, ``last``, is as near to the minimum as the errors resolve."""
        if _gain(last) < self._below:
            self._estimate(last)
        if self._hidden(last, metric) and self._estimated is not last.evaluation:
            self._estimate(last)
        return self._hidden(last, metric)

    def _estimate(self, last: Iterate) -> None:
        self._errors, self._estimated = last.evaluation.errors(), last.evaluation
        self._below = self._options.again * _gain(last)

    def _hidden(self, last: Iterate, metric: np.ndarray) -> bool:
        here = last.evaluation
        if _gain(last) > np.sum(np.abs(here.residuals) * self._errors + 0.5 * self._errors**2):
            return False
        s = _step(here, self._options.least_damping, metric)[0] - here.parameters
        return bool(np.all(np.abs(here.jacobian @ s) <= self._options.resolved * self._errors))


def _gain(last: Iterate) -> float:
    """O(p) − min O, as predicted."""
    return last.promise * last.evaluation.value
