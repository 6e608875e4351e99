"""Surfaces that obstacles touch are loaded there alone: the rest of a link stays free of traction."""

import pytest

from ..effects.touching import cantilever, finger


def test_a_propped_cantilever_has_the_peak_of_its_moment():
    # gap closes at P a² (3 L − a) / 6 EI: before, at P = 0.02, nothing touches
    case = cantilever("plane-stress", gap=1.0)
    free, propped = case.simulation.load_displacement(case.force, forces=[0.02, 0.12]).frames
    reaction = case.measure(propped)[0][1]
    assert reaction > 0.01
    for frame, tip in ((free, 0.0), (propped, reaction)):
        peak = frame.peaks["beam"]
        x = peak.place[0]
        # 6 M / b h²
        assert x < 5.0
        assert peak.value == pytest.approx(6.0 * (frame.force * (50.0 - x) - tip * (100.0 - x)) / 12.0, rel=0.01)
        assert peak.error < 0.01 * peak.value


def test_an_obstacle_out_of_reach_leaves_the_peak_as_it_is():
    far, without = finger("plane-stress", centre=(-100.0, 38.0)), finger("plane-stress", active=False)
    one, other = (case.simulation.load_displacement(case.force, forces=[0.1]).frames[0].peak for case in (far, without))
    assert one.value == pytest.approx(other.value, rel=1e-8)
    assert one.place == other.place
