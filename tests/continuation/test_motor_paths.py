"""Curves that motors lead: their torque, where their position turns back, and where other curves cross."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq, minimize_scalar

import fenicsmech as fm
from fenicsmech.mechanism import Motor, Output

from ..equilibrium import column, toggle
from ..equilibrium.bistable import COUPLER, RISE, RUN, forces, four_bar
from ..equilibrium.bow import bow
from ..hard import turned_ends

SOFT = 0.075  # MPa of the toggle's stilt: its head turns back while the toggle snaps


def driven_toggle(comm: MPI.Comm = MPI.COMM_SELF) -> tuple[fm.Simulation, Motor, Output]:
    """The toggle on a soft stilt whose head a motor moves, positive upwards."""
    case = toggle.toggle(stilt_modulus=SOFT)
    mechanism = case.simulation.scene.mechanism
    (guide,) = (joint for joint in mechanism.joints if joint.b.name == "head" and joint.kind.sliding)
    motor = mechanism.motor(guide, name="drive")
    simulation = fm.Simulation(case.simulation.scene, space="plane-stress", order=1, size=6.0, comm=comm)
    return simulation, motor, case.sunk


def check_against_closed_form(curve: fm.FollowedCurve, sunk: Output, *, start: float = 0.0) -> np.ndarray:
    """Compares position and force with those of the toggle, which began at ``start``; returns how far it has sunk."""
    sunk = start + np.array([frame.outputs[sunk] for frame in curve.frames])
    assert curve.displacements == pytest.approx(-toggle.displacement(sunk, SOFT), abs=1e-8)
    assert curve.forces == pytest.approx(-toggle.force(sunk), abs=1e-8)
    return sunk


def test_motor_whose_position_turns_back_is_followed_through_the_equilibria_of_the_closed_form():
    simulation, motor, output = driven_toggle()
    curve = simulation.follow(motor, until=fm.Until(position=-16.0))
    sunk = check_against_closed_form(curve, output)
    assert np.all(np.diff(sunk) > 0.0) and curve.displacements[-1] == pytest.approx(-16.0, rel=1e-9)
    assert [event.kind for event in curve.events] == [fm.Critical.TURNING] * 2
    extrema = [
        minimize_scalar(lambda x, s=sign: -s * toggle.displacement(x, SOFT), bounds=bounds, method="bounded").x
        for sign, bounds in ((1.0, (0.0, 5.0)), (-1.0, (5.0, 10.0)))
    ]
    found = [event.frame.displacement for event in curve.turning_points]
    assert found == pytest.approx(-toggle.displacement(np.array(extrema), SOFT), rel=1e-6)
    assert found[1] > found[0]
    clear = np.delete(np.arange(len(sunk)), [event.index for event in curve.events])
    between = (sunk > extrema[0]) & (sunk < extrema[1])
    assert np.array_equal(curve.stable[clear], ~between[clear]) and between.sum() > 3
    assert [frame.stable_under_control for frame in curve.frames] == curve.stable.tolist()


def test_path_of_a_motor_ends_at_a_force_and_starts_at_the_configuration():
    simulation, motor, output = driven_toggle()
    free = simulation.follow(motor, until=fm.Until(position=-16.0, force=0.5))
    assert free.forces[-1] == pytest.approx(0.5, rel=1e-8)
    check_against_closed_form(free, output)
    away = simulation.scene.configuration("up", {motor: 1.0})
    down = simulation.follow(motor, until=fm.Until(position=-1.0), configuration=away)
    assert down.displacements[[0, -1]] == pytest.approx([1.0, -1.0])
    check_against_closed_form(down, output, start=brentq(lambda x: toggle.displacement(x, SOFT) + 1.0, -1.0, 0.0))


def test_constant_force_acts_along_the_whole_path_of_a_motor():
    simulation, motor, output = driven_toggle()
    head = next(link for link in simulation.scene.mechanism.rigid_links if link.name == "head")
    weight = simulation.scene.mechanism.force(on=head, at=(0, toggle.RISE + toggle.STILT), direction=(0, -1))
    curve = simulation.follow(motor, until=fm.Until(position=-6.5), others={weight: 0.25})
    sunk = np.array([frame.outputs[output] for frame in curve.frames])
    # the motor carries the weight on top of what it does to the toggle
    assert curve.forces == pytest.approx(0.25 - toggle.force(sunk), abs=1e-8)


@pytest.mark.thorough
def test_torque_of_the_crank_of_a_bistable_four_bar_is_that_of_beam_theory():
    case, level = four_bar(MPI.COMM_SELF), np.arctan2(RISE, RUN)
    mechanism = case.simulation.scene.mechanism
    motor = mechanism.motor(mechanism.joints[0])
    simulation = fm.Simulation(case.simulation.scene, space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    curve = simulation.follow(motor, until=fm.Until(position=-2.2 * level))
    positions, torques = curve.displacements, curve.forces
    assert positions[-1] == pytest.approx(-2.2 * level, rel=1e-9)
    assert not curve.events  # held by the motor, nothing snaps
    some = np.arange(1, len(positions), 4)
    knee = level + positions[some]
    # a force down on the knee does the work −F COUPLER cos(angle) per angle
    expected = -forces(RISE - COUPLER * np.sin(knee)) * COUPLER * np.cos(knee)
    assert torques[some] == pytest.approx(expected, abs=1e-2 * np.abs(expected).max())
    last = np.flatnonzero(np.diff(np.sign(torques)))[-1]
    share = torques[last] / (torques[last] - torques[last + 1])
    rest = positions[last] + share * (positions[last + 1] - positions[last])
    assert rest == pytest.approx(-2.0 * level, rel=1e-2)  # the mirror image is free of strain


def test_position_at_which_a_motor_turns_back_is_found_the_better_the_nearer():
    simulation, motor, _ = driven_toggle()
    curve = simulation.follow(motor, until=fm.Until(position=-16.0))
    turning = curve.turning_points[0]
    missed = []
    for index in (0, turning.index // 2, turning.index - 1):
        found = curve.buckling_points(frame=curve.frames[index], count=1)
        missed += [abs(point.value / turning.frame.displacement - 1.0) for point in found]
    assert len(missed) == 3 and missed[0] > missed[1] > missed[2] and missed[2] < 1e-2


def test_column_that_a_slide_shortens_buckles_at_its_euler_load():
    case = column.column()
    mechanism = case.simulation.scene.mechanism
    motor = mechanism.motor(next(joint for joint in mechanism.joints if joint.kind.sliding))
    simulation = fm.Simulation(case.simulation.scene, space="plane-stress", size=column.THICKNESS, comm=MPI.COMM_SELF)
    critical = column.critical_load(0.5 * column.THICKNESS)
    shortening = critical * column.LENGTH / (column.YOUNG * column.THICKNESS * column.DEPTH)
    curve = simulation.follow(motor, until=fm.Until(position=-2.0 * shortening))
    (event,) = curve.bifurcations
    assert event.frame.force == pytest.approx(-critical, rel=1e-2)
    # from rest, without a path: Euler's, and four times as far the next one
    found = [point.value for point in curve.buckling_points(frame=curve.frames[0], count=2)]
    assert found == pytest.approx([event.frame.displacement, 4.0 * event.frame.displacement], rel=1e-2)
    for branch in simulation.branches(curve, event, until=fm.Until(position=-1.0)):
        assert branch.displacements[-1] == pytest.approx(-1.0) and branch.stable[1:].all()
        assert branch.forces[-1] == pytest.approx(-critical, rel=1e-2)


def test_curve_of_a_motor_is_labelled_with_its_own_units(tmp_path):
    simulation, motor, _ = driven_toggle()
    curve = simulation.follow(motor, until=fm.Until(position=-1.0))
    assert [axis.label for axis in curve.axes] == ["position [mm]", "force [N]"]
    curve.plot(tmp_path / "curve.png")
    curve.write_csv(tmp_path / "curve.csv")
    assert (tmp_path / "curve.csv").read_text().startswith("position [mm],force [N],stable,snapped_through,")
    curve.picture(tmp_path / "toggle.png")
    assert (tmp_path / "toggle.png").stat().st_size > 0
    case = four_bar(MPI.COMM_SELF)
    crank = case.simulation.scene.mechanism.motor(case.simulation.scene.mechanism.joints[0])
    turned = fm.FollowedCurve(
        crank, curve.configuration, curve.freedom, curve.frames, curve.discretisation, curve.unloaded
    )
    assert [axis.label for axis in turned.axes] == ["angle [rad]", "torque [N mm]"]


def test_ends_and_methods_that_do_not_fit_a_motor_are_refused():
    simulation, motor, _ = driven_toggle()
    push = simulation.scene.mechanism.forces[0]
    with pytest.raises(fm.DescriptionError, match="which has no displacement"):
        simulation.follow(motor, until=fm.Until(displacement=1.0))
    with pytest.raises(fm.DescriptionError, match="which has no position"):
        simulation.follow(push, until=fm.Until(position=1.0))
    with pytest.raises(fm.DescriptionError, match="not a motor"):
        simulation.follow(Motor(motor.joint, "another"), until=fm.Until(position=1.0))
    curve = simulation.follow(motor, until=fm.Until(position=-0.5))
    for question in (curve.error_estimates, curve.explain):
        with pytest.raises(fm.DescriptionError, match="no force changes along it"):
            question()
    assert curve.soft_modes(count=1)[0].stiffness > 0.0


@pytest.mark.thorough
def test_clamps_that_turn_together_lead_the_bow_over_the_fold_of_the_beam_and_back():
    simulation, _, (left, right) = bow()
    clamps = fm.Drive("clamps", {left: -1.0, right: 1.0})
    curve = simulation.follow(clamps, until=fm.Until(position=0.8, frames=40))
    fold = curve.turning_points[0]
    line = turned_ends.bowed_beam(0.3)
    assert fold.value == pytest.approx(turned_ends.largest_turn(line, 0.48), rel=2e-3)
    rising = curve.frames[1 : fold.index : 6]
    moments = [turned_ends.turned(line, frame.displacement, frame.displacement).end.moment for frame in rising]
    # both motors do the work of the drive
    assert [frame.force for frame in rising] == pytest.approx(2.0 * np.array(moments), rel=1e-2)
    assert curve.stable[: fold.index].all() and not curve.stable[fold.index + 1 :].any()
    assert curve.displacements[-1] < fold.value - 0.05
    assert [axis.label for axis in curve.axes] == ["angle [rad]", "torque [N mm]"]


def test_invalid_drives_are_refused():
    simulation, _, (left, right) = bow()
    slide = driven_toggle()[1]
    for ratios in (
        {},
        {left: 0.0},
        {left: float("nan")},
        {"left": 1.0},
        {left: 1.0, slide: 1.0},
        [(left, 1), (left, 2)],
    ):
        with pytest.raises(fm.DescriptionError, match="drive 'both'"):
            fm.Drive("both", ratios)
    with pytest.raises(fm.DescriptionError, match="not a motor"):
        simulation.follow(fm.Drive("slide", {slide: 1.0}), until=fm.Until(position=1.0))
    assert fm.Drive("both", ((left, 1), (right, 2))).ratios == ((left, 1.0), (right, 2.0))


@pytest.mark.parallel
def test_path_of_a_motor_is_the_same_on_any_number_of_ranks():
    simulation, motor, output = driven_toggle(MPI.COMM_WORLD)
    curve = simulation.follow(motor, until=fm.Until(position=-6.0))
    check_against_closed_form(curve, output)
    assert [event.kind for event in curve.events] == [fm.Critical.TURNING] * 2
