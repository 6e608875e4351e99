"""A bistable four-bar with one flexible link snaps between the two assemblies of the rigid one."""

import numpy as np
import pytest

import fenicsmech as fm

from .bistable import RISE, forces, four_bar


@pytest.mark.thorough
def test_four_bar_snaps_as_its_follower_bends_and_rests_in_the_mirror_image():
    case = four_bar()
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=2.2 * RISE))
    upper, lower = curve.limit_points
    assert len(curve.events) == 2
    some = np.arange(0, len(curve.frames), 4)
    expected = forces(curve.displacements[some])
    assert curve.forces[some] == pytest.approx(expected, abs=1e-2 * expected.max())
    around = [event.frame.displacement + shift for event in (upper, lower) for shift in (-0.6, 0.0, 0.6)]
    before, top, behind, above, bottom, beyond = forces(np.array(around))
    assert upper.frame.force == pytest.approx(top, rel=1e-2) and top > max(before, behind)
    assert lower.frame.force == pytest.approx(bottom, rel=1e-2) and bottom < min(above, beyond)
    rest = case.simulation.load_displacement(case.push, displacements=np.linspace(0.0, 2.0 * RISE, 9)).frames[-1]
    assert rest.force == pytest.approx(0.0, abs=1e-6 * expected.max())
    assert rest.strain_energy == pytest.approx(0.0, abs=1e-9) and rest.stable


@pytest.mark.thorough
def test_path_until_the_force_is_gone_passes_the_middle_and_the_next_one_rests():
    case = four_bar()
    middle = case.simulation.follow(case.push, until=fm.Until(displacement=1.2 * RISE))
    assert not middle.frames[-1].stable and middle.forces[-1] < 0.0
    end = case.simulation.follow(case.push, until=fm.Until(force=(0.0, 1e6)))
    assert end.forces[-1] == pytest.approx(0.0, abs=1e-6)
    assert not end.frames[-1].stable and 0.8 * RISE < end.displacements[-1] < 1.2 * RISE
