"""Friction of pins as bounds on the load, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.effects import JointSpring
from fenicsmech.simulation import PinFriction

from ..effects.levers import ARM, TILTED, UPRIGHT, lever

STIFFNESS = 50.0
PIN = PinFriction(0.2, 3.0)


@pytest.mark.thorough
@pytest.mark.parametrize(("space", "frame"), [("plane-stress", UPRIGHT), ("3d", UPRIGHT), ("3d", TILTED)])
@pytest.mark.parametrize("swapped", [False, True])
def test_band_of_a_lever_on_a_torsion_spring(space, frame, swapped):
    # f L sin(β − φ) = k φ ± μ r f
    pushed = np.radians(175.0)
    angles = np.linspace(0.2, 2.0, 31)
    forces = STIFFNESS * angles / (ARM * np.sin(pushed - angles))
    case = lever(
        lambda hinge: [JointSpring(hinge, STIFFNESS)], space=space, pushed=pushed, frame=frame, swapped=swapped
    )
    curve = case.simulation.load_displacement(case.force, forces=forces)
    lower, upper = curve.friction_band({case.joint: PIN})
    surplus = 0.2 * 3.0 * forces / (ARM * np.sin(pushed - angles))
    assert upper - forces == pytest.approx(surplus, rel=2e-2)
    assert (upper - forces)[1:-1] == pytest.approx(surplus[1:-1], rel=5e-3)
    assert forces - lower == pytest.approx(upper - forces, rel=1e-10)


def test_band_converges_with_the_distance_of_frames_however_they_are_spaced():
    errors = []
    for count in (9, 17, 33):
        angles = 1.2 * np.linspace(0.05, 1.0, count) ** 2
        forces = STIFFNESS * angles / (ARM * np.cos(angles))
        case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS)])
        curve = case.simulation.load_displacement(case.force, forces=forces)
        _, upper = curve.friction_band({case.joint: PIN})
        exact = 0.2 * 3.0 * forces / (ARM * np.cos(angles))
        errors.append(np.abs((upper - forces - exact) / exact).max())
    assert errors[-1] < 5e-3
    assert np.min(np.log2(np.divide(errors[:-1], errors[1:]))) > 1.6


def parallelogram() -> tuple[fm.Simulation, fm.mechanism.Force, list]:
    """Two upright cranks of length 30 and a coupler of length 40, pushed along it against the bending of a beam."""
    mechanism = fm.Mechanism("parallelogram")
    base = mechanism.rigid("base", fixed=True)
    left, right, coupler = (mechanism.rigid(name) for name in ("left", "right", "coupler"))
    pins = [
        mechanism.revolute(base, left, at=(0, 0)),
        mechanism.revolute(base, right, at=(40, 0)),
        mechanism.revolute(left, coupler, at=(0, 30)),
        mechanism.revolute(right, coupler, at=(40, 30)),
    ]
    beam = mechanism.flexible("beam", fm.strip([(40, 90), (40, 30)], thickness=2.0, depth=4.0), fm.ONYX)
    mechanism.weld(base, beam, at=(40, 87), interface_radius=0.9)
    mechanism.revolute(beam, coupler, at=(40, 30), interface_radius=0.9, name="soft end")
    push = mechanism.force(on=coupler, at=(0, 30), direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", order=1, size=2.0), push, pins


def test_pins_take_their_parts_of_the_load_one_by_one():
    simulation, push, pins = parallelogram()
    curve = simulation.load_displacement(push, displacements=[1.0, 2.0, 3.0])
    bands = [curve.friction_band({pin: PIN})[1] - curve.forces for pin in pins]
    _, upper = curve.friction_band(dict.fromkeys(pins, PIN))
    assert np.all(np.array(bands) >= 0.0)
    assert upper - curve.forces == pytest.approx(sum(bands), rel=1e-12)
    assert curve.friction_band({})[0] == pytest.approx(curve.forces)


def test_invalid_friction_bands_are_refused():
    case = lever(lambda hinge: [JointSpring(hinge, STIFFNESS)])
    mechanism = case.simulation.scene.mechanism
    one = case.simulation.load_displacement(case.force, forces=[1.0])
    with pytest.raises(fm.DescriptionError, match="one frame"):
        one.friction_band({case.joint: PIN})
    twice = case.simulation.load_displacement(case.force, forces=[1.0, 1.0])
    with pytest.raises(fm.DescriptionError, match="the same"):
        twice.friction_band({case.joint: PIN})
    weld = next(joint for joint in mechanism.joints if joint != case.joint)
    with pytest.raises(fm.DescriptionError, match="not a hinge"):
        twice.friction_band({weld: PIN})
    with pytest.raises(fm.DescriptionError, match="not positive"):
        PinFriction(0.0, 1.0)


def test_friction_of_what_is_no_pin_or_of_no_size_is_refused_by_name():
    simulation, push, pins = parallelogram()
    curve = simulation.load_displacement(push, displacements=[1.0, 2.0])
    motor = simulation.scene.mechanism.motor(pins[0], name="drive")
    other = lever(lambda hinge: []).joint
    for pin, named in ((motor, "'drive'"), (push, repr(push.name)), ("hinge", "'hinge'"), (other, repr(other.name))):
        with pytest.raises(
            fm.DescriptionError, match=f"{named} is not a hinge of this curve.*Name its revolute joints"
        ):
            curve.friction_band({pin: PIN})
    with pytest.raises(fm.DescriptionError, match=f"{pins[1].name}.*0.2 is not a friction.*PinFriction"):
        curve.friction_band({pins[1]: 0.2})
    with pytest.raises(fm.DescriptionError, match="is not a mapping.*PinFriction"):
        curve.friction_band(pins[1])
