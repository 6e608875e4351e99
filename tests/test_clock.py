"""Phases inside phases are counted once."""

from time import sleep

import pytest

from fenicsmech.clock import Clock


def test_a_phase_does_not_count_those_inside_it():
    clock = Clock()
    with clock.phase("outer"):
        with clock.phase("inner"):
            sleep(0.05)
        with clock.phase("inner"), clock.phase("innermost"):
            sleep(0.03)
    assert clock.seconds["inner"] >= 0.05 and clock.seconds["innermost"] >= 0.03
    assert clock.seconds["outer"] < 0.03


def test_what_follows_a_phase_inside_another_counts_for_the_outer_one():
    clock = Clock()
    with clock.phase("outer"):
        with pytest.raises(ValueError), clock.phase("inner"):
            raise ValueError
        sleep(0.03)
    assert clock.seconds["outer"] >= 0.03 > clock.seconds["inner"]
