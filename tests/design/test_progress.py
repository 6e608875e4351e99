"""Progress of an optimisation: what is shown, and how long it says it will still take."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design import DesignProgress, Evaluation, Iterate, LevenbergMarquardt, Quadratic, Reason, run

ERRORS = np.array([0.02, -0.25])


class Display:
    """Keeps what is shown."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def update(self, number: int, note: str) -> None:
        self.notes.append(f"{number}: {note}")

    def __enter__(self) -> Display:
        return self

    def __exit__(self, *error) -> None:
        pass


@pytest.fixture
def shown(monkeypatch):
    """Output for promised reductions, one per iteration of ten seconds."""
    ticks = iter(range(0, 10000, 10))
    display = Display()
    monkeypatch.setattr(run, "perf_counter", lambda: float(next(ticks)))
    monkeypatch.setattr(run, "Progress", lambda *arguments, **options: display)

    def show(optimiser: LevenbergMarquardt, promises: list[float], last: Reason | None = None) -> list[str]:
        with DesignProgress(optimiser, leads=True) as design:
            for number, promise in enumerate(promises):
                design.update(iterate(number, promise, last if number == len(promises) - 1 else None), ERRORS)
        return display.notes

    return show


def iterate(number: int, promise: float, reason: Reason | None) -> Iterate:
    here = Evaluation(np.zeros(2), np.array([0.2]), np.zeros((1, 2)), lambda p: Quadratic.zero(2))
    return Iterate(number, 2 * number, here, np.zeros(2), promise, reason)


def test_iteration_objective_and_worst_error_are_shown(shown):
    # and no time left, of which nothing is known yet
    assert shown(LevenbergMarquardt(), [0.9]) == ["0: objective 0.02, worst target error 25.00%"]


def test_time_left_follows_the_trend_of_the_promised_reduction(shown):
    # a tenth per iteration of ten seconds: two more until 1e-3
    assert "about 20 s left" in shown(LevenbergMarquardt(tolerance=1e-3), [1.0, 0.1])[-1]


def test_time_left_is_at_most_what_the_limit_of_iterations_leaves(shown):
    assert "about 30 s left" in shown(LevenbergMarquardt(iterations=5), [0.5, 0.6, 0.7])[-1]


def test_nothing_is_left_at_the_end(shown):
    assert "left" not in shown(LevenbergMarquardt(), [1.0, 0.1, 1e-4], Reason.CONVERGED)[-1]


def test_promises_of_nothing_are_no_trouble(shown):
    assert "left" in shown(LevenbergMarquardt(), [0.0, 0.0, 0.0])[-1]


def test_only_the_first_process_shows_anything(capfd):
    with DesignProgress(LevenbergMarquardt(), leads=False) as design:
        design.update(iterate(0, 0.9, None), ERRORS)
    assert capfd.readouterr().err == ""
