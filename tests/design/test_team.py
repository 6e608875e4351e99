"""One process decides, all compute: the same outcome on all, errors too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.design import (
    Evaluation,
    Infeasible,
    LevenbergMarquardt,
    Quadratic,
    Reason,
    Start,
    TooHigh,
    minimise_together,
)

pytestmark = pytest.mark.parallel

COMM = MPI.COMM_WORLD


class Valley:
    """r = (10 (y − x²), 1 − x), to which every process contributes a part; infeasible beyond x = 1.2."""

    def __init__(self) -> None:
        self.lengths, self.reached, self.asked = np.ones(2), np.zeros(2), 0

    def errors(self) -> np.ndarray:
        return np.zeros(2)

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        self.asked += 1
        x, y = COMM.allreduce(parameters / COMM.size)  # hangs unless all take part
        if x > 1.2:
            raise Infeasible("x is too large")
        self.reached = np.array([x, y])
        residuals = np.array([10.0 * (y - x * x), 1.0 - x])
        evaluation = Evaluation(
            parameters, residuals, np.array([[-20.0 * x, 10.0], [-1.0, 0.0]]), lambda p: Quadratic.zero(2)
        )
        if (height := evaluation.merit(penalties)) > below:
            raise TooHigh(height)
        return evaluation


def test_all_processes_have_the_outcome_and_evaluate_alike():
    valley, seen = Valley(), []
    outcome = minimise_together(
        COMM, valley, LevenbergMarquardt(tolerance=1e-10), Start(np.array([-1.2, 1.0])), watch=seen.append
    )
    assert outcome.parameters == pytest.approx([1.0, 1.0], abs=1e-4)
    assert outcome.reason is Reason.CONVERGED
    assert valley.asked == outcome.evaluations
    assert COMM.allgather(outcome.parameters.tolist()) == [outcome.parameters.tolist()] * COMM.size
    assert COMM.allgather((outcome.number, outcome.evaluations)) == [(outcome.number, outcome.evaluations)] * COMM.size
    assert bool(seen) == (COMM.rank == 0)


class Blurred(Valley):
    """The same with residuals that are wrong by 0.1, as all processes together find out."""

    def errors(self) -> np.ndarray:
        return np.full(2, COMM.allreduce(0.1 / COMM.size))

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        return replace(super().evaluate(parameters, below, penalties), errors=self.errors)


def test_all_processes_estimate_errors_together():
    plain, blurred = (
        minimise_together(COMM, valley, optimiser, Start(np.array([-1.2, 1.0])), watch=lambda iterate: None)
        for valley, optimiser in ((Valley(), LevenbergMarquardt(tolerance=1e-10)), (Blurred(), LevenbergMarquardt()))
    )
    assert blurred.reason is Reason.RESOLVED
    assert blurred.evaluations < plain.evaluations
    assert blurred.parameters == pytest.approx(plain.parameters, abs=0.1)
    assert COMM.allgather(blurred.parameters.tolist()) == [blurred.parameters.tolist()] * COMM.size


def test_a_start_without_a_value_is_refused_on_all_processes():
    with pytest.raises(Infeasible, match="too large"):
        minimise_together(COMM, Valley(), LevenbergMarquardt(), Start(np.array([2.0, 0.0])), watch=lambda i: None)


def test_an_error_of_the_watcher_ends_all_processes():
    def full(iterate):
        if iterate.number == 2:
            raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space"):
        minimise_together(COMM, Valley(), LevenbergMarquardt(), Start(np.array([-1.2, 1.0])), watch=full)


class Broken(Valley):
    """Fails at its third evaluation on some ranks, once all have taken part."""

    def __init__(self, ranks: set[int]) -> None:
        super().__init__()
        self._ranks = ranks

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        evaluation = super().evaluate(parameters, below, penalties)
        if self.asked == 3 and COMM.rank in self._ranks:
            raise ZeroDivisionError("broken")
        return evaluation


def test_an_error_while_evaluating_ends_the_minimisation_on_all_processes():
    with pytest.raises(ZeroDivisionError, match="broken"):
        minimise_together(
            COMM, Broken({*range(COMM.size)}), LevenbergMarquardt(), Start(np.array([0.5, 0.0])), watch=lambda i: None
        )
    assert COMM.bcast(COMM.rank) == 0  # no message of before is left


def test_an_error_of_one_process_is_raised_on_all():
    valley, start = Broken({COMM.size - 1}), Start(np.array([0.5, 0.0]))
    with pytest.raises(ZeroDivisionError, match="broken"):
        minimise_together(COMM, valley, LevenbergMarquardt(), start, watch=lambda i: None)
    assert COMM.bcast(COMM.rank) == 0
