"""Load control and displacement control are two ways along one curve; the multiplier of the second is the force."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import ArcLengthControl, ArcMetric, DisplacementControl, LoadControl

from ..simulation.demo_scenes import describe
from .arch import DISPLACEMENTS, RISE, arch, beam_forces
from .finger import finger

BEFORE = slice(0, 10)  # displacements up to the limit point and a little farther


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "plane-strain", "3d"])
def test_displacement_control_takes_the_forces_that_load_control_was_given(space):
    simulation, push = finger(space)
    for forces in ([1.0, 2.0, 4.0], [-0.5, -1.0, -1.5]):
        loaded = simulation.load_displacement(push, forces=forces)
        held = simulation.load_displacement(push, displacements=loaded.displacements)
        assert held.displacements == pytest.approx(loaded.displacements, rel=1e-12)
        assert held.forces == pytest.approx(forces, rel=1e-8)
        for a, b in zip(loaded.frames, held.frames, strict=True):
            assert b.strain_energy == pytest.approx(a.strain_energy, rel=1e-8)
            assert b.max_stress == pytest.approx(a.max_stress, rel=1e-7)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_force_is_the_derivative_of_the_strain_energy(space):
    simulation, push = finger(space)
    middle, step = 5.0, 0.1
    curve = simulation.load_displacement(push, displacements=[middle + k * step for k in (-2, -1, 0, 1, 2)])
    energy = [frame.strain_energy for frame in curve.frames]
    slope = (energy[0] - 8.0 * energy[1] + 8.0 * energy[3] - energy[4]) / (12.0 * step)
    assert curve.forces[2] == pytest.approx(slope, rel=1e-6)


def test_snap_through_follows_the_beam_beyond_the_limit_point_and_back_to_stability():
    simulation, push = arch()
    curve = simulation.load_displacement(push, displacements=DISPLACEMENTS)
    expected = beam_forces(DISPLACEMENTS)
    assert curve.forces == pytest.approx(expected, rel=1e-2, abs=1e-12)
    assert curve.forces[BEFORE].max() == pytest.approx(expected[BEFORE].max(), rel=3e-3)  # the limit load
    slope = np.gradient(expected, DISPLACEMENTS)
    clear = np.abs(slope) > 0.1 * np.abs(slope).max()  # not at the limit points
    assert np.any(slope[clear] < 0.0)
    assert np.array_equal(curve.stable[clear], slope[clear] > 0.0)
    assert all(frame.unstable_modes == (0 if frame.stable else 1) for frame in curve.frames)
    assert all(frame.stable_under_control for frame in curve.frames)


@pytest.mark.thorough
@pytest.mark.parametrize("fractions", [[0.95], [0.5, 0.8, 0.95]])
def test_load_below_the_limit_stays_on_its_side_and_beyond_it_snaps_to_the_other(fractions):
    simulation, push = arch()
    limit = simulation.load_displacement(push, displacements=DISPLACEMENTS[BEFORE]).forces.max()
    loads = [fraction * limit for fraction in (*fractions, 1.05)]
    *_, before, after = simulation.load_displacement(push, forces=loads).frames
    assert before.displacement < 0.7 * RISE and before.stable
    assert after.displacement > 1.7 * RISE and after.stable
    held = simulation.load_displacement(push, displacements=[*DISPLACEMENTS, after.displacement]).frames[-1]
    assert held.force == pytest.approx(after.force, rel=1e-8)


def test_other_forces_stay_constant_while_one_changes():
    simulation, push = finger("plane-stress")
    mechanism = simulation.scene.mechanism
    pull = mechanism.force(on=push.on, at=push.at, direction=(-1, 0), name="pull")
    both = simulation.load_displacement(push, forces=[3.0, 5.0], others={pull: 2.0})
    net = simulation.load_displacement(push, forces=[1.0, 3.0])
    assert both.displacements == pytest.approx(net.displacements, rel=1e-9)
    nothing = simulation.load_displacement(push, forces=[2.0], others={pull: 2.0}).frames[0]
    assert nothing.displacement == pytest.approx(0.0, abs=1e-9)
    assert nothing.strain_energy == pytest.approx(0.0, abs=1e-12)


def test_constant_force_is_reached_as_surely_as_a_prescribed_one():
    # takes several load steps from the unloaded state, whichever way the force is given
    scene, lift = describe("klann")
    constant = scene.mechanism.force(on=lift.on, at=lift.at, direction=(0, 1), name="constant")
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    led = simulation.load_displacement(lift, forces=[10.0])
    both = simulation.load_displacement(lift, forces=[0.0], others={constant: 10.0})
    assert both.displacements == pytest.approx(led.displacements, rel=1e-9)


@pytest.mark.parametrize("held", [LoadControl(), DisplacementControl()], ids=["force", "displacement"])
def test_arc_length_is_corrected_like_other_controls_whatever_is_held(held):
    simulation, push = finger("plane-stress")
    solver = simulation.solver(push)
    system, state = solver.system, simulation.load_displacement(push, forces=[1.0]).frames[0].state
    tangent = solver.linearise(state, LoadControl(1.0)).point((), 0).tangent
    metric = ArcMetric(system, LoadControl(), system.size(tangent), 1.0, 1.0)
    control = ArcLengthControl(0.5, metric, state, metric.unit(tangent), held)
    point = solver.solve(state, control)
    assert control.value(system, point.state) == pytest.approx(0.5, rel=1e-9)
    assert metric.norm(point.tangent) == pytest.approx(1.0) and metric.dot(point.tangent, control.normal) > 0.0
    loaded = solver.solve(state, LoadControl(point.state.force))
    assert system.size(system.difference(point.state, loaded.state)) < 1e-9
    assert point.conjugate_rate == pytest.approx(loaded.conjugate_rate * point.tangent.force, rel=1e-6)
    assert point.stability == loaded.stability
