"""A spring far softer than the links holds a mechanism, and loads far below rounding of its length are balanced; one
that a motor winds up holds nothing else.

A blade that turns strains by rounding, 1e-16 of its stiffness times its way, which limits how soft a spring may be.
"""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm


def lever(stiffness: float) -> tuple[fm.Simulation, object]:
    """A steel blade clamped to a rigid arm that turns about the origin against a spring."""
    mechanism = fm.Mechanism("lever")
    base, arm = mechanism.rigid("base", fixed=True), mechanism.rigid("arm")
    blade = mechanism.flexible(
        "blade", fm.strip([(20, 0), (50, 0)], thickness=2.0, depth=4.0), fm.Material("steel", 2e5, 0.3)
    )
    hinge = mechanism.revolute(base, arm, at=(0, 0), name="hinge")
    mechanism.weld(arm, blade, at=(20, 0), interface_radius=1.5)
    push = mechanism.force(on=arm, at=(10, 0), direction=(0, 1))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(hinge, stiffness)])
    return fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF), push


@pytest.mark.parametrize("stiffness", [10.0, 0.1, 0.01])
def test_spring_softer_than_the_regularisation_of_zero_energy_modes(stiffness):
    simulation, push = lever(stiffness)
    force = 1e-3 * stiffness  # turns the arm by f r / k = 0.01
    (frame,) = simulation.load_displacement(push, forces=[force]).frames
    assert frame.displacement == pytest.approx(10.0 * 0.01, rel=1e-3)


@pytest.mark.parametrize("force", [1e-3, 1e-8, 1e-13])
def test_displacement_is_proportional_to_small_forces(force):
    simulation, push = lever(1e3)
    (frame,) = simulation.load_displacement(push, forces=[force]).frames
    assert frame.displacement == pytest.approx(force * 10.0**2 / 1e3, rel=1e-6)
    assert frame.residuals[-1] < 1e-3


def test_displacements_count_from_where_springs_hold_what_motors_leave():
    mechanism = fm.Mechanism("finger")
    base, arm = mechanism.rigid("base", fixed=True), mechanism.rigid("arm")
    blade = mechanism.flexible(
        "blade", fm.strip([(20, 0), (50, 0)], thickness=2.0, depth=4.0), fm.Material("nylon", 2e3, 0.4)
    )
    hinge = mechanism.revolute(base, arm, at=(0, 0))
    motor = mechanism.motor(mechanism.revolute(arm, blade, at=(20, 0), interface_radius=1.0))
    push = mechanism.force(on=blade, at=(50, 0), direction=(0, 1))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(hinge, 1e5)])
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    bent = scene.configuration("bent", {motor: 0.7})
    (frame,) = simulation.load_displacement(push, displacements=[0.0], configuration=bent).frames
    assert abs(frame.force) < 1e-9
    assert frame.state.poses[1] == pytest.approx(0.0, abs=1e-12)


def test_link_beyond_a_spring_that_a_motor_winds_up_swings_freely_into_the_line_of_a_pull():
    mechanism = fm.Mechanism("double pendulum")
    base, upper, fore = mechanism.rigid("base", fixed=True), mechanism.rigid("upper"), mechanism.rigid("fore")
    blade = mechanism.flexible(
        "blade", fm.strip([(50, 0), (60, 0)], thickness=2.0, depth=4.0), fm.Material("steel", 2e5, 0.3)
    )
    shoulder = mechanism.revolute(base, upper, at=(0, 0))
    mechanism.revolute(upper, fore, at=(30, 0))
    mechanism.weld(fore, blade, at=(50, 0), interface_radius=1.0)
    motor = mechanism.motor(shoulder)
    pull = mechanism.force(on=fore, at=(50, 0), direction=(np.cos(0.1), np.sin(0.1)))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(shoulder, 1e3)])
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=2.0, comm=MPI.COMM_SELF)
    wound = scene.configuration("wound", {motor: 0.7})
    curve = simulation.load_displacement(pull, forces=[1.0], configuration=wound)
    index = [body.link for body in simulation.linkage.bodies].index(fore)
    turned = 0.1 - curve.unloaded.poses[index, 2]
    assert curve.displacements == pytest.approx([20.0 * (1.0 - np.cos(turned))], rel=1e-6)
    assert not curve.snapped_through.any() and curve.freedom.zero_energy == ("fore", "blade")
