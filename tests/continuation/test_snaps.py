"""Load steps that snap over a fold say so, however long they are; those that do not, do not."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.files import read_csv

from ..equilibrium import toggle
from ..equilibrium.arch import RISE, arch
from ..equilibrium.bow import bow
from ..equilibrium.finger import finger
from ..hard.buckling import LENGTH, euler
from ..hard.buckling import column as hard_column

# parts of the limit load
SNAPPING_LOADS = [
    [1.05],
    pytest.param([3.0], marks=pytest.mark.thorough),
    pytest.param([10.0], marks=pytest.mark.thorough),
    pytest.param([0.5, 0.97, 1.02, 1.1], marks=pytest.mark.thorough),
    [0.999, 1.01],
]


@pytest.fixture(scope="module")
def snapping():
    simulation, push = arch()
    path = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE))
    return simulation, push, path.limit_points[0].frame


@pytest.mark.parametrize("loads", SNAPPING_LOADS)
def test_arch_under_more_than_its_limit_load_snaps_through(snapping, loads):
    simulation, push, limit = snapping
    curve = simulation.load_displacement(push, forces=np.array(loads) * limit.force)
    first = int(np.argmax(np.array(loads) > 1.0))
    assert curve.snapped_through.tolist() == [index == first for index in range(len(loads))]
    assert np.all(curve.displacements[:first] < limit.displacement) and curve.displacements[first] > 1.8 * RISE


def test_arch_below_its_limit_load_or_under_prescribed_displacement_does_not_snap_through(snapping):
    simulation, push, limit = snapping
    for loads in ([0.9999], [0.5, 0.97, 0.9999, 0.5], [-5.0]):
        curve = simulation.load_displacement(push, forces=np.array(loads) * limit.force)
        assert not curve.snapped_through.any()
    assert not simulation.load_displacement(push, displacements=[2.4 * RISE]).snapped_through.any()


def test_snap_through_is_in_the_text_and_in_the_table(snapping, tmp_path):
    simulation, push, limit = snapping
    curve = simulation.load_displacement(push, forces=np.array([0.5, 1.05, 1.1]) * limit.force)
    (remark,) = curve.remarks
    assert remark.startswith(f"as drawn: snaps after force {curve.forces[0]:.3g} N, to displacement 1.8 mm")
    curve.write_csv(tmp_path / "curve.csv")
    assert read_csv(tmp_path / "curve.csv")["snapped_through"].tolist() == [0.0, 1.0, 0.0]
    assert curve.series().snapped_through.tolist() == [False, True, False]
    middle = simulation.load_displacement(push, displacements=[RISE])
    assert middle.remarks == ("as drawn: 1 of 1 equilibria are unstable under dead loads",)


def test_snap_through_is_logged(snapping, caplog):
    simulation, push, limit = snapping
    simulation.load_displacement(push, forces=[1.05 * limit.force])
    assert "the path turns back" in caplog.text


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_finger_that_bends_far_in_one_step_does_not_snap_through(space):
    simulation, push = finger(space)
    assert not simulation.load_displacement(push, forces=[8.0]).snapped_through.any()


def test_toggle_that_a_motor_drives_beyond_its_fold_snaps_through():
    # the motor pushes the toggle through a soft bar; its position turns back at 5.69 mm
    case = toggle.toggle(stilt_modulus=0.075)
    mechanism = case.simulation.scene.mechanism
    (guide,) = (joint for joint in mechanism.joints if joint.b.name == "head" and joint.kind.sliding)
    motor = mechanism.motor(guide)
    simulation = fm.Simulation(case.simulation.scene, space="plane-stress", order=1, size=6.0)
    for position, snapped_through in ((-5.6, False), (-5.8, True), (-16.0, True), (3.0, False)):
        driven = simulation.scene.configuration("driven", {motor: position})
        curve = simulation.load_displacement(case.push, forces=[0.0, -0.1], configuration=driven)
        assert curve.snapped_through.tolist() == [snapped_through, False]


@pytest.mark.thorough
def test_snap_is_seen_among_motors_that_turn_much_farther():
    # both clamps of a shallow bow turn, by far more than it snaps; the fold is between the first two angles
    simulation, crown, motors = bow()
    for angle, snapped_through in ((0.48, False), (0.5, True), (0.8, True), (1.2, True)):
        turned = simulation.scene.configuration("turned", dict(zip(motors, (-angle, angle), strict=True)))
        curve = simulation.load_displacement(crown, forces=[0.0], configuration=turned)
        assert curve.snapped_through.tolist() == [snapped_through], angle


@pytest.mark.parametrize("sag", [LENGTH / 5e3, pytest.param(LENGTH / 5e4, marks=pytest.mark.thorough)])
def test_column_that_buckles_does_not_snap_through(sag):
    # the smaller the sag, the more suddenly the path bends off, but it does not turn back
    points = [(0.0, 0.0), (0.5 * LENGTH, sag), (LENGTH, 0.0)]
    simulation, push = hard_column("plane-stress", MPI.COMM_SELF, points, poisson=0.3)
    loads = [0.98 * euler("plane-stress"), 1.02 * euler("plane-stress")]
    straight, buckled = simulation.load_displacement(push, forces=loads).frames
    assert straight.displacement < 0.001 * LENGTH and buckled.displacement > 0.03 * LENGTH
    assert buckled.stable and not straight.snapped_through and not buckled.snapped_through
