"""A bistable four-bar driven by its crank: the motor's torque is that of the force that pushes the crank."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import ArcLength, ArcSteps, Goal, MotorLead, follow, metric_at, motor_torques

from .bistable import COUPLER, RISE, RUN, forces, four_bar


def driven_path(angle: float):
    """Positions, torques and critical points of the crank turned by ``angle``."""
    case = four_bar(MPI.COMM_SELF)
    mechanism = case.simulation.scene.mechanism
    motor = mechanism.motor(mechanism.joints[0])
    simulation = fm.Simulation(case.simulation.scene, space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    newton = simulation.newton(case.push)
    rest = simulation.load_displacement(case.push, forces=[0.0]).frames[0].state
    joints = simulation.linkage.joints
    lead = MotorLead(joints.motor_values(lambda driven: float(driven is motor)))
    metric = metric_at(newton, lead, rest, floor=0.0, parameter=abs(angle), travel=None)
    arc = ArcLength(newton, lead, metric, steps=ArcSteps(), floor=0.0, travel_reference=np.inf)
    start = arc.start(rest)
    start = start if angle > 0.0 else start.reversed()
    goal = Goal(lambda point: lead.value(point.state), lambda point: point.tangent.parameter, angle, abs(angle))
    positions, torques, critical = [], [], []
    for stretch in follow(arc, start, [goal], most=200):
        positions.append(lead.value(stretch.point.state))
        torques.append(motor_torques(joints, stretch.point.state)[motor])
        critical += stretch.critical
    return np.array(positions), np.array(torques), critical


def test_torque_of_the_crank_of_a_bistable_four_bar_is_that_of_beam_theory():
    level = np.arctan2(RISE, RUN)
    positions, torques, critical = driven_path(-2.2 * level)
    assert positions[-1] == pytest.approx(-2.2 * level, rel=1e-9)
    assert not critical  # held by the motor, nothing snaps
    some = np.arange(0, len(positions), 4)
    knee = level + positions[some]
    # a force down on the knee does the work −F COUPLER cos(angle) per angle
    expected = -forces(RISE - COUPLER * np.sin(knee)) * COUPLER * np.cos(knee)
    assert torques[some] == pytest.approx(expected, abs=1e-2 * np.abs(expected).max())
    last = np.flatnonzero(np.diff(np.sign(torques)))[-1]
    share = torques[last] / (torques[last] - torques[last + 1])
    rest = positions[last] + share * (positions[last + 1] - positions[last])
    assert rest == pytest.approx(-2.0 * level, rel=1e-2)  # the mirror image is free of strain
