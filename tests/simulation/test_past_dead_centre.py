"""A motor goes on where links must strain, past the dead centre in which their slack ends."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.multibody import assemble, assemble_before_strain


def test_a_rocker_is_pulled_beyond_the_reach_of_its_coupler():
    mechanism = fm.Mechanism("four-bar")
    base, crank, rocker = (mechanism.rigid(name, fixed=name == "base") for name in ("base", "crank", "rocker"))
    rubber = fm.Material("rubber", 1.0, 0.4)
    coupler = mechanism.flexible("coupler", fm.strip([(0, 30), (50, 20)], thickness=4.0, depth=4.0), rubber)
    motor = mechanism.motor(mechanism.revolute(base, rocker, at=(60, 0)))
    mechanism.revolute(base, crank, at=(0, 0))
    pin = mechanism.revolute(crank, coupler, at=(0, 30), interface_radius=2.0)
    mechanism.revolute(coupler, rocker, at=(50, 20), interface_radius=2.0)
    push = mechanism.force(on=rocker, at=(50, 20), direction=(1, 0))
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0, comm=MPI.COMM_SELF)
    beyond = scene.configuration("beyond", {motor: -2.2})
    slack = assemble(simulation.linkage, beyond).fraction
    assert 0.9 * slack < assemble_before_strain(simulation.linkage, beyond).fraction < slack < 0.99
    (frame,) = simulation.load_displacement(push, forces=[0.0], configuration=beyond).frames
    assert frame.stable
    # the crank carries no moment: the pull goes through both of its pivots
    angle = frame.state.poses[[body.name for body in simulation.linkage.bodies].index("crank"), 2]
    along = np.array([-np.sin(angle), np.cos(angle)])
    pull = np.array(frame.reactions[pin.name].force)[:2]
    assert abs(pull @ along) == pytest.approx(np.linalg.norm(pull), rel=1e-8)
    assert np.linalg.norm(pull) > 0.01


def test_a_joint_that_gives_way_lets_a_motor_pull_rigid_links_apart(caplog):
    mechanism = fm.Mechanism("soft joint")
    base, rocker, coupler = (mechanism.rigid(name, fixed=name == "base") for name in ("base", "rocker", "coupler"))
    rubber = fm.Material("rubber", 1.0, 0.4)
    leaf = mechanism.flexible("leaf", fm.strip([(60, 40), (60, 60)], thickness=4.0, depth=4.0), rubber)
    motor = mechanism.motor(mechanism.revolute(base, rocker, at=(60, 0)))
    mechanism.clamp(rocker, leaf, end="start", length=4.0)
    pin = mechanism.revolute(rocker, coupler, at=(60, 40))
    mechanism.revolute(coupler, base, at=(0, 30))
    push = mechanism.force(on=rocker, at=(60, 40), direction=(1, 0))
    softness = 5.0
    simulation = fm.Simulation(
        fm.Scene(mechanism, [fm.JointCompliance(pin, softness)]), space="plane-stress", size=4.0, comm=MPI.COMM_SELF
    )
    angle = -1.0  # the three links are a triangle, which does not move
    beyond = simulation.scene.configuration("beyond", {motor: angle})
    (frame,) = simulation.load_displacement(push, forces=[0.0], configuration=beyond).frames
    assert "(rocker – base – coupler) is open in joints that give way" in caplog.text
    # the coupler turns into the line from its pivot to the rocker's end, and the joint opens by what is missing
    end = np.array([60.0 - 40.0 * np.sin(angle), 40.0 * np.cos(angle)])
    line = end - (0.0, 30.0)
    opened = np.linalg.norm(line) - np.hypot(60.0, 10.0)
    assert frame.stable
    assert opened > 20.0
    assert np.linalg.norm(frame.reactions[pin.name].force) == pytest.approx(opened / softness, rel=1e-9)
