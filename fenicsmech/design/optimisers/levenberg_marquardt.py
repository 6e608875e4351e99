"""Levenberg–Marquardt for least squares with a regulariser that costs next to nothing to evaluate.

Only the residuals r are made linear; the regulariser R, barriers included, enters each step as it is:

    s = argmin ½ |r + J s|² + R(p + s) + ½ μ |s / ℓ|²,     ℓ the lengths of the parameters.

A step is accepted if it lowers O by a share of what this model promises; μ falls after good steps and grows after bad
or infeasible ones. Sources: Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapter 10; for
the composite model: Fletcher, Practical Methods of Optimization (doi:10.1002/9781118723203), chapter 14.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

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
)
from fenicsmech.design.optimisers.resolution import Resolution

_POOR, _GOOD = 0.1, 0.75  # actual over promised reduction: below, the step is refused; above, damping falls
_REFUSALS = 20
_STALLS = 3
_LEAST = 1e-9  # μ, so that parameters without influence stay where they are
_INNER = 50
_TOLERANCE = 5e-3


@dataclass(frozen=True)
class LevenbergMarquardt(Optimiser):
    """Ends when the undamped step promises less than ``tolerance`` of O, or three steps in a row gained less.

    Attributes:
        iterations: most of them.
        tolerance: least reduction worth a step, over O. By default 0.005, or earlier where the finite elements cannot
            tell, see ``resolution``.
        damping: μ at the start.

    Raises:
        DescriptionError: tolerance or damping is not a positive number.
    """

    iterations: int = 60
    tolerance: float | None = None
    damping: float = 1e-2

    def __post_init__(self) -> None:
        positive("tolerance of Levenberg–Marquardt", self.least_promise)
        positive("damping of Levenberg–Marquardt", self.damping)

    @property
    def least_promise(self) -> float:
        return _TOLERANCE if self.tolerance is None else self.tolerance

    def minimise(self, problem: LeastSquaresProblem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        here, metric = problem.evaluate(start.parameters), 1.0 / problem.lengths**2
        memory = _Memory(self.damping, 0) if start.memory is None else _Memory.of(start.memory)
        last = _iterate(start.number, start.evaluations + 1, here, memory, metric)
        watch(last)
        resolution = Resolution(last)
        while last.reason is None:
            undecided = self.tolerance is None and last.promise > self.least_promise
            if undecided and resolution.reached(last, partial(_undamped, last.evaluation, metric)):
                last = replace(last, reason=Reason.RESOLVED)
            else:
                last = self._advance(problem, last, metric)
            watch(last)
        return last

    def _advance(self, problem: LeastSquaresProblem, last: Iterate, metric: np.ndarray) -> Iterate:
        here, memory, evaluations = last.evaluation, _Memory.of(last.memory), last.evaluations
        damping = memory.damping
        if last.promise <= self.least_promise or memory.stalls >= _STALLS:
            return replace(last, reason=Reason.CONVERGED)
        for _ in range(_REFUSALS):
            there, promised = _step(here, damping, metric)
            if promised <= 0.0:
                break  # damped to a standstill
            evaluations += 1
            try:
                new = problem.evaluate(there, here.value - _POOR * promised)
            except TooHigh:
                damping *= 4.0
                continue
            except Infeasible:
                damping *= 10.0
                continue
            gain, number = here.value - new.value, last.number + 1
            if gain > _GOOD * promised:
                damping = max(damping / 5.0, _LEAST)
            stalls = memory.stalls + 1 if gain < self.least_promise * here.value else 0
            reason = Reason.ITERATIONS if number >= self.iterations else None
            return _iterate(number, evaluations, new, _Memory(damping, stalls), metric, reason)
        return replace(last, evaluations=evaluations, reason=Reason.NO_DESCENT)


@dataclass(frozen=True)
class _Memory:
    """μ, and how many steps in a row gained next to nothing."""

    damping: float
    stalls: int

    @staticmethod
    def of(numbers: np.ndarray) -> _Memory:
        return _Memory(float(numbers[0]), int(numbers[1]))

    @property
    def numbers(self) -> np.ndarray:
        return np.array([self.damping, self.stalls])


def _step(here: Evaluation, damping: float, metric: np.ndarray) -> tuple[np.ndarray, float]:
    """The minimum p + s of the damped model by Newton's method, and the reduction that the model promises there."""
    p, value = here.parameters, here.value
    for _ in range(_INNER):
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


def _undamped(here: Evaluation, metric: np.ndarray) -> np.ndarray:
    """s without damping."""
    return _step(here, _LEAST, metric)[0] - here.parameters


def _iterate(
    number: int,
    evaluations: int,
    evaluation: Evaluation,
    memory: _Memory,
    metric: np.ndarray,
    reason: Reason | None = None,
) -> Iterate:
    """With the reduction that the undamped step promises."""
    promise = _step(evaluation, _LEAST, metric)[1] / max(evaluation.value, 1e-30)
    return Iterate(number, evaluations, evaluation, memory.numbers, promise, reason)
