"""Bifurcations are found on straight paths, and the paths that cross there are followed, or stepped onto."""

from math import pi

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import fenicsmech as fm
from fenicsmech.continuation import ArcLengthStepper
from fenicsmech.effects import JointSpring

from ..equilibrium.column import DEPTH, EULER, LENGTH, THICKNESS, YOUNG, Column, column, critical_load

CRITICAL = critical_load(0.5 * THICKNESS)


def elastica(shortening: float) -> float:
    """The load over that of Euler of an inextensible pinned column whose pins have come so much closer.

    With k = sin(α/2) of the angle α at the pins: P / P_E = (2 K(k) / π)², shortening / L = 2 − 2 E(k) / K(k).
    """
    m = brentq(lambda m: 2.0 - 2.0 * ellipe(m) / ellipk(m) - shortening / LENGTH, 1e-12, 0.99)
    return (2.0 * ellipk(m) / pi) ** 2


def straight(case: Column) -> fm.FollowedCurve:
    return case.simulation.follow(case.push, until=fm.Until(force=1.1 * EULER))


def test_first_two_bifurcations_of_a_column_are_those_of_euler():
    case = column()
    curve = case.simulation.follow(case.push, until=fm.Until(force=5.0 * EULER))
    assert [event.kind for event in curve.events] == [fm.Critical.BIFURCATION] * 2
    assert [event.frame.force for event in curve.events] == pytest.approx([EULER, 4.0 * EULER], rel=1e-2)
    assert [event.modes for event in curve.events] == [1, 1]
    modes = [frame.unstable_modes for frame in curve.frames]
    first, second = (event.index for event in curve.events)
    assert modes[:first] == [0] * first and set(modes[first + 1 : second]) == {1} and modes[-1] == 2


@pytest.mark.thorough
def test_buckled_column_follows_the_elastica_to_both_sides():
    case = column()
    curve = straight(case)
    branches = case.simulation.branches(curve, curve.bifurcations[0], until=fm.Until(displacement=50.0))
    for branch in branches:
        assert branch.frames[0] == curve.bifurcations[0].frame
        assert branch.displacements[-1] == pytest.approx(50.0, rel=1e-9)
        assert branch.stable[1:].all()
        for frame in branch.frames[2:]:
            squeezed = frame.force * LENGTH / (YOUNG * THICKNESS)
            assert frame.force / CRITICAL == pytest.approx(elastica(frame.displacement - squeezed), rel=1e-2)
    motion = [branch.frames[-1].state.u.reshape(-1, 2)[:, 1] for branch in branches]
    assert motion[0].max() > 0.3 * LENGTH or motion[0].min() < -0.3 * LENGTH
    assert np.sign(motion[0].sum()) == -np.sign(motion[1].sum())
    assert np.abs(motion[0] + motion[1]).max() < THICKNESS  # the upper side is now the lower one


@pytest.mark.thorough
def test_second_branch_is_found_where_it_crosses():
    case = column()
    curve = case.simulation.follow(case.push, until=fm.Until(force=5.0 * EULER))
    branch, _ = case.simulation.branches(curve, curve.bifurcations[1], until=fm.Until(displacement=1.0))
    assert branch.forces[-1] == pytest.approx(4.0 * CRITICAL, rel=2e-2)
    assert branch.frames[-1].unstable_modes == 1


@pytest.mark.thorough
@pytest.mark.parametrize("size, most", [(THICKNESS, 3), (0.7 * THICKNESS, 10)])
def test_bifurcation_is_located_by_few_equilibria_to_the_accuracy_of_the_eigenvalue(size, most, monkeypatch):
    # the finer mesh is not symmetric: it turns the bifurcation into two paths that pass each other
    solved, between = [], ArcLengthStepper.between

    def counted(*arguments):
        solved.append(1)
        return between(*arguments)

    case = column(size=size)
    near = case.simulation.load_displacement(case.push, forces=[0.9 * CRITICAL])
    loads = [load.value for load in near.buckling_points(count=1)]
    monkeypatch.setattr(ArcLengthStepper, "between", counted)
    steps = fm.ArcSteps(largest=0.2)
    curve = case.simulation.follow(case.push, until=fm.Until(force=1.1 * EULER, frames=50), steps=steps)
    (event,) = curve.bifurcations
    ending = 3  # equilibria on the way to the force at the end
    assert len(solved) <= most + ending
    assert event.value == pytest.approx(loads[0], rel=1e-6)
    assert event.frame.force == pytest.approx(loads[0], rel=1e-3)


