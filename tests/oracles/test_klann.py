"""The closed-form Klann linkage reproduces the patent's drawing and walks."""

from dataclasses import astuple

import numpy as np
import pytest

from . import klann
from .klann import CRANK_SHAFT, DRAWN, DRAWN_ANGLE, FIRST_AXLE, SECOND_AXLE, ground_stroke

TURN = np.radians(np.arange(0.0, 360.5, 0.5))


def test_pivots_stand_as_drawn_at_half_a_turn():
    # the drawing and the lengths are given to 0.001, which the long leg magnifies at the foot
    pose = klann.klann(DRAWN_ANGLE)
    for name, drawn in DRAWN.items():
        assert getattr(pose, name) == pytest.approx(drawn, abs=0.008), name


def test_link_lengths_stay_constant_over_the_turn():
    pose = klann.klann(TURN)
    for ends, length in (
        ((CRANK_SHAFT, pose.crank_pin), 2.976),
        ((pose.crank_pin, pose.elbow), 5.506),
        ((pose.elbow, pose.knee), 6.236),
        ((pose.crank_pin, pose.knee), 11.679),
        ((SECOND_AXLE, pose.elbow), 3.390),
        ((FIRST_AXLE, pose.hip), 7.391),
        ((pose.knee, pose.hip), 10.137),
        ((pose.knee, pose.foot), 13.442),
        ((pose.hip, pose.foot), 22.188),
    ):
        assert np.linalg.norm(np.subtract(*ends), axis=-1) == pytest.approx(length, rel=1e-12)


def test_paths_are_closed_and_continuous():
    for path in astuple(klann.klann(TURN)):
        assert path[0] == pytest.approx(path[-1], abs=1e-12)
        assert np.linalg.norm(np.diff(path, axis=0), axis=-1).max() < 15.0 * np.radians(0.5)


def test_foot_is_on_the_ground_for_half_the_turn():
    stroke = ground_stroke(0.75)
    assert np.degrees(stroke.angles) % 360.0 == pytest.approx([357.0, 182.0], abs=1.0)
    assert stroke.length == pytest.approx(11.86, abs=0.02)


def test_ground_stroke_is_nearly_straight_and_the_step_is_high():
    grounded = klann.klann(np.radians(np.linspace(5.0, 175.0, 341))).foot
    assert np.ptp(grounded[:, 1]) < 0.06 * np.ptp(grounded[:, 0])
    path = klann.klann(TURN).foot
    assert np.ptp(path[:, 1]) > 0.55 * np.ptp(path[:, 0])
