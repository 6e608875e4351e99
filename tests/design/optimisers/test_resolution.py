"""A minimisation ends where what is left to gain is below the errors of the residuals, unless given a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from fenicsmech.design import Evaluation, Iterate, LevenbergMarquardt, Quadratic, Reason, Resolution, Start, TooHigh

EXACT = LevenbergMarquardt(iterations=500, tolerance=1e-12)
ERRORS = [1e-2, 3e-2, 1e-1]
SPRINGS = [0.0, 1e-4, 1e-2]


@dataclass
class Doubtful:
    """r = (10 (y − x²), 1 − x) with errors, and a spring towards the start; counts what it is asked for."""

    error: float
    spring: float
    growth: float = 1.0
    lengths: np.ndarray = field(default_factory=lambda: np.ones(2), init=False)
    evaluations: int = field(default=0, init=False)
    estimates: int = field(default=0, init=False)
    start: np.ndarray = field(default_factory=lambda: np.array([-1.2, 1.0]), init=False)

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        self.evaluations += 1
        x, y = parameters
        residuals, jacobian = np.array([10.0 * (y - x * x), 1.0 - x]), np.array([[-20.0 * x, 10.0], [-1.0, 0.0]])
        evaluation = Evaluation(parameters, residuals, jacobian, self.regulariser, self.errors)
        if (height := evaluation.merit(penalties)) > below:
            raise TooHigh(height, evaluation.residuals)
        return evaluation

    def regulariser(self, parameters: np.ndarray) -> Quadratic:
        away = parameters - self.start
        return Quadratic(0.5 * self.spring * float(away @ away), self.spring * away, self.spring * np.eye(2))

    def errors(self) -> np.ndarray:
        self.estimates += 1
        return np.full(2, self.error * self.growth ** (self.estimates - 1))


def minimised(optimiser: LevenbergMarquardt, problem: Doubtful) -> Iterate:
    return optimiser.minimise(problem, Start(problem.start), watch=lambda iterate: None)


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("spring", SPRINGS)
def test_residuals_move_by_less_than_their_errors_when_iterations_continue(error, spring):
    doubtful = Doubtful(error, spring)
    early, late = minimised(LevenbergMarquardt(), doubtful), minimised(EXACT, Doubtful(error, spring))
    assert early.reason.converged
    assert np.all(np.abs(early.evaluation.residuals - late.evaluation.residuals) < error)
    assert doubtful.evaluations <= early.evaluations
    gain = early.evaluation.value - late.evaluation.value
    assert gain <= np.sum(np.abs(early.evaluation.residuals) * error + 0.5 * error**2)


def test_larger_errors_end_iterations_earlier_and_are_given_as_the_reason():
    counts, reasons = [], []
    for error in (0.0, *ERRORS, 1.0):
        last = minimised(LevenbergMarquardt(tolerance=None), Doubtful(error, 1e-4))
        counts.append(last.evaluations)
        reasons.append(last.reason)
    assert counts == sorted(counts, reverse=True) and counts[-1] < counts[0]
    assert reasons[0] is Reason.CONVERGED and reasons[-1] is Reason.RESOLVED


def test_a_given_tolerance_is_used_and_no_error_is_estimated():
    doubtful = Doubtful(1.0, 1e-4)
    last = minimised(EXACT, doubtful)
    assert last.reason is Reason.CONVERGED and last.reduction <= 1e-12
    assert doubtful.estimates == 0
    assert last.evaluation.parameters == pytest.approx(minimised(EXACT, Doubtful(0.0, 1e-4)).evaluation.parameters)


def test_errors_are_estimated_a_few_times_and_at_the_end():
    # damping that never falls
    doubtful, crawling = Doubtful(3e-2, 1e-4), LevenbergMarquardt(damping=1.0, good=1e9)
    last = minimised(crawling, doubtful)
    assert last.reason is Reason.RESOLVED
    assert 1 <= doubtful.estimates < last.number / 3


def test_an_old_estimate_alone_does_not_end_iterations():
    errors = iter([np.array([0.5]), np.array([0.05]), np.array([0.5])])

    def at(residual: float) -> Iterate:
        r = np.array([residual])
        here = Evaluation(np.zeros(1), r, np.eye(1), lambda p: Quadratic.zero(1), lambda: next(errors))
        return Iterate(0, 1, here, np.zeros(0), 1.0, None)

    resolution = Resolution(LevenbergMarquardt(), at(0.2))
    for residual, reached in (
        (0.11, False),  # no estimate yet
        (0.06, False),  # more than a tenth of an error
        (0.04, False),  # hidden by the old estimate, not by the one of this design
        (0.02, False),
        (0.01, True),  # by a new one, since far less is to gain than when errors were estimated last
    ):
        assert resolution.reached(at(residual), np.ones(1)) == reached
    assert next(errors, None) is None