def test_load_steps_from_a_stable_equilibrium_end_on_the_stable_branch_beyond_a_bifurcation():
    # both links of a shallow toggle buckle; pinned, they press with π² EI / ℓ² (1 + shortening / 2 ℓ)
    half, rise, thickness, down, young = 40.0, 10.0, 4.0, 5.0, 2000.0
    mechanism, plastic = fm.Mechanism("toggle"), fm.Material("plastic", young, 0.3)
    base, links, springs = mechanism.rigid("base", fixed=True), [], []
    for name, x in (("left", -half), ("right", half)):
        shape = fm.strip([(x, 0), (0, rise)], thickness=thickness, depth=1.0)
        links.append(mechanism.flexible(name, shape, plastic))
        pin = mechanism.revolute(base, links[-1], at=(x, 0), interface_radius=0.5 * thickness)
        springs.append(JointSpring(pin, 10.0))
    mechanism.revolute(*links, at=(0, rise), interface_radius=0.5 * thickness)
    push = mechanism.force(on=links[0], at=(0, rise), direction=(0, -1))
    scene = fm.Scene(mechanism, effects=springs)
    simulation = fm.Simulation(scene, space="plane-stress", size=thickness, comm=MPI.COMM_SELF)
    (frame,) = simulation.load_displacement(push, displacements=[down]).frames
    long, short = np.hypot(half, rise), np.hypot(half, rise - down)
    load = pi**2 * young * thickness**3 / 12.0 / long**2 * (1.0 + 0.5 * (1.0 - short / long))
    assert frame.stable_under_control
    assert frame.force == pytest.approx(2.0 * load * (rise - down) / short, rel=1e-2)


def test_an_event_that_is_not_a_bifurcation_of_the_curve_is_refused():
    case = column()
    curve = straight(case)
    event = curve.bifurcations[0]
    other = column()
    with pytest.raises(fm.DescriptionError, match="not a bifurcation of the curve"):
        other.simulation.branches(straight(other), event, until=fm.Until(force=1.0))
    with pytest.raises(fm.DescriptionError, match="does not say where"):
        case.simulation.branches(curve, event, until=1.0)


@pytest.mark.thorough
def test_two_columns_that_buckle_at_once_each_have_their_branches():
    mechanism = fm.Mechanism("two columns")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    for y in (0.0, 20.0):
        shape = fm.strip([(0, y), (LENGTH, y)], thickness=THICKNESS, depth=DEPTH)
        strut = mechanism.flexible(f"strut at {y:g}", shape, fm.Material("steel", YOUNG, 0.3))
        mechanism.revolute(base, strut, at=(0, y), interface_radius=0.5 * THICKNESS)
        mechanism.revolute(strut, head, at=(LENGTH, y), interface_radius=0.5 * THICKNESS)
    mechanism.prismatic(base, head, at=(LENGTH, 10), axis=(1, 0))
    push = mechanism.force(on=head, at=(LENGTH, 10), direction=(-1, 0))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=THICKNESS, comm=MPI.COMM_SELF)
    curve = simulation.follow(push, until=fm.Until(force=2.2 * EULER))
    (event,) = curve.bifurcations
    assert event.modes == len(event.null_space) == 2
    assert event.value == pytest.approx(2.0 * CRITICAL, rel=1e-4)
    until = fm.Until(displacement=0.02)
    with pytest.raises(fm.DescriptionError, match="2 modes become unstable at once.*mode="):
        simulation.branches(curve, event, until=until)
    with pytest.raises(fm.DescriptionError, match="does not belong to the event"):
        simulation.branches(curve, event, until=until, mode=curve.frames[0])
    buckled = set()
    for mode in event.null_space:
        for branch in simulation.branches(curve, event, until=until, mode=mode):
            motion = branch.frames[-1].state.u.reshape(-1, 2)[:, 1]
            owner = simulation.model.node_link[: len(motion)]
            sides = [motion[owner == link][np.argmax(np.abs(motion[owner == link]))] for link in (0, 1)]
            assert max(np.abs(sides)) > 0.5 * THICKNESS
            buckled.add(tuple(int(np.sign(side)) * (abs(side) > 0.05 * THICKNESS) for side in sides))
    assert len(buckled) == 4  # each found once


@pytest.mark.parallel
@pytest.mark.thorough
def test_bifurcation_and_branch_are_the_same_on_any_number_of_ranks():
    case = column(comm=MPI.COMM_WORLD)
    curve = straight(case)
    (event,) = curve.bifurcations
    assert event.frame.force == pytest.approx(CRITICAL, rel=1e-2)
    for branch in case.simulation.branches(curve, event, until=fm.Until(displacement=1.0)):
        squeezed = branch.forces[-1] * LENGTH / (YOUNG * THICKNESS)
        assert branch.forces[-1] / CRITICAL == pytest.approx(elastica(1.0 - squeezed), rel=1e-2)
