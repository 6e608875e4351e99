"""Load steps that leap over a fold say so, however long they are; those that do not, do not."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm

from .arch import RISE, arch
from .finger import finger


@pytest.fixture(scope="module")
def snapping():
    simulation, push = arch()
    path = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE))
    return simulation, push, path.limit_points[0].frame


@pytest.mark.parametrize("loads", [[1.05], [3.0], [10.0], [0.5, 0.97, 1.02, 1.1], [0.999, 1.01]])
def test_arch_under_more_than_its_limit_load_has_jumped(snapping, loads):
    simulation, push, limit = snapping
    curve = simulation.load_displacement(push, forces=np.array(loads) * limit.force)
    first = int(np.argmax(np.array(loads) > 1.0))
    assert curve.jumped.tolist() == [index == first for index in range(len(loads))]
    assert np.all(curve.displacements[:first] < limit.displacement) and curve.displacements[first] > 1.8 * RISE


def test_arch_below_its_limit_load_or_led_by_its_displacement_has_not_jumped(snapping):
    simulation, push, limit = snapping
    for loads in ([0.9999], [0.5, 0.97, 0.9999, 0.5], [-5.0]):
        curve = simulation.load_displacement(push, forces=np.array(loads) * limit.force)
        assert not curve.jumped.any()
    assert not simulation.load_displacement(push, displacements=[2.4 * RISE]).jumped.any()


def test_jump_is_logged(snapping, caplog):
    simulation, push, limit = snapping
    simulation.load_displacement(push, forces=[1.05 * limit.force])
    assert "the path turns back" in caplog.text


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_finger_that_bends_far_in_one_step_has_not_jumped(space):
    simulation, push = finger(space)
    assert not simulation.load_displacement(push, forces=[8.0]).jumped.any()
