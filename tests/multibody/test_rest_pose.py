"""The pose that loads prefer is least in their potential, and a search without a pose says why."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fenicsmech.mechanism import Mechanism
from fenicsmech.multibody import BodyPoint, DeadLoad, RestEnding, RestSearch, build_linkage


class Loaded:
    """A bar on one joint to the ground, drawn along x from there, with dead loads."""

    def __init__(self, joint: str, dim: int = 2, **place) -> None:
        mechanism = Mechanism("bar")
        ground, bar = mechanism.rigid("ground", fixed=True), mechanism.rigid("bar")
        getattr(mechanism, joint)(ground, bar, at=(0.0, 0.0), **place)
        far = mechanism.rigid("far", fixed=True)  # sets the length of the mechanism
        mechanism.revolute(ground, far, at=(10.0, 0.0))
        self.system = build_linkage(mechanism, dim).joints
        self.body = [body.link.name for body in self.system.bodies].index("bar")

    def point(self, *offset: float) -> BodyPoint:
        return BodyPoint(self.body, np.array(offset), self.system.space)

    def turn(self, *loads, **options):
        system = self.system
        motors = np.zeros(len(system.connections))
        return RestSearch(**options).pose(system, system.drawn, motors, [(), loads])


def test_a_force_without_end_and_a_search_that_is_too_short_are_told_apart():
    slide, crank = Loaded("prismatic", axis=(1.0, 0.0)), Loaded("revolute")
    pull = np.array([1.0, 0.5])
    driven = slide.turn(DeadLoad.at(slide.point(0.0, 0.0), pull))
    assert driven.ending is RestEnding.DRIVEN_ON
    short = crank.turn(DeadLoad.at(crank.point(4.0, -3.0), pull), steps=2)
    assert short.ending is RestEnding.NOT_CONVERGED and len(short.way) == 3
    found = crank.turn(DeadLoad.at(crank.point(4.0, -3.0), pull))
    assert found.ending is RestEnding.AT_REST
    assert found.way[-1][crank.body, 2] == pytest.approx(math.atan2(0.5, 1.0) - math.atan2(-3.0, 4.0))


def test_forces_without_a_sum_turn_a_body_by_their_moments():
    crank = Loaded("revolute")
    # opposite forces across the bar, at both of its ends: it turns until they stretch it
    couple = DeadLoad(crank.body, np.zeros(2), np.outer([0.0, 3.0], [2.0, 0.0]), crank.system.space)
    found = crank.turn(couple)
    assert found.ending is RestEnding.AT_REST
    assert found.way[-1][crank.body, 2] == pytest.approx(0.5 * math.pi)


@pytest.mark.parametrize("dim", [2, 3])
def test_dead_loads_of_several_directions_are_the_sum_of_their_forces(dim):
    crank, rng = Loaded("revolute", dim), np.random.default_rng(1)
    forces, offsets = rng.standard_normal((2, 5, dim))
    space, poses = crank.system.space, crank.system.drawn.copy()
    poses = crank.system.with_unknowns(poses, crank.system.unknowns(poses) + rng.standard_normal(crank.system.size))
    whole = DeadLoad(crank.body, forces.sum(axis=0), forces.T @ offsets, space)
    parts = [DeadLoad.at(crank.point(*offset), force) for force, offset in zip(forces, offsets, strict=True)]
    points = [crank.point(*offset) for offset in offsets]
    work = sum(force @ point.displacement(None, poses) for force, point in zip(forces, points, strict=True))
    assert whole.value(poses) == pytest.approx(-work) == sum(part.value(poses) for part in parts)
    slope = sum(force @ point.gradient(poses) for force, point in zip(forces, points, strict=True))
    assert whole.gradient(poses) == pytest.approx(-slope)
    curvature = sum(point.hessian(poses, force) for force, point in zip(forces, points, strict=True))
    assert whole.hessian(poses) == pytest.approx(-curvature)


class Noisy(DeadLoad):
    """A dead load whose value rises a little with each step, as rounding may."""

    def __init__(self, rise: float, *own) -> None:
        super().__init__(*own)
        self.rise, self.asked = rise, 0

    def value(self, poses):
        self.asked += 1
        return self.rise * self.asked


def test_rises_within_rounding_do_not_add_up():
    slide = Loaded("prismatic", axis=(1.0, 0.0))
    force = np.array([1.0, 0.0])
    # a quarter of the rounding of a slope of the mechanism's length
    noisy = Noisy(0.25e-12 * slide.system.length, slide.body, force, np.zeros((2, 2)), slide.system.space)
    turn = slide.turn(noisy, reach=1e9)
    assert turn.ending is RestEnding.NOT_CONVERGED and len(turn.way) < 10
