"""Values of quantities against statics, virtual work and geometry."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import State

PLASTIC = fm.Material("plastic", 2000.0, 0.35, density=1.2e-9)
THICKNESS, DEPTH, LENGTH = 3.0, 6.0, 50.0


class Arm:
    """A cantilever with a loaded hand, in a unit of length ``unit`` mm long."""

    def __init__(self, space: str = "plane-stress", unit: float = 1.0, size: float = 3.0) -> None:
        mechanism = fm.Mechanism("arm")
        base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
        shape = fm.strip([(0, 0), (LENGTH / unit, 0)], thickness=THICKNESS / unit, depth=DEPTH / unit)
        plastic = fm.Material("plastic", PLASTIC.law.E * unit**2, 0.35, density=1.2e-9 * unit**4)
        link = mechanism.flexible("link", shape, plastic)
        radius = 1.4 / unit
        clamp = mechanism.weld(base, link, at=(0, 0), interface_radius=radius, name="clamp")
        mechanism.weld(link, hand, at=(LENGTH / unit, 0), interface_radius=radius, name="wrist")
        self.push = mechanism.force(on=hand, at=(55 / unit, 3 / unit), direction=(0.6, -0.8), name="push")
        self.clamp, self.hand, self.link, self.unit = clamp, hand, link, unit
        self.scene = fm.Scene(mechanism)
        options = {"order": 1} if space == "3d" else {}
        self.simulation = fm.Simulation(self.scene, space=space, size=size / unit, comm=MPI.COMM_SELF, **options)

    def state(self, force: float) -> State:
        return self.simulation.load_displacement(self.push, forces=[force]).frames[-1].state

    def values(self, quantity: fm.Quantity, force: float) -> np.ndarray:
        quantity.check(self.scene, self.simulation.linkage.dim)
        state = self.state(force)
        self.simulation.model.load(state)
        return quantity.reduce(quantity.on(self.simulation.model).values(state))[0]


@cache
def arm(space: str = "plane-stress") -> Arm:
    return Arm(space)


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_a_clamp_holds_what_is_loaded_behind_it(space):
    force = 4.0
    held = arm(space).values(fm.JointForce(arm(space).clamp), force)
    expected = -force * np.array([0.6, -0.8, 0.0])[: len(held)]
    assert held == pytest.approx(expected, abs=1e-5 * force)
    (size,) = arm(space).values(fm.Magnitude(fm.JointForce(arm(space).clamp)), force)
    assert size == pytest.approx(force, rel=1e-5)
    (along,) = arm(space).values(fm.Component(fm.JointForce(arm(space).clamp), (0, 2)), force)
    assert along == pytest.approx(0.8 * force, rel=1e-5)
    # about the clamp, at the place the force has moved to
    moved = arm(space).values(fm.Displacement(arm(space).hand, at=(55, 3)), force)
    x, y = 55.0 + moved[0], 3.0 + moved[1]
    moment = arm(space).values(fm.JointMoment(arm(space).clamp), force)
    assert moment[-1] == pytest.approx(-force * (x * -0.8 - y * 0.6), rel=1e-5)


def test_strain_energy_of_small_loads_is_half_their_work():
    force = 1e-4
    (energy,) = arm().values(fm.StrainEnergy(), force)
    (travel,) = arm().values(fm.Displacement(arm().push), force)
    assert energy == pytest.approx(0.5 * force * travel, rel=1e-5)
    (alone,) = arm().values(fm.StrainEnergy(arm().link), force)
    assert alone == energy


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_displacements_and_rotations_of_a_rigid_link_belong_together(space):
    here = arm(space)
    near, far = (here.values(fm.Displacement(here.hand, at=at), 4.0) for at in ((55, 3), (65, 3)))
    (angle,) = here.values(fm.Rotation(here.hand), 4.0)
    assert (far - near)[:2] == pytest.approx(10.0 * np.array([np.cos(angle) - 1.0, np.sin(angle)]), abs=1e-6)
    (same,) = here.values(fm.Displacement(here.push), 4.0)
    assert near[:2] @ [0.6, -0.8] == pytest.approx(same, rel=1e-12)
    wrist = next(joint for joint in here.scene.mechanism.joints if joint.name == "wrist")
    (held,) = here.values(fm.Rotation(here.link, wrist), 4.0)
    assert held == pytest.approx(angle, rel=1e-6)


def test_rotation_in_space_counts_about_its_axis():
    (turned,) = arm("3d").values(fm.Rotation(arm("3d").hand, about=(0, 0, -1)), 1.0)
    (there,) = arm("3d").values(fm.Rotation(arm("3d").hand), 1.0)
    assert turned == pytest.approx(-there, rel=1e-12) and there < 0.0


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_mass_volume_and_length_are_those_of_the_drawing(space):
    # a strip with round eyes of half its thickness beyond both ends
    volume = DEPTH * (LENGTH * THICKNESS + np.pi * (0.5 * THICKNESS) ** 2)
    (found,) = arm(space).values(fm.LinkVolume(), 0.0)
    assert found == pytest.approx(volume, rel=5e-3)
    (mass,) = arm(space).values(fm.LinkMass(arm(space).link), 0.0)
    assert mass == pytest.approx(1.2e-9 * found, rel=1e-12)
    (other,) = arm(space).values(fm.LinkMass(density=3.0), 0.0)
    assert other == pytest.approx(3.0 * found, rel=1e-12)
    (length,) = arm(space).values(fm.CentrelineLength(arm(space).link), 0.0)
    assert length == pytest.approx(LENGTH, rel=1e-12)


def test_values_do_not_depend_on_units():
    in_metres = Arm(unit=1000.0)
    ours, theirs = arm(), in_metres
    for make, power in (
        (lambda a: fm.Displacement(a.hand, at=(60 / a.unit, 0)), 1),
        (lambda a: fm.Rotation(a.hand), 0),
        (lambda a: fm.JointForce(a.clamp), 0),
        (lambda a: fm.JointMoment(a.clamp), 1),
        (lambda a: fm.StrainEnergy(), 1),
        (lambda a: fm.LinkVolume(), 3),
        (lambda a: fm.CentrelineLength(a.link), 1),
    ):
        one, other = ours.values(make(ours), 4.0), theirs.values(make(theirs), 4.0)
        assert other * 1000.0**power == pytest.approx(one, rel=1e-8, abs=1e-8 * np.abs(one).max())


def test_torque_of_a_motor_is_the_change_of_energy_with_its_position():
    mechanism = fm.Mechanism("wiper")
    base, foot = mechanism.rigid("base", fixed=True), mechanism.rigid("foot")
    blade = mechanism.flexible("blade", fm.strip([(0, 0), (40, 0)], thickness=2.0, depth=6.0), PLASTIC)
    shaft = mechanism.revolute(base, foot, at=(0, 0))
    mechanism.weld(foot, blade, at=(0, 0), interface_radius=0.9)
    mechanism.revolute(blade, base, at=(40, 0), interface_radius=0.9)
    motor = mechanism.motor(shaft, name="shaft")
    scene = fm.Scene(mechanism)
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    rest = mechanism.force(on=foot, at=(0, 0), direction=(1, 0), name="nothing")
    model, energy, torque = simulation.model, fm.StrainEnergy(), fm.MotorTorque(motor)

    def measured(angle: float) -> tuple[float, float]:
        place = scene.configuration("turned", {motor: angle})
        state = simulation.load_displacement(rest, forces=[0.0], configuration=place).frames[0].state
        model.load(state)
        return float(energy.on(model).values(state)[0]), float(torque.on(model).values(state)[0])

    h = 1e-3
    slope = (measured(0.05 + h)[0] - measured(0.05 - h)[0]) / (2.0 * h)
    assert measured(0.05)[1] == pytest.approx(slope, rel=1e-4)
    twice = fm.Drive("gear", {motor: 2.0})
    state = (
        simulation.load_displacement(rest, forces=[0.0], configuration=scene.configuration("turned", {motor: 0.05}))
        .frames[0]
        .state
    )
    model.load(state)
    assert fm.MotorTorque(twice).on(model).values(state) == pytest.approx(2.0 * measured(0.05)[1], rel=1e-9)


def test_invalid_quantities_are_refused():
    other = fm.Mechanism("other")
    stranger, bar = other.rigid("stranger"), arm().link
    for make, complaint in (
        (lambda: fm.Displacement(bar), "no point is given"),
        (lambda: fm.Displacement("tip", at=(0, 0)), "has none"),
        (lambda: fm.Displacement(arm().push, at=(0, 0)), "a point already"),
        (lambda: fm.Rotation(bar), "the link bends"),
        (lambda: fm.ForceMagnitude(bar), "not a force"),
        (lambda: fm.MotorTorque(bar), "not a motor"),
        (lambda: fm.JointForce(bar), "not a joint"),
        (lambda: fm.LinkMass("all"), "not flexible links"),
        (lambda: fm.LinkMass(density=-1.0), "not positive"),
        (lambda: fm.CentrelineLength(stranger), "not a flexible link"),
        (lambda: fm.Component(fm.JointForce(arm().clamp), (0, 0)), "zero length"),
        (lambda: fm.Displacement(stranger, at=(0, 0)).check(arm().scene, 2), "'stranger' is not a part of 'arm'"),
        (lambda: fm.Magnitude(fm.StrainEnergy()).check(arm().scene, 2), "is a number"),
        (lambda: fm.Magnitude(fm.JointMoment(arm().clamp)).check(arm().scene, 2), "is a number"),
        (lambda: fm.Rotation(arm().hand, about=(1, 0, 0)).check(arm().scene, 2), "about z"),
    ):
        with pytest.raises(fm.DescriptionError, match=complaint):
            make()
