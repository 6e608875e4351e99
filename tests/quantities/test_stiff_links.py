"""Derivatives beside a very stiff link that carries next to nothing: they are those with a rigid link in its place."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import SampleEquilibria

PLASTIC = fm.Material("plastic", 2000.0, 0.35)


def derivatives(space: str, angle: float, stiff: float | None) -> np.ndarray:
    """Derivatives of a motor's torque; it bends a soft leg, and turns a spring by a stiff leaf, or a rigid one."""
    machine = fm.Mechanism("winder")
    ground, hub, rod, rocker = machine.rigid("ground", fixed=True), *map(machine.rigid, ("hub", "rod", "rocker"))
    shaft, hand = machine.revolute(ground, hub, at=(0, 0)), hub
    if stiff is not None:
        hand, strip = machine.rigid("hand"), fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=6.0)
        leaf = machine.flexible("leaf", strip, fm.Material("stiff", stiff, 0.3))
        machine.weld(hub, leaf, at=(2, 0), region=fm.Rectangle(4, 6))
        machine.weld(leaf, hand, at=(38, 0), region=fm.Rectangle(4, 6))
    machine.revolute(hand, rod, at=(40, 0))
    hinge = machine.revolute(rod, rocker, at=(40, 30))
    foot = machine.revolute(ground, rocker, at=(0, 30))
    soft = machine.flexible("soft", fm.strip([(0, 0), (-30, -5), (-50, 5)], thickness=1.5, depth=6.0), PLASTIC)
    machine.weld(hub, soft, at=(-2, -0.7), interface_radius=0.8)
    machine.revolute(ground, soft, at=(-50, 5), interface_radius=0.8)
    motor, spring = machine.motor(shaft), fm.JointSpring(foot, 50.0, rest=0.1)
    push = machine.force(on=hand, at=(40, 0), direction=(0, 1))
    scene = fm.Scene(machine, [spring])
    kinds = [
        fm.SpringStiffness(spring),
        fm.SpringRest(spring),
        fm.LawParameter("E", soft),
        fm.JointPosition(hinge, direction=(1, 0)),
        fm.JointPosition(foot, direction=(0, 1)),
        fm.MotorOffset(motor),
    ]
    simulation = fm.Simulation(scene, space=space, size=4.0, comm=MPI.COMM_SELF)
    sample = fm.Sample({push: 0.0}, scene.configuration("turned", {motor: angle}))
    equilibria = SampleEquilibria(simulation, [fm.Target(fm.MotorTorque(motor), sample, equals=1.0)], numbers=kinds)
    (gradient,) = equilibria.gradients(equilibria.from_zero())
    return gradient.numbers


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("angle", [0.1, 0.8])
def test_derivatives_of_a_motors_torque_keep_their_digits_beside_a_stiff_leaf(space, angle):
    rigid = derivatives(space, angle, None)
    # by stiffness alone, 2.5e4 times the leg's, derivatives differ by some 1e-6; its rounding, 1e-16 E b ℓ² √n at n
    # nodes, more in space, leaves as much of the torque's derivative by the angle
    assert derivatives(space, angle, 5e7) == pytest.approx(rigid, rel=1e-5)
