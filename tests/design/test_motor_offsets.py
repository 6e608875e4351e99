"""Motors at an offset from their prescribed positions: the mechanism is that at the sum of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import Correction, MeshQuality, NumberBounds, SampleEquilibria, StayClose
from fenicsmech.mechanism import Configuration, Force, Motor

from . import mechanisms
from .refusal import refused

PLASTIC = fm.Material("plastic", 2000.0, 0.35)
EXACT = {"optimiser": fm.LevenbergMarquardt(tolerance=1e-18), "correction": Correction(estimates=False)}


def crank() -> tuple[fm.Scene, Motor, Force]:
    """A four-bar whose motor turns it without strain."""
    mechanism = fm.Mechanism("four-bar")
    ground, coupler = mechanism.rigid("ground", fixed=True), mechanism.rigid("coupler")
    left = mechanism.flexible("left", fm.strip([(0, 0), (0, 30)], thickness=2.0, depth=6.0), PLASTIC)
    right = mechanism.rigid("right")
    shaft = mechanism.revolute(ground, left, at=(0, 0), interface_radius=2.0)
    mechanism.revolute(left, coupler, at=(0, 30), interface_radius=2.0)
    mechanism.revolute(ground, right, at=(40, 0))
    mechanism.revolute(right, coupler, at=(40, 30))
    return fm.Scene(mechanism), mechanism.motor(shaft), mechanism.force(on=coupler, at=(20, 35), direction=(1, 0.3))


def strained() -> tuple[fm.Scene, Motor, Force]:
    """A strip on a guided foot, whose motor bends it."""
    mechanism = fm.Mechanism("bent")
    ground, arm = mechanism.rigid("ground", fixed=True), mechanism.rigid("arm")
    strip = mechanism.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=2.0, depth=6.0), PLASTIC)
    shaft = mechanism.revolute(ground, arm, at=(0, 0))
    mechanism.weld(arm, strip, at=(0, 0), interface_radius=2.0)
    foot = mechanism.rigid("foot")
    mechanism.prismatic(ground, foot, at=(40, 0), axis=(1, 0))
    mechanism.revolute(strip, foot, at=(40, 0), interface_radius=2.0)
    return fm.Scene(mechanism), mechanism.motor(shaft), mechanism.force(on=foot, at=(40, 0), direction=(-1, 0))


def measured(sim: fm.Simulation, push: Force, place: Configuration) -> np.ndarray:
    """Displacements, torques and energies of two frames."""
    frames = sim.load_displacement(push, forces=[1.0, 2.0], configuration=place).frames
    return np.array([(f.displacement, *f.motors.values(), f.strain_energy) for f in frames])


@pytest.mark.parametrize(
    ("describe", "space"),
    [
        (crank, "plane-stress"),
        (strained, "plane-stress"),
        pytest.param(crank, "3d", marks=pytest.mark.thorough),
        pytest.param(strained, "3d", marks=pytest.mark.thorough),
    ],
)
def test_an_offset_is_the_same_as_another_position_of_the_motor(describe, space):
    scene, motor, push = describe()
    sim = fm.Simulation(scene, space=space, size=4.0)
    nothing = np.zeros_like(sim.model.elastic.shape.x.array)
    shifted = sim.with_design(fm.Design(nothing, {fm.MotorOffset(motor): 0.08}))
    there, here = (scene.configuration(f"at {position:g}", {motor: position}) for position in (0.2, 0.12))
    wanted = measured(sim, push, there)
    assert measured(shifted, push, here) == pytest.approx(wanted, rel=1e-10)
    assert measured(sim, push, there) == pytest.approx(wanted, rel=1e-12)  # the simulation keeps its design
    assert np.max(np.abs(measured(sim, push, here) / wanted - 1.0)) > 1e-2
    if describe is crank:
        assert shifted.path(push, [here]) == pytest.approx(sim.path(push, [there]), abs=1e-10)


def test_values_of_designs_with_other_offsets_are_those_of_a_scene_whose_motor_is_there():
    def equilibria(position: float) -> tuple[fm.Simulation, fm.MotorOffset, SampleEquilibria]:
        scene, motor, push = crank()
        sim, sample = fm.Simulation(scene, space="plane-stress", size=4.0), fm.Sample({push: 1.0, motor: position})
        quantities = fm.Displacement(push), fm.MotorTorque(motor), fm.StrainEnergy()
        targets = [fm.Target(quantity, sample, equals=0.0, scale=1.0) for quantity in quantities]
        return sim, fm.MotorOffset(motor), SampleEquilibria(sim, targets)

    sim, kind, designed = equilibria(0.12)
    for offset in (0.0, 0.3):
        sim.model.reshape(fm.Design(sim.model.design.field, {kind: offset}))
        _, _, there = equilibria(0.12 + offset)
        wanted = there.values(there.from_zero())
        assert designed.values(designed.from_zero()) == pytest.approx(wanted, rel=1e-10)
        assert len(sim.linkage.assembled) == 1  # the last one


def test_materials_do_not_share_offsets():
    scene, motor, _ = crank()
    sim = fm.Simulation(scene, space="plane-stress", size=4.0)
    other = sim.with_material(PLASTIC, fm.Material("soft", 1000.0, 0.35))
    with sim.model.shaped(fm.Design(sim.model.design.field, {fm.MotorOffset(motor): 0.1})):
        assert np.any(sim.linkage.joints.offsets) and not np.any(other.linkage.joints.offsets)


@pytest.mark.parametrize("describe", [crank, pytest.param(strained, marks=pytest.mark.thorough)])
def test_an_offset_is_recovered_from_positions_measured_with_it(describe):
    scene, motor, push = describe()
    sim = fm.Simulation(scene, space="plane-stress", size=4.0)
    samples = [fm.Sample({push: force, motor: 0.1}) for force in (1.0, 2.0)]
    known = [measured(sim, push, fm.Sample({motor: 0.1 + 0.0437}).configuration)[k] for k in (0, 1)]
    targets = [fm.Target(fm.MotorTorque(motor), s, equals=float(k[1])) for s, k in zip(samples, known, strict=True)]
    targets += [fm.Target(fm.Displacement(push), samples[1], equals=float(known[1][0]))]
    result = fm.DesignProblem(sim, [fm.Number(fm.MotorOffset(motor), -0.15, 0.2)], targets=targets).optimise(**EXACT)
    (offset,) = result.numbers
    assert offset.value == pytest.approx(0.0437, rel=1e-6)
    assert (offset.unit, offset.drawn) == ("rad", 0.0)
    assert result.worst_error < 1e-7 and result.verified


@pytest.mark.parametrize(
    ("space", "size"), [("plane-stress", 4.0), pytest.param("3d", 5.0, marks=pytest.mark.thorough)]
)
def test_gradients_of_the_objective_by_shapes_and_offsets_agree_with_central_differences(space, size):
    case = mechanisms.strained(2.0, 4.0)
    offset = fm.Number(fm.MotorOffset(*case.scene.mechanism.motors), -0.2, 0.3)
    case = replace(case, designs=[*case.designs, offset])
    regulariser = MeshQuality(limit=2.5, width=2.5) + NumberBounds() + 1e-3 * StayClose()
    whole, bench = mechanisms.objective(case, regulariser, space=space, size=size)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    here = whole.evaluate(p)

    def slope(step: float) -> float:
        return (whole.evaluate(p + step * direction).value - whole.evaluate(p - step * direction).value) / (2 * step)

    found = (4.0 * slope(5e-4) - slope(1e-3)) / 3.0
    assert here.gradient @ direction == pytest.approx(found, rel=1e-5)
    assert here.gradient[-1] != 0.0


def test_invalid_offsets_are_refused():
    scene, motor, push = crank()
    sim = fm.Simulation(scene, space="plane-stress", size=4.0)
    targets = [fm.Target(push, force=1.0, displacement=1.0)]
    _, other, _ = strained()
    refused(
        lambda: fm.DesignProblem(sim, [fm.Number(fm.MotorOffset(other), -0.1, 0.1)], targets=targets),
        part="offset of the motor",
        problem="has none",
        remedy=repr(motor.name),
    )
    refused(
        lambda: fm.Number(fm.MotorOffset(motor), -0.1, float("nan")),
        part="offset of the motor",
        problem="nan",
        remedy="finite",
    )


def test_offsets_at_which_the_joints_do_not_close_have_no_value():
    mechanism = fm.Mechanism("rocking four-bar")
    ground, left, coupler, right = (mechanism.rigid(name, fixed=name == "a") for name in "abcd")
    leaf = mechanism.flexible("leaf", fm.strip([(25, 35), (45, 35)], thickness=2.0, depth=6.0), PLASTIC)
    shaft = mechanism.revolute(ground, left, at=(0, 0))
    mechanism.revolute(left, coupler, at=(0, 30))
    mechanism.revolute(ground, right, at=(40, 0))
    mechanism.revolute(right, coupler, at=(25, 35))
    mechanism.weld(coupler, leaf, at=(27, 35), interface_radius=2.0)
    motor, push = mechanism.motor(shaft), mechanism.force(on=leaf, at=(44, 35), direction=(0, 1))
    sim = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=2.0)
    bounds = -0.1, 1.9  # from 0.7 rad on coupler and right link are too short to reach the left one
    problem = fm.DesignProblem(
        sim, [fm.Number(fm.MotorOffset(motor), *bounds)], targets=[fm.Target(push, force=0.1, displacement=0.1)]
    )
    with pytest.raises(fm.EquilibriumError, match="has no value.*does not close"):
        problem.optimise(start=np.array([0.8]))
