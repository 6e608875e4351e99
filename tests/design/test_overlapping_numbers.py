"""Numbers of one part and of several with it: the design given last counts, whatever was asked for before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from .refusal import refused

PLASTIC = fm.Material("plastic", 2000.0, 0.35)


def frame(space: str = "plane-stress") -> tuple[fm.Simulation, fm.Force]:
    """A hand on two strips with sprung hinges, each on a motor, pushed sideways."""
    rig = fm.Mechanism("frame")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    springs = []
    for name, x in (("left", 0.0), ("right", 20.0)):
        root = rig.rigid(f"{name} root")
        strip = rig.flexible(name, fm.strip([(x, 0), (x, 30)], thickness=2.0, depth=5.0), PLASTIC)
        rig.motor(rig.revolute(wall, root, at=(x, 0)))
        rig.weld(root, strip, at=(x, 0), interface_radius=2.0)
        springs.append(fm.JointSpring(rig.revolute(strip, hand, at=(x, 30), interface_radius=2.0), 3000.0))
    push = rig.force(on=hand, at=(10, 30), direction=(1, 0.2))
    return fm.Simulation(fm.Scene(rig, springs), space=space, size=6.0, order=1, comm=MPI.COMM_SELF), push


# kinds of numbers of the first parts, and another value than the drawn one
Describe = Callable[[fm.Scene, int], fm.NumberKind]
NUMBERS: dict[str, tuple[Describe, float]] = {
    "depth": (lambda scene, count: fm.Depth(*scene.mechanism.flexible_links[:count]), 10.0),
    "modulus": (lambda scene, count: fm.LawParameter("E", *scene.mechanism.flexible_links[:count]), 4000.0),
    "stiffness": (lambda scene, count: fm.SpringStiffness(*scene.effects[:count]), 9000.0),
    "rest": (lambda scene, count: fm.SpringRest(*scene.effects[:count]), 0.1),
    "offset": (lambda scene, count: fm.MotorOffset(*scene.mechanism.motors[:count]), 0.1),
}


def measured(sim: fm.Simulation, push: fm.Force, numbers: dict[fm.NumberKind, float]) -> np.ndarray:
    """Displacement, torques and energy with some numbers."""
    design = fm.Design(np.zeros_like(sim.model.elastic.shape.x.array), numbers)
    (at,) = sim.with_design(design).load_displacement(push, forces=[5.0]).frames
    return np.array([at.displacement, *at.motors.values(), at.strain_energy])


EACH = [name if name in ("depth", "offset") else pytest.param(name, marks=pytest.mark.thorough) for name in NUMBERS]


@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_a_number_of_two_parts_counts_after_that_of_one_and_the_other_way_round(name, space):
    (sim, push), (describe, value) = frame(space), NUMBERS[name]
    one, both = (describe(sim.scene, count) for count in (1, 2))
    drawn, of_both, of_one, again = (measured(sim, push, n) for n in ({}, {both: value}, {one: value}, {both: value}))
    assert again == pytest.approx(of_both, rel=1e-8, abs=1e-12)
    pairs = (of_both, of_one), (of_both, drawn), (of_one, drawn)
    assert all(np.max(np.abs(there / here - 1.0)) > 1e-2 for there, here in pairs)


@pytest.mark.parametrize("name", NUMBERS)
def test_requesting_a_number_leaves_the_design_and_finds_the_drawn_value(name):
    (sim, _), (describe, value) = frame(), NUMBERS[name]
    model = sim.model
    one, both = (describe(sim.scene, count) for count in (1, 2))
    drawn = model.number(one).drawn
    with model.shaped(fm.Design(model.design.field, {one: value})):
        assert model.number(both).drawn == drawn
        assert model.number(one).value == value
        assert model.design.numbers == {one: value}
    assert model.number(one).value == model.number(both).value == drawn


def test_frames_keep_their_numbers_when_others_have_been_given_since():
    sim, push = frame()
    links = sim.scene.mechanism.flexible_links
    nothing = np.zeros_like(sim.model.elastic.shape.x.array)
    curve = sim.with_design(fm.Design(nothing, {fm.Depth(*links): 10.0})).load_displacement(push, forces=[5.0])
    before = curve.stress_field(curve.frames[0]).stress
    with sim.model.shaped(fm.Design(nothing, {fm.Depth(links[0]): 20.0})):
        after = curve.stress_field(curve.frames[0]).stress
        assert after == pytest.approx(before, rel=1e-12, abs=1e-12 * np.abs(before).max())
        assert sim.model.depths == (20.0, 5.0)
    with sim.model.shaped(curve.frames[0].design):
        assert sim.model.depths == (10.0, 10.0)
    assert sim.model.depths == (5.0, 5.0)


def test_two_numbers_that_change_the_same_are_refused():
    sim, _ = frame()
    links = sim.scene.mechanism.flexible_links
    refused(
        lambda: fm.Design(np.zeros(2), {fm.Depth(links[0]): 10.0, fm.Depth(*links): 20.0}),
        part="depth of 'left' and 'right'",
        problem="depth of 'left' is given too",
        remedy="once",
    )
