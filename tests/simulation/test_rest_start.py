"""Mechanisms that nothing but loads holds: equilibria start from the rigid pose that the loads prefer."""

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

LENGTH = 60.0
WIDTH, DEPTH = 2.0, 5.0


def simulated(mechanism: fm.Mechanism, *effects: fm.Effect, space: str = "plane-stress") -> fm.Simulation:
    return fm.Simulation(fm.Scene(mechanism, effects=effects), space=space, size=2.0, comm=MPI.COMM_SELF)


def pendulum(direction, *effects_of_gravity):
    """A rod that hangs from a hinge, drawn straight down, with a force at its lower end."""
    mechanism = fm.Mechanism("pendulum")
    base = mechanism.rigid("base", fixed=True)
    material = fm.Material("nylon", 1770.0, 0.42, density=1e-6)
    rod = mechanism.flexible("rod", fm.strip([(0, 0), (0, -LENGTH)], thickness=WIDTH, depth=DEPTH), material)
    mechanism.revolute(base, rod, at=(0, 0), interface_radius=1.0)
    pull = mechanism.force(on=rod, at=(0, -LENGTH), direction=direction, name="pull")
    return simulated(mechanism, *effects_of_gravity), pull


def four_bar(direction=(1, 0)):
    """Four hinges, a flexible coupler and a force on the rocker: nothing holds the crank."""
    mechanism = fm.Mechanism("four-bar")
    base, crank, rocker = mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("rocker")
    shape = fm.strip([(10, 30), (70, 45)], thickness=WIDTH, depth=DEPTH)
    coupler = mechanism.flexible("coupler", shape, fm.ONYX)
    mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, coupler, at=(10, 30), interface_radius=1.0)
    mechanism.revolute(coupler, rocker, at=(70, 45), interface_radius=1.0)
    mechanism.revolute(rocker, base, at=(80, 0))
    pull = mechanism.force(on=rocker, at=(70, 45), direction=direction, name="pull")
    return simulated(mechanism), pull


def rssr(angle: float):
    """A four-bar in space whose crank is drawn at an angle to its coupler, and free to turn."""
    mechanism = fm.Mechanism("RSSR four-bar")
    ground, crank, rocker = (mechanism.rigid(name, fixed=name == "ground") for name in ("ground", "crank", "rocker"))
    end = (20.0 * math.cos(angle), 20.0 * math.sin(angle))
    coupler = mechanism.flexible("coupler", fm.strip([end, (80, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    mechanism.revolute(ground, crank, at=(0, 0, 0))
    mechanism.spherical(crank, coupler, at=(*end, 0), interface_radius=1.5)
    mechanism.spherical(coupler, rocker, at=(80, 0, 0), interface_radius=1.5)
    mechanism.revolute(rocker, ground, at=(80, 0, 40), axis=(0, 1, 0))
    pull = mechanism.force(on=rocker, at=(80, 0, 10), direction=(1, 0, 0), name="pull")
    return fm.Simulation(fm.Scene(mechanism), space="3d", size=3.0, comm=MPI.COMM_SELF), pull


def test_pulled_rod_swings_into_the_line_of_the_force_and_stretches_there():
    simulation, pull = pendulum((1, 0))
    curve = simulation.load_displacement(pull, forces=[0.0, 1e-3, 1.0, 2.0])
    assert curve.displacements[0] == 0.0
    assert curve.displacements[1] == pytest.approx(LENGTH, rel=1e-6)
    # an end at y = 0, and of the tension all but what the hinge's disc takes
    stretched = curve.displacements[1:] - LENGTH
    assert stretched[2] / stretched[1] == pytest.approx(2.0, rel=1e-3)
    assert stretched[1] == pytest.approx(LENGTH / (1770.0 * WIDTH * DEPTH), rel=0.05)
    for frame in curve.frames[1:]:
        assert frame.stable and not frame.snapped_through and frame.iterations <= 5


@pytest.mark.parametrize(
    "describe",
    [pytest.param(four_bar, id="plane"), pytest.param(lambda: rssr(0.6), id="space", marks=pytest.mark.thorough)],
)
def test_load_steps_agree_with_the_path_that_is_followed(describe):
    simulation, pull = describe()
    curve = simulation.load_displacement(pull, forces=[1e-3, 5.0, 20.0])
    followed = simulation.follow(pull, until=fm.Until(force=20.0))
    assert curve.displacements[-1] == pytest.approx(followed.displacements[-1], rel=1e-8)
    assert followed.events == () and followed.frames[-1].stable
    assert curve.stable.all() and not curve.snapped_through.any()
    assert max(frame.iterations for frame in curve.frames) <= 5


def test_displacements_within_free_reach_need_no_force_and_those_beyond_it_that_of_load_steps():
    simulation, pull = four_bar()
    pulled = simulation.load_displacement(pull, forces=[1e-3, 10.0])
    reach, end = pulled.displacements
    curve = simulation.load_displacement(pull, displacements=[0.2 * reach, 0.9 * reach, end])
    assert np.abs(curve.forces[:2]).max() < 1e-9
    assert curve.forces[2] == pytest.approx(10.0, rel=1e-6)
    assert curve.stable.all() and not curve.snapped_through.any()
    followed = simulation.follow(pull, until=fm.Until(displacement=0.5 * reach))
    assert followed.displacements == pytest.approx([0.0, 0.5 * reach])
    assert abs(followed.forces[-1]) < 1e-9


def test_rod_drawn_against_its_push_is_unstable_under_any_force_and_reports_no_bifurcation():
    simulation, push = pendulum((0, 1))
    curve = simulation.load_displacement(push, forces=[1e-3, 0.1])
    assert [frame.unstable_modes for frame in curve.frames] == [1, 1]
    followed = simulation.follow(push, until=fm.Until(force=1.0))
    assert followed.events == ()
    assert {frame.unstable_modes for frame in followed.frames[1:]} == {1}


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_weight_holds_a_rod_before_the_force_begins(sense):
    gravity = 9810.0
    simulation, pull = pendulum((1, 0), fm.Gravity((gravity, 0.0)))
    weight = 1e-6 * gravity * LENGTH * WIDTH * DEPTH
    curve = simulation.load_displacement(pull, forces=[0.0, sense * 0.01 * weight])
    # along x in both cases: half the weight is more than the force
    assert curve.displacements == pytest.approx([LENGTH, LENGTH], rel=1e-3)
    assert not curve.snapped_through.any() and curve.frames[0].stable
    assert max(frame.iterations for frame in curve.frames) <= 5
