"""Both optimisers find known minima, respect their options, can go on later, and say why they stop."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.optimize import brentq

from fenicsmech.design import (
    BFGS,
    SQP,
    Barrier,
    Deferred,
    Evaluation,
    Infeasible,
    Iterate,
    LevenbergMarquardt,
    Optimiser,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)

OPTIMISERS = [LevenbergMarquardt(iterations=200, tolerance=1e-14), BFGS(iterations=2000, tolerance=1e-14)]
each_optimiser = pytest.mark.parametrize("optimiser", OPTIMISERS, ids=lambda optimiser: type(optimiser).__name__)


@dataclass
class Problem:
    """Residuals and a regulariser; keeps a list of where it was evaluated, and refuses what is not asked for."""

    start: np.ndarray
    lengths: np.ndarray
    asked: list[np.ndarray] = field(default_factory=list, init=False)
    refused: int = field(default=0, init=False)

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        self.asked.append(parameters)
        self.check(parameters)
        evaluation = Evaluation(parameters, *self.residuals(parameters), self.regulariser)
        if (height := evaluation.merit(penalties)) > below:
            self.refused += 1
            raise TooHigh(height, evaluation.residuals)
        return evaluation

    def check(self, parameters: np.ndarray) -> None:
        """Raises Infeasible where there is no value."""

    def residuals(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError

    def regulariser(self, parameters: np.ndarray) -> Quadratic:
        return Quadratic.zero(len(parameters))


class Rosenbrock(Problem):
    """r = (10 (y − x²), 1 − x), infeasible beyond x = 1.2; a weak spring towards the start."""

    def __init__(self, spring: float = 0.0, *, unit: Sequence[float] = (1.0, 1.0)) -> None:
        self.spring, self.unit = spring, np.array(unit)
        super().__init__(np.array([-1.2, 1.0]) * self.unit, self.unit)

    def check(self, parameters):
        if parameters[0] > 1.2 * self.unit[0]:
            raise Infeasible("x is too large")

    def residuals(self, parameters):
        x, y = parameters / self.unit
        jacobian = np.array([[-20.0 * x, 10.0], [-1.0, 0.0]]) / self.unit
        return np.array([10.0 * (y - x * x), 1.0 - x]), jacobian

    def regulariser(self, parameters):
        away = (parameters - self.start) / self.unit
        return Quadratic(
            0.5 * self.spring * float(away @ away), self.spring * away / self.unit, self.spring * np.diag(self.unit**-2)
        )


class Ridge(Problem):
    """r = 0.1 + sign x², whose derivative vanishes at the start, x = y = 0, a saddle of |r|² or its minimum; infeasible
    at negative x where ``one_sided``."""

    def __init__(self, sign: float, *, one_sided: bool = False) -> None:
        self.sign, self.one_sided = sign, one_sided
        super().__init__(np.zeros(2), np.ones(2))

    def check(self, parameters):
        if self.one_sided and parameters[0] < 0.0:
            raise Infeasible("x is negative")

    def residuals(self, parameters):
        x, _ = parameters
        return np.array([0.1 + self.sign * x * x]), np.array([[2.0 * self.sign * x, 0.0]])


class Jump(Problem):
    """r = (x − 1, 0), which jumps at x = 0.4 to (x − 1.9, ``floor``), as a part that snaps when its shape changes."""

    def __init__(self, floor: float) -> None:
        self.floor = floor
        super().__init__(np.zeros(1), np.ones(1))

    def residuals(self, parameters):
        beyond = parameters[0] > 0.4
        root, rest = (1.9, self.floor) if beyond else (1.0, 0.0)
        return np.array([parameters[0] - root, rest]), np.array([[1.0], [0.0]])


class Wall(Problem):
    """r = x − 10, and a steep barrier from x = 1 on, which costs 1e5 times the residual where the residual vanishes.

    Args:
        quadratic: show a parabola around the point of evaluation in place of the barrier.
    """

    BARRIER = Barrier(1.0, 0.02)

    def __init__(self, *, quadratic: bool = False) -> None:
        super().__init__(np.zeros(1), np.ones(1))
        self.quadratic = quadratic

    def evaluate(self, parameters, below=np.inf, penalties=0.0):
        evaluation = super().evaluate(parameters, below, penalties)
        if not self.quadratic:
            return evaluation
        here = evaluation.penalty

        def parabola(p: np.ndarray) -> Quadratic:
            step = p - parameters
            bend = here.curvature @ step
            return Quadratic(here.value + (here.gradient + 0.5 * bend) @ step, here.gradient + bend, here.curvature)

        return Evaluation(parameters, evaluation.residuals, evaluation.jacobian, parabola)

    def residuals(self, parameters):
        return parameters - 10.0, np.eye(1)

    def regulariser(self, parameters):
        b, x = self.BARRIER, parameters
        return Quadratic(float(b.value(x).sum()), b.slope(x), np.diag(b.curvature(x)))


class CountedWall(Wall):
    """A wall that counts how often its regulariser and the derivatives of this are computed."""

    values = slopes = 0

    def regulariser(self, parameters):
        self.values += 1
        here = super().regulariser(parameters)

        def derivatives() -> tuple[np.ndarray, np.ndarray]:
            self.slopes += 1
            return here.gradient, here.curvature

        return Deferred(here.value, derivatives)


class Cliff(Problem):
    """Falls towards a cliff that cannot be approached: everything but the start is infeasible."""

    def __init__(self) -> None:
        super().__init__(np.zeros(2), np.ones(2))

    def check(self, parameters):
        if np.any(parameters != 0.0):
            raise Infeasible("over the cliff")

    def residuals(self, parameters):
        return np.ones(1), np.ones((1, 2))


def watched(optimiser: Optimiser, problem: Problem, start: Start | None = None) -> tuple[Iterate, list[Iterate]]:
    history = []
    return optimiser.minimise(problem, start or Start(problem.start), watch=history.append), history


@each_optimiser
def test_banana_valley_is_followed_to_its_end(optimiser):
    last, history = watched(optimiser, Rosenbrock())
    assert last.reason is Reason.CONVERGED
    assert last.evaluation.parameters == pytest.approx([1.0, 1.0], abs=1e-5)
    values = [iterate.evaluation.value for iterate in history]
    assert values == sorted(values, reverse=True)
    assert [iterate.reason for iterate in history[:-1]] == [None] * (len(history) - 1)


@each_optimiser
def test_every_evaluation_is_counted(optimiser):
    problem = Rosenbrock()
    last, _ = watched(optimiser, problem)
    assert last.evaluations == len(problem.asked)
    assert problem.refused > 0


@each_optimiser
def test_regulariser_moves_the_minimum_to_where_the_whole_gradient_vanishes(optimiser):
    last, _ = watched(optimiser, Rosenbrock(spring=0.1))
    assert np.linalg.norm(last.evaluation.gradient) < 1e-5
    assert last.evaluation.parameters[0] < 0.9


@each_optimiser
def test_derivatives_of_the_regulariser_are_not_computed_where_line_searches_pass(optimiser):
    problem = CountedWall()
    last, _ = watched(optimiser, problem)
    assert last.evaluation.parameters == watched(optimiser, Wall())[0].evaluation.parameters
    assert 0 < problem.slopes < problem.values


def test_levenberg_marquardt_takes_the_same_way_in_any_unit_of_length():
    ways = []
    for unit in ((1.0, 1.0), (1e-3, 1e-3), (1e3, 1e-3)):
        problem = Rosenbrock(spring=0.01, unit=unit)
        _, history = watched(LevenbergMarquardt(tolerance=1e-8), problem)
        ways.append(np.array([iterate.evaluation.parameters / unit for iterate in history]))
    for way in ways[1:]:
        assert way == pytest.approx(ways[0], rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("optimiser", [LevenbergMarquardt(iterations=2, tolerance=1e-14), BFGS(iterations=2)])
def test_running_out_of_iterations_is_reported(optimiser):
    last, history = watched(optimiser, Rosenbrock())
    assert last.reason is Reason.ITERATIONS
    assert [iterate.number for iterate in history] == [0, 1, 2]


@each_optimiser
def test_nothing_feasible_ahead_is_reported_and_the_start_kept(optimiser):
    last, _ = watched(optimiser, Cliff())
    assert last.reason is Reason.BLOCKED
    assert last.refusal in last.reason.words(last.refusal)
    assert np.array_equal(last.evaluation.parameters, np.zeros(2))


@each_optimiser
def test_a_start_without_a_value_is_refused(optimiser):
    with pytest.raises(Infeasible, match="too large"):
        watched(optimiser, Rosenbrock(), Start(np.array([2.0, 0.0])))


@each_optimiser
def test_a_minimum_is_recognised_at_once(optimiser):
    problem = Rosenbrock()
    last, history = watched(optimiser, problem, Start(np.ones(2)))
    assert last.reason is Reason.CONVERGED
    assert (last.number, last.evaluations) == (0, 1)
    assert len(history) == 2


@pytest.mark.parametrize("one_sided", [False, True])
def test_a_saddle_from_which_no_first_order_step_leads_is_left(one_sided):
    problem = Ridge(-1.0, one_sided=one_sided)
    last, history = watched(LevenbergMarquardt(), problem)
    assert last.reason is Reason.CONVERGED
    assert abs(last.evaluation.parameters[0]) == pytest.approx(np.sqrt(0.1), rel=0.05)
    numbers = [iterate.number for iterate in history]
    assert numbers == sorted(numbers) and [own.reason for own in history[:-1]] == [None] * (len(history) - 1)
    assert last.evaluations == len(problem.asked)


def test_a_minimum_where_residuals_depend_on_nothing_is_returned_to():
    problem = Ridge(1.0)
    last, _ = watched(LevenbergMarquardt(), problem)
    assert last.reason is Reason.CONVERGED and np.array_equal(last.evaluation.parameters, problem.start)
    assert np.array_equal(problem.asked[-1], problem.start) and last.evaluations == len(problem.asked)


@pytest.mark.parametrize("optimiser", [LevenbergMarquardt(), LevenbergMarquardt(tolerance=0.05), SQP()])
def test_a_jump_of_the_objective_is_crossed_where_what_is_beyond_falls_lower(optimiser):
    problem = Jump(0.0)
    last, history = watched(optimiser, problem)
    assert last.evaluation.parameters == pytest.approx([1.9], abs=0.05)
    numbers = [iterate.number for iterate in history]
    assert numbers == sorted(numbers) and [own.reason for own in history[:-1]] == [None] * (len(history) - 1)
    assert last.evaluations == len(problem.asked)


def test_an_end_before_a_jump_is_returned_to_where_nothing_beyond_is_lower():
    problem = Jump(1.0)
    last, _ = watched(LevenbergMarquardt(), problem)
    assert last.reason is not None and last.evaluation.parameters == pytest.approx([0.4], abs=0.05)
    assert last.evaluation.parameters[0] <= 0.4 and last.evaluations == len(problem.asked)
    assert np.array_equal(problem.asked[-1], last.evaluation.parameters)


def test_least_squares_structure_pays():
    fast, slow = (watched(m, Rosenbrock())[0].evaluations for m in OPTIMISERS)
    assert fast < slow


class Bent(Problem):
    """r = x + x² − 2, which a first step from 0 overshoots."""

    def __init__(self) -> None:
        super().__init__(np.zeros(1), np.ones(1))

    def residuals(self, parameters):
        return parameters + parameters**2 - 2.0, np.diag(1.0 + 2.0 * parameters)


@pytest.mark.parametrize("poor", [-1e9, 0.1], ids=["accepted", "refused"])
def test_residuals_of_second_degree_along_a_step_are_met_by_the_next_one(poor):
    bent = Bent()
    last, _ = watched(LevenbergMarquardt(tolerance=1e-14, damping=1e-12, poor=poor), bent)
    assert bent.refused == (poor > 0.0)
    assert bent.asked[1] == pytest.approx([2.0], abs=1e-6)
    assert bent.asked[2] == pytest.approx([1.0], abs=1e-6)
    assert last.evaluation.parameters == pytest.approx([1.0], abs=1e-9)


class Edge(Problem):
    """r = (y, x − 1), without values where x + y² > ½: the way to the minimum ends at this edge."""

    def __init__(self) -> None:
        super().__init__(np.array([0.0, 0.5]), np.ones(2))

    def residuals(self, parameters):
        x, y = parameters
        if x + y**2 > 0.5:
            raise Infeasible("beyond the edge")
        return np.array([y, x - 1.0]), np.array([[0.0, 1.0], [1.0, 0.0]])


@pytest.mark.parametrize("optimiser", [LevenbergMarquardt(), SQP()])
def test_steps_made_short_by_points_without_values_do_not_end_at_a_minimum(optimiser):
    last, history = watched(optimiser, Edge())
    assert last.reason is Reason.BLOCKED and not last.reason.converged
    assert last.reason.words(last.refusal).endswith("beyond the edge")
    assert last.reduction > optimiser.least_reduction
    # a run resumed before its end knows the reason, too
    before = history[-2]
    start = Start(
        before.evaluation.parameters, before.number, before.evaluations, before.memory, refusal=before.refusal
    )
    assert watched(optimiser, Edge(), start)[0].refusal == last.refusal


def test_steps_do_not_cross_barriers_that_the_residual_alone_would_cross():
    exact, parabola = Wall(), Wall(quadratic=True)
    optimiser = LevenbergMarquardt(tolerance=1e-6)
    (last, _), (other, _) = (watched(optimiser, problem) for problem in (exact, parabola))
    optimum = brentq(lambda x: exact.BARRIER.slope(x) + x - 10.0, 1.0, 2.0)
    assert last.evaluation.parameters == pytest.approx([optimum], rel=1e-5)
    assert other.evaluation.parameters == pytest.approx([optimum], rel=1e-2)
    # the first step ends where the barrier balances the residual, not where the residual vanishes
    assert max(p[0] for p in exact.asked) < optimum + 1e-3
    assert max(p[0] for p in parabola.asked) > 9.0
    assert len(exact.asked) <= 4
    assert len(parabola.asked) >= 2 * len(exact.asked)


def test_bfgs_takes_walls_of_the_regulariser_exactly():
    problem = Wall()
    last, _ = watched(BFGS(tolerance=1e-9), problem)
    optimum = brentq(lambda x: problem.BARRIER.slope(x) + x - 10.0, 1.0, 2.0)
    assert last.reason is Reason.CONVERGED
    assert last.evaluation.parameters == pytest.approx([optimum], rel=1e-4)
    assert len(problem.asked) <= 10


@each_optimiser
def test_resuming_from_any_iterate_repeats_the_uninterrupted_run(optimiser):
    _, history = watched(optimiser, Rosenbrock(spring=1e-3))
    assert len(history) > 8
    for index, iterate in enumerate(history[:-1]):
        # as it comes back from a file
        numbers = json.loads(json.dumps([iterate.evaluation.parameters.tolist(), iterate.memory.tolist()]))
        start = Start(np.array(numbers[0]), iterate.number, iterate.evaluations, np.array(numbers[1]))
        _, again = watched(optimiser, Rosenbrock(spring=1e-3), start)
        rest = history[index:]
        assert len(again) == len(rest)
        for ours, theirs in zip(again, rest, strict=True):
            assert ours.number == theirs.number
            assert ours.evaluations == theirs.evaluations + 1  # the start was evaluated once more
            assert np.array_equal(ours.evaluation.parameters, theirs.evaluation.parameters)
            assert np.array_equal(ours.memory, theirs.memory)
            assert (ours.reduction, ours.reason) == (theirs.reduction, theirs.reason)


def test_three_steps_that_gain_next_to_nothing_are_enough():
    # damping so strong that a step gains little although the predicted reduction is large
    crawling = LevenbergMarquardt(tolerance=1e-3, damping=1e9, tries=0)
    last, history = watched(crawling, Rosenbrock())
    assert last.reason is Reason.CONVERGED
    assert last.reduction > crawling.tolerance
    assert last.number == 3
    assert len(history) == 5
