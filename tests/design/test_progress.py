"""Progress of an optimisation: what is shown, and how long it says it will still take."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design import DesignProgress, Evaluation, Iterate, LevenbergMarquardt, Quadratic, Reason

ERRORS = np.array([0.02, -0.25])


@pytest.fixture
def shown(capfd):
    """Output for predicted reductions, one per iteration of ten seconds."""

    def show(optimiser: LevenbergMarquardt, reductions: list[float], last: Reason | None = None) -> list[str]:
        now = 0.0
        with DesignProgress(optimiser, leads=True, clock=lambda: now) as design:
            for number, reduction in enumerate(reductions):
                design.update(iterate(number, reduction, last if number == len(reductions) - 1 else None), ERRORS)
                now += 10.0
        return capfd.readouterr().err.splitlines()

    return show


def iterate(number: int, reduction: float, reason: Reason | None) -> Iterate:
    here = Evaluation(np.zeros(2), np.array([0.2]), np.zeros((1, 2)), lambda p: Quadratic.zero(2))
    return Iterate(number, 2 * number, here, np.zeros(2), reduction, reason)


def test_iteration_objective_and_worst_error_are_shown(shown):
    # and no time left, of which nothing is known yet
    assert shown(LevenbergMarquardt(), [0.9]) == ["design: 0  0.0 s  objective 0.02, worst target error 25.00%"]


def test_time_left_follows_the_trend_of_the_predicted_reduction(shown):
    # a tenth per iteration of ten seconds: two more until 1e-3
    assert "about 20 s left" in shown(LevenbergMarquardt(tolerance=1e-3), [1.0, 0.1])[-1]


def test_time_left_is_at_most_what_the_limit_of_iterations_leaves(shown):
    assert "about 30 s left" in shown(LevenbergMarquardt(iterations=5), [0.5, 0.6, 0.7])[-1]


def test_nothing_is_left_at_the_end(shown):
    assert "left" not in shown(LevenbergMarquardt(), [1.0, 0.1, 1e-4], Reason.CONVERGED)[-1]


def test_a_predicted_reduction_of_zero_is_shown(shown):
    assert "left" in shown(LevenbergMarquardt(), [0.0, 0.0, 0.0])[-1]


def test_only_the_first_process_shows_anything(capfd):
    with DesignProgress(LevenbergMarquardt(), leads=False) as design:
        design.update(iterate(0, 0.9, None), ERRORS)
    assert capfd.readouterr().err == ""
