"""Compliant pins: closed forms, the limit of rigid pins, stability, large turns, sensitivities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import StayClose
from fenicsmech.effects import JointCompliance, JointSpring
from fenicsmech.equilibrium import LoadControl
from fenicsmech.multibody import JointCoordinate

from ..design.mechanisms import objective, truss
from .levers import ARM, PLASTIC, TILTED, UPRIGHT, lever

STIFFNESS, COMPLIANCE = 50.0, 0.4
every_space = pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])


@pytest.mark.parametrize(("space", "frame"), [("plane-stress", UPRIGHT), ("3d", UPRIGHT), ("3d", TILTED)])
def test_lever_on_a_soft_pin_moves_along_its_load_by_compliance_times_force(space, frame):
    # the pin gives way along the force, the lever turns as on a rigid pin
    pushed = np.radians(120.0)
    angles = np.radians([10.0, 60.0, 110.0])
    forces = STIFFNESS * angles / (ARM * np.sin(pushed - angles))
    case = lever(
        lambda hinge: [JointSpring(hinge, STIFFNESS), JointCompliance(hinge, COMPLIANCE)],
        space=space,
        pushed=pushed,
        frame=frame,
    )
    curve = case.simulation.load_displacement(case.force, forces=forces)
    turned = ARM * (np.cos(pushed - angles) - np.cos(pushed))
    assert curve.displacements == pytest.approx(turned + COMPLIANCE * forces, rel=1e-7)
    pulled = [np.linalg.norm(frame.reactions[case.joint.name].force) for frame in curve.frames]
    assert pulled == pytest.approx(forces, rel=1e-7)


def strut(effects_of, *, space: str = "plane-stress", hold: str = "revolute") -> fm.Curve:
    """A strut pulled along its axis between a joint with effects and a hinge on a slide."""
    mechanism = fm.Mechanism("strut")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    bar = mechanism.flexible("bar", fm.strip([(0, 0), (40, 0)], thickness=4.0, depth=4.0), PLASTIC)
    foot = getattr(mechanism, hold)(base, bar, at=(0, 0), interface_radius=1.5)
    mechanism.revolute(bar, head, at=(40, 0), interface_radius=1.5)
    mechanism.prismatic(base, head, at=(40, 0), axis=(1, 0))
    pull = mechanism.force(on=head, at=(40, 0), direction=(1, 0))
    simulation = fm.Simulation(fm.Scene(mechanism, effects=effects_of(foot)), space=space, order=1, size=4.0)
    return simulation.load_displacement(pull, forces=[10.0, 1000.0])


@every_space
@pytest.mark.parametrize("hold", ["revolute", "weld"])
def test_compliance_is_in_series_with_its_link(space, hold):
    rigid, soft = (
        strut(lambda j: [], space=space, hold=hold),
        strut(lambda j: [JointCompliance(j, 1e-3), JointCompliance(j, 2e-3)], space=space, hold=hold),
    )
    assert soft.displacements - rigid.displacements == pytest.approx(3e-3 * rigid.forces, rel=1e-6)
    assert np.all(soft.stable)


def test_pin_becomes_rigid_as_its_compliance_vanishes():
    rigid = strut(lambda j: []).displacements
    errors = [np.abs(strut(lambda j, c=c: [JointCompliance(j, c)]).displacements - rigid).max() for c in (1e-5, 1e-7)]
    assert errors == pytest.approx([1e-2, 1e-4], rel=1e-4)


@every_space
def test_pendulum_on_a_soft_pin_still_buckles_at_stiffness_over_length(space):
    # the pin moves along the force only: the critical load is that of the rigid pin
    critical = STIFFNESS / ARM
    case = lever(
        lambda hinge: [JointSpring(hinge, STIFFNESS), JointCompliance(hinge, COMPLIANCE)], space=space, pushed=np.pi
    )
    curve = case.simulation.load_displacement(case.force, forces=[0.999 * critical, 1.001 * critical])
    assert [frame.unstable_modes for frame in curve.frames] == [0, 1]
    assert curve.displacements == pytest.approx(COMPLIANCE * curve.forces, rel=1e-8)


@every_space
def test_two_soft_pins_let_a_rigid_column_buckle(space):
    # it tips over when its pins have come together, at f (c₁ + c₂) = ℓ
    mechanism = fm.Mechanism("column")
    base, column, head = mechanism.rigid("base", fixed=True), mechanism.rigid("column"), mechanism.rigid("head")
    leaf = mechanism.flexible("leaf", fm.strip([(0, -30), (20, -30)], thickness=6.0, depth=6.0), PLASTIC)
    mechanism.weld(base, leaf, at=(3, -30), interface_radius=2.0)
    pins = mechanism.revolute(base, column, at=(0, 0)), mechanism.revolute(column, head, at=(ARM, 0))
    mechanism.prismatic(base, head, at=(ARM, 0), axis=(1, 0))
    push = mechanism.force(on=head, at=(ARM, 0), direction=(-1, 0))
    scene = fm.Scene(mechanism, effects=[JointCompliance(pin, 0.1) for pin in pins])
    simulation = fm.Simulation(scene, space=space, order=1, size=6.0)
    curve = simulation.load_displacement(push, forces=[50.0, 199.0, 201.0])
    assert curve.displacements == pytest.approx(0.2 * curve.forces, rel=1e-8)
    assert curve.stable.tolist() == [True, True, False]


@every_space
def test_newton_converges_quadratically_on_a_soft_pin(space):
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS), JointCompliance(hinge, COMPLIANCE)], space=space)
    solver = case.simulation.solver(case.force)
    near, far = case.simulation.load_displacement(case.force, forces=[1.0, 1.2]).frames
    solution = solver.solve(near.state, LoadControl(1.2))
    assert solution.iterations <= 6
    assert solution.state.poses == pytest.approx(far.state.poses, abs=1e-8)


def test_tangent_is_the_rate_of_the_equilibria():
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS), JointCompliance(hinge, COMPLIANCE)])
    solver = case.simulation.solver(case.force)
    step = 1e-3
    frames = case.simulation.load_displacement(case.force, forces=[1.0 - step, 1.0, 1.0 + step]).frames
    tangent = solver.solve(frames[1].state, LoadControl(1.0)).tangent
    rate = solver.system.difference(frames[2].state, frames[0].state).scaled(0.5 / step)
    assert tangent.z == pytest.approx(rate.z, rel=1e-5, abs=1e-6)
    assert tangent.multipliers == pytest.approx(rate.multipliers, rel=1e-5, abs=1e-6)


def soft_truss(compliance: float):
    """The truss finger on compliant pins."""
    case = truss((0.1, 2.0), (0.4, 3.2))
    effects = [JointCompliance(joint, compliance) for joint in case.scene.mechanism.joints]
    return replace(case, scene=replace(case.scene, effects=effects))


def test_design_gradient_with_soft_pins_agrees_with_central_differences():
    whole, bench = objective(soft_truss(0.5), StayClose())
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    here = whole.evaluate(p)
    step = 1e-3
    ahead, back = (whole.evaluate(p + h * direction) for h in (step, -step))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / (2 * step), rel=1e-5)
    rigid, _ = objective(truss((0.1, 2.0), (0.4, 3.2)), StayClose())
    assert abs(rigid.evaluate(p).value - here.value) > 1e-2 * here.value  # the compliance is felt


@pytest.mark.parallel
def test_ranks_agree_on_a_mechanism_with_soft_pins():
    curves = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = soft_truss(0.1)
        curves.append(case.simulate(comm=comm).load_displacement(case.targets[0].quantity.part, forces=[0.1, 0.4]))
    assert curves[1].displacements == pytest.approx(curves[0].displacements, rel=1e-8)


def test_turn_of_a_soft_hinge_is_that_about_its_axis():
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS), JointCompliance(hinge, COMPLIANCE)], space="3d")
    (frame,) = case.simulation.load_displacement(case.force, forces=[1.0]).frames
    angle = JointCoordinate(case.simulation.linkage, case.joint).value(frame.state.poses)
    assert STIFFNESS * angle == pytest.approx(ARM * np.cos(angle), rel=1e-7)


def test_invalid_compliances_are_refused():
    mechanism = fm.Mechanism("pair")
    a, b = mechanism.rigid("a", fixed=True), mechanism.rigid("b")
    hinge, slider = mechanism.revolute(a, b, at=(0, 0)), mechanism.prismatic(a, b, at=(0, 0), axis=(1, 0))
    with pytest.raises(fm.DescriptionError, match="not positive"):
        JointCompliance(hinge, -1.0)
    for other in (mechanism.motor(hinge), "hinge"):
        with pytest.raises(fm.DescriptionError, match="joint compliance: .* is not a joint"):
            JointCompliance(other, 1.0)
    with pytest.raises(fm.DescriptionError, match="share no point"):
        JointCompliance(slider, 1.0).check(mechanism, 2)
    with pytest.raises(fm.DescriptionError, match="is not a joint of 'other'"):
        JointCompliance(hinge, 1.0).check(fm.Mechanism("other"), 2)
    assert JointCompliance(hinge, 0.25).explain() == "compliance 0.25 of 'revolute joint a–b'"
