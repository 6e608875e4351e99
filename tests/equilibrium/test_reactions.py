"""Reactions and motor torques are the multipliers: they balance every link and do the work that the energy takes up."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..simulation.demo_scenes import describe
from .crowded import RUBBER
from .wrenches import of_joints, of_load

SIZES = {"plane-stress": 4.0, "plane-strain": 4.0, "3d": 6.0}


def claw(space: str, direction=(1, 0)) -> tuple[fm.Simulation, Force]:
    """The claw gripper, coarse, and a force on its finger."""
    scene, grasp = describe("claw")
    force = scene.mechanism.force(on=grasp.on, at=grasp.at, direction=direction, name=f"force along {direction}")
    order = 1 if space == "3d" else 2
    return fm.Simulation(scene, space=space, order=order, size=SIZES[space], comm=MPI.COMM_SELF), force


def scaffold() -> tuple[fm.Simulation, Force]:
    """A rubber post between joints of all kinds, pulled askew at a point of its own."""
    mechanism = fm.Mechanism("scaffold")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    strut, plate = mechanism.rigid("strut"), mechanism.rigid("plate")
    post = mechanism.flexible("post", fm.strip([(0, 0), (4, 16), (0, 30)], thickness=5.0, depth=6.0), RUBBER)
    mechanism.weld(post, base, at=(0, 0), interface_radius=3.0)  # the ground comes second
    mechanism.universal(post, head, at=(0, 30), axis=(0, 0, 1), interface_radius=3.0)
    mechanism.spherical(base, strut, at=(25, 0, 3))
    mechanism.revolute(strut, head, at=(20, 30, 0), axis=(0.6, 0, 0.8))
    mechanism.cylindrical(head, plate, at=(0, 40, 0), axis=(0.8, 0.6, 0))
    mechanism.planar(plate, base, at=(5, 45, 0), axis=(0, 0.6, 0.8))
    pull = mechanism.force(on=post, at=(3.9, 15, 1), direction=(0.48, 0.6, 0.64), name="pull")
    return fm.Simulation(fm.Scene(mechanism), space="3d", order=1, size=4.0, comm=MPI.COMM_SELF), pull


CASES = {
    "claw in plane stress": (lambda: claw("plane-stress"), [2.0, 6.0]),
    "claw in plane strain": (lambda: claw("plane-strain", (0.6, 0.8)), [-2.0]),
    "claw in space": (lambda: claw("3d", (0.6, 0.0, 0.8)), [3.0]),
    "scaffold": (scaffold, [1.0]),
}


@pytest.mark.parametrize("name", CASES)
def test_reactions_balance_every_link_and_carry_the_load_to_the_ground(name):
    build, forces = CASES[name]
    simulation, load = build()
    curve = simulation.load_displacement(load, forces=forces)
    (ground,) = (link for link in simulation.scene.mechanism.rigid_links if link.fixed)
    for frame in curve.frames:
        totals, applied = of_joints(simulation, frame), of_load(simulation, curve, frame)
        on_ground = totals.pop(ground)
        assert np.linalg.norm(on_ground.force) == pytest.approx(abs(frame.force), rel=1e-8)
        totals[load.on] += applied
        largest = max(np.linalg.norm(reaction.force) for reaction in frame.reactions.values())
        for link, total in {**totals, ground: on_ground + -applied}.items():
            assert total.force == pytest.approx(0.0, abs=1e-8 * largest), link.name
            assert total.moment == pytest.approx(0.0, abs=1e-8 * largest * simulation.linkage.length), link.name


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_hinge_transmits_no_moment_about_its_axis_but_its_motor_does(space):
    simulation, load = claw(space)
    frame = simulation.load_displacement(load, forces=[4.0]).frames[0]
    (motor,) = simulation.scene.mechanism.motors
    torque = frame.motors[motor]
    assert abs(torque) > 10.0
    joints = simulation.linkage.joints
    for connection in joints.connections:
        moment = frame.reactions[connection.name].moment
        axis = joints.space.rotate(frame.state.poses[connection.b], np.array([0.0, 0.0, 1.0])) if space == "3d" else [1]
        expected = torque if connection.motor is motor else 0.0
        assert moment @ axis == pytest.approx(expected, abs=1e-7 * abs(torque)), connection.name


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_motor_torque_is_the_derivative_of_the_potential_by_the_motor_angle(space):
    simulation, load = claw(space)
    (motor,) = simulation.scene.mechanism.motors
    model, middle, step, force = simulation.model, 0.1, 0.02, 4.0

    def frame_at(angle):
        configuration = simulation.scene.configuration("turned", {motor: angle})
        return simulation.load_displacement(load, forces=[force], configuration=configuration).frames[0]

    def potential(angle):
        frame = frame_at(angle)
        model.load(frame.state)
        return frame.strain_energy - force * model.travel(load, frame.state)

    energy = [potential(middle + k * step) for k in (-2, -1, 1, 2)]
    slope = (energy[0] - 8.0 * energy[1] + 8.0 * energy[2] - energy[3]) / (12.0 * step)
    assert frame_at(middle).motors[motor] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_torque_or_force_of_a_motor_that_strains_a_link_is_the_derivative_of_the_strain_energy(kind, space):
    mechanism = fm.Mechanism("bender")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    rod = mechanism.flexible("rod", fm.strip([(0, 0), (40, 0)], thickness=5.0, depth=6.0), RUBBER)
    mechanism.weld(base, rod, at=(0, 0), interface_radius=3.0)
    mechanism.weld(rod, hand, at=(40, 0), interface_radius=3.0)
    if kind == "revolute":
        joint = mechanism.revolute(base, hand, at=(25, -8))
    else:
        joint = mechanism.prismatic(base, hand, at=(45, 0), axis=(0.6, 0.8))
    motor = mechanism.motor(joint)
    unloaded = mechanism.force(on=hand, at=(40, 0), direction=(0, 1))
    order = 1 if space == "3d" else 2
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=order, size=5.0, comm=MPI.COMM_SELF)

    def frame_at(value):
        configuration = simulation.scene.configuration("driven", {motor: value})
        return simulation.load_displacement(unloaded, forces=[0.0], configuration=configuration).frames[0]

    middle, step = {"revolute": (0.4, 0.02), "prismatic": (6.0, 0.3)}[kind]
    energy = [frame_at(middle + k * step).strain_energy for k in (-2, -1, 1, 2)]
    slope = (energy[0] - 8.0 * energy[1] + 8.0 * energy[2] - energy[3]) / (12.0 * step)
    assert slope > 0.0
    assert frame_at(middle).motors[motor] == pytest.approx(slope, rel=1e-5)
