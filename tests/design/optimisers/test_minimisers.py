"""Both minimisers find known minima, take back infeasible steps, and say why they stop."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design.optimisers import Bfgs, Evaluation, Infeasible, LevenbergMarquardt, Reason

MINIMISERS = [LevenbergMarquardt(iterations=200, tolerance=1e-14), Bfgs(iterations=2000, tolerance=1e-14)]


class Rosenbrock:
    """r = (10 (y − x²), 1 − x), infeasible beyond x = 1.2; a weak pull towards the start."""

    def __init__(self, pull: float = 0.0) -> None:
        self.pull, self.start = pull, np.array([-1.2, 1.0])

    def evaluate(self, parameters: np.ndarray) -> Evaluation:
        x, y = parameters
        if x > 1.2:
            raise Infeasible("x is too large")
        away = parameters - self.start
        return Evaluation(
            parameters=parameters,
            residuals=np.array([10.0 * (y - x * x), 1.0 - x]),
            jacobian=np.array([[-20.0 * x, 10.0], [-1.0, 0.0]]),
            penalty=0.5 * self.pull * float(away @ away),
            penalty_gradient=self.pull * away,
            penalty_curvature=self.pull * np.eye(2),
        )


def watched(minimiser, problem, start):
    history = []
    return minimiser.minimise(problem, start, watch=history.append), history


@pytest.mark.parametrize("minimiser", MINIMISERS)
def test_banana_valley_is_followed_to_its_end(minimiser):
    problem = Rosenbrock()
    last, history = watched(minimiser, problem, problem.start)
    assert last.reason is Reason.CONVERGED
    assert last.evaluation.parameters == pytest.approx([1.0, 1.0], abs=1e-5)
    values = [iterate.evaluation.value for iterate in history]
    assert values == sorted(values, reverse=True)


@pytest.mark.parametrize("minimiser", MINIMISERS)
def test_penalty_moves_the_minimum_to_where_the_whole_gradient_vanishes(minimiser):
    problem = Rosenbrock(pull=0.1)
    last, _ = watched(minimiser, problem, problem.start)
    assert np.linalg.norm(last.evaluation.gradient) < 1e-5
    assert last.evaluation.parameters[0] < 0.9


@pytest.mark.parametrize("minimiser", [LevenbergMarquardt(iterations=2, tolerance=1e-14), Bfgs(iterations=2)])
def test_running_out_of_iterations_is_said(minimiser):
    problem = Rosenbrock()
    last, history = watched(minimiser, problem, problem.start)
    assert last.reason is Reason.ITERATIONS
    assert [iterate.number for iterate in history] == [0, 1, 2]


class Cliff:
    """Falls towards a cliff that cannot be approached: everything but the start is infeasible."""

    def evaluate(self, parameters: np.ndarray) -> Evaluation:
        if np.any(parameters != 0.0):
            raise Infeasible("over the cliff")
        return Evaluation(parameters, np.ones(1), np.ones((1, 2)), 0.0, np.zeros(2), np.zeros((2, 2)))


@pytest.mark.parametrize("minimiser", MINIMISERS)
def test_nothing_feasible_ahead_is_said_and_the_start_kept(minimiser):
    last, _ = watched(minimiser, Cliff(), np.zeros(2))
    assert last.reason is Reason.NO_DESCENT
    assert np.array_equal(last.evaluation.parameters, np.zeros(2))


def test_least_squares_structure_pays():
    problem = Rosenbrock()
    fast, slow = (watched(m, problem, problem.start)[0].evaluations for m in MINIMISERS)
    assert fast < slow
