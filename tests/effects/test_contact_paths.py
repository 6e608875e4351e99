"""Paths of equilibria, followed by their arc length, on which points of links come to touch obstacles."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.continuation import Critical
from fenicsmech.equilibrium import LoadControl

from .touching import arch_over_floor, block, cantilever, channel, wrapped, wrapped_tip, wrapping_force

LEAST = 20  # frames of a straight path: steps are at most a twentieth of its length


def test_wrapping_is_followed_in_steps_that_do_not_depend_on_the_points_that_touch():
    case, last = wrapped(), wrapping_force(0.05)
    curve = case.simulation.follow(case.force, until=fm.Until(force=last))
    assert len(curve.frames) <= 2 * LEAST
    assert not curve.events
    for frame in curve.frames[1:]:
        load = 0.05 * frame.force / last
        assert frame.displacement == pytest.approx(wrapped_tip(load), rel=1e-3)
        assert frame.stable
    touching = []
    for frame in curve.frames:
        case.simulation.model.load(frame.state)
        touching.append(case.simulation.solver(case.force).system.contact.touching())
    changes = [np.sum(a != b) for a, b in zip(touching, touching[1:], strict=False)]
    assert sum(changes) > len(curve.frames)  # so that a frame for each change would be more


@pytest.mark.parametrize("build, last", [(lambda: cantilever("plane-stress", gap=1.0), 0.3), (channel, 40.0)])
def test_paths_turn_corners_where_links_meet_obstacles_and_end_where_load_steps_do(build, last):
    case = build()
    followed = case.simulation.follow(case.force, until=fm.Until(force=last)).frames
    stepped = case.simulation.load_displacement(case.force, forces=[0.25 * last, 0.5 * last, last]).frames
    assert len(followed) <= 2 * LEAST
    assert followed[-1].displacement == pytest.approx(stepped[-1].displacement, rel=1e-8)
    assert followed[-1].stable


def test_frames_of_a_path_with_contact_are_those_of_their_loads():
    case = cantilever("plane-stress", gap=1.0)
    frames = case.simulation.follow(case.force, until=fm.Until(force=0.3)).frames[1:]
    solver = case.simulation.solver(case.force)
    for before, frame in zip(frames, frames[1:], strict=False):
        found = solver.solve(before.state, LoadControl(frame.force)).state.u
        assert np.abs(found - frame.state.u).max() < 1e-8 * np.abs(found).max()


def test_an_arch_that_snaps_onto_a_floor_is_followed_past_the_limit_point_and_the_corner():
    case = arch_over_floor()
    curve = case.simulation.follow(case.force, until=fm.Until(displacement=6.5))
    highest, lowest = curve.limit_points
    # the force falls as the arch snaps, until its crown meets the floor, and rises from there
    assert highest.kind is lowest.kind is Critical.LIMIT
    assert lowest.value < highest.value < curve.frames[-1].force
    assert not curve.frames[highest.index + 1].stable
    assert curve.frames[-1].stable
    assert case.measure(curve.frames[-1])[0][1] > 0.0
    held = case.simulation.load_displacement(case.force, displacements=[3.0, 5.0, 6.5]).frames[-1]
    assert held.force == pytest.approx(curve.frames[-1].force, rel=1e-6)


def test_a_block_that_is_held_by_its_obstacle_alone_is_followed():
    case = block("plane-stress", 30.0)
    frame = case.simulation.follow(case.force, until=fm.Until(force=20.0)).frames[-1]
    assert case.measure(frame)[1] == pytest.approx(-20.0 / (50.0 * 30.0), rel=1e-3)
