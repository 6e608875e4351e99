"""Phases inside phases are counted once."""

import pytest

from fenicsmech import log
from fenicsmech.log import Clock


@pytest.fixture
def wait(monkeypatch):
    """Lets time pass, and nothing else does."""
    now = [0]
    monkeypatch.setattr(log, "perf_counter", lambda: now[0])

    def wait(seconds: int) -> None:
        now[0] += seconds

    return wait


def test_a_phase_does_not_count_those_inside_it(wait):
    clock = Clock()
    with clock.phase("outer"):
        wait(1)
        with clock.phase("inner"):
            wait(10)
        with clock.phase("inner"), clock.phase("innermost"):
            wait(100)
    assert clock.seconds == {"outer": 1, "inner": 10, "innermost": 100}


def test_time_after_an_inner_phase_counts_for_the_outer_one(wait):
    clock = Clock()
    with clock.phase("outer"):
        with pytest.raises(ValueError), clock.phase("inner"):
            raise ValueError
        wait(3)
    assert clock.seconds == {"outer": 3, "inner": 0}


def test_seconds_since_an_earlier_moment(wait):
    clock = Clock()
    with clock.phase("before"):
        wait(1)
    then = dict(clock.seconds)
    with clock.phase("after"):
        wait(2)
    assert clock.since(then) == {"before": 0, "after": 2}
