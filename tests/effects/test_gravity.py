"""Gravity bends links as their weight does, moves rigid links to rest, and costs nothing when it is not listed."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.effects import Gravity, Mass
from fenicsmech.equilibrium import LoadControl
from fenicsmech.errors import DescriptionError
from fenicsmech.quantities import LawParameter, Sensitivity

DENSITY, G = 1.2e-9, 9810.0
NYLON = fm.Material("nylon", 2000.0, 0.0, density=DENSITY)
LENGTH, THICKNESS, DEPTH, CLAMP = 100.0, 2.0, 6.0, 2.0


def cantilever(space: str, effects, *, size: float = 2.0, material=NYLON) -> tuple[fm.Simulation, object]:
    """A link from x = 0 to ``LENGTH`` between a wall and a block, and a force on the block, downwards."""
    rig = fm.Mechanism("cantilever")
    wall, block = rig.rigid("wall", fixed=True), rig.rigid("block")
    shape = fm.strip([(-CLAMP, 0), (LENGTH + CLAMP, 0)], thickness=THICKNESS, depth=DEPTH)
    beam = rig.flexible("beam", shape, material)
    rig.weld(wall, beam, at=(-0.5 * CLAMP, 0), region=fm.Rectangle(CLAMP, 2 * THICKNESS))
    rig.weld(beam, block, at=(LENGTH + 0.5 * CLAMP, 0), region=fm.Rectangle(CLAMP, 2 * THICKNESS))
    push = rig.force(on=block, at=(LENGTH, 0), direction=(0, -1))
    return fm.Simulation(fm.Scene(rig, effects=effects(block)), space=space, size=size), push


@pytest.mark.thorough
@pytest.mark.parametrize("space", [pytest.param("plane-stress", marks=pytest.mark.parallel), "3d-symmetric", "3d"])
def test_a_cantilever_sags_as_a_beam_does_under_its_weight_and_that_of_its_end(space):
    mass = 2e-6
    simulation, push = cantilever(space, lambda block: [Gravity((0, -G), {block: Mass(mass, (LENGTH, 0))})])
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    stiffness = NYLON.law.E * DEPTH * THICKNESS**3 / 12.0
    weight = DENSITY * G * THICKNESS * DEPTH
    # the clamped end of the link is a body of weight · CLAMP at LENGTH + CLAMP / 2
    end = weight * CLAMP
    tip = weight * LENGTH**4 / 8.0 + (mass * G + end) * LENGTH**3 / 3.0 + 0.5 * end * CLAMP * LENGTH**2 / 2.0
    assert frame.displacement == pytest.approx(tip / stiffness, rel=0.005)
    assert frame.stable


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric", "3d"])
def test_a_pendulum_on_a_flexible_hinge_hangs_where_its_force_and_its_weight_balance(space):
    rig = fm.Mechanism("pendulum")
    wall, rod = rig.rigid("wall", fixed=True), rig.rigid("rod")
    # a soft link from below carries next to nothing
    soft = fm.Material("foam", 1e-3, 0.3)
    spring = rig.flexible("spring", fm.strip([(0, -60), (0, -30)], thickness=2.0, depth=2.0), soft)
    rig.revolute(wall, rod, at=(0, 0))
    rig.revolute(wall, spring, at=(0, -60), interface_radius=1.0)
    rig.revolute(spring, rod, at=(0, -30), interface_radius=1.0)
    push = rig.force(on=rod, at=(0, -20), direction=(1, 0))
    mass = 1e-4
    scene = fm.Scene(rig, effects=[Gravity((0, -G), masses={rod: Mass(mass, (0, -10))})])
    simulation = fm.Simulation(scene, space=space, size=2.0)
    (frame,) = simulation.load_displacement(push, forces=[0.2]).frames
    angle = np.arctan2(0.2 * 20.0, mass * G * 10.0)
    assert frame.displacement == pytest.approx(20.0 * np.sin(angle), rel=0.005)


def test_displacements_count_from_the_weightless_configuration_and_loads_add_up():
    heavy, push = cantilever("plane-stress", lambda block: [Gravity((0, -G))])
    light, other = cantilever("plane-stress", lambda block: [])
    sag, both = heavy.load_displacement(push, forces=[0.0, 1e-3]).displacements
    (alone,) = light.load_displacement(other, forces=[1e-3]).displacements
    assert sag > 0.2
    assert both - sag == pytest.approx(alone, rel=2e-3)


def test_derivatives_by_modulus_and_force_see_the_weight():
    simulation, push = cantilever("plane-stress", lambda block: [Gravity((0, -10.0 * G))])

    def displacement(modulus: float) -> tuple[float, object]:
        simulation.model.set_parameter(np.array([True]), "E", modulus)
        frame = simulation.load_displacement(push, forces=[5e-3]).frames[-1]
        return frame.displacement, frame.state

    solver = simulation.solver(push)
    _, state = displacement(2000.0)
    travel = fm.Displacement(push).on(simulation.model)
    modulus = LawParameter("E", *simulation.scene.mechanism.flexible_links)
    (gradient,) = Sensitivity(simulation.model, [modulus]).gradients(solver, state, LoadControl(5e-3), [travel])
    slope = (displacement(2002.0)[0] - displacement(1998.0)[0]) / 4.0
    assert gradient.numbers[0] == pytest.approx(slope, rel=1e-5)


def test_without_effects_no_form_term_is_added():
    bare, push = cantilever("plane-stress", lambda block: [])
    heavy, _ = cantilever("plane-stress", lambda block: [Gravity((0, -G))])
    assert bare.model.elastic.effects_ufl is None
    terms = [len(simulation.model.elastic.energy_ufl.integrals()) for simulation in (bare, heavy)]
    assert terms == [1, 2]
    assert not any(bare.scene.effects)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda block: Gravity((0, -G), masses={block: Mass(float("nan"), (0, 0))}), "nan"),
        (lambda block: Gravity((0, -G), masses={"block": Mass(1.0, (0, 0))}), "'block' is not a rigid link"),
        (lambda block: Gravity((0, -G), masses={block: 0.02}), "gravity on 'block': 0.02 is not a mass"),
        (lambda block: Gravity((0, -G), masses=Mass(1.0, (0, 0))), "is not a mapping of rigid links"),
        (lambda block: Gravity((0, -G, 1.0)), "leaves the plane"),
    ],
)
def test_senseless_numbers_are_refused(make, message):
    with pytest.raises(DescriptionError, match=message):
        cantilever("plane-stress", lambda block: [make(block)])


def test_gravity_needs_a_density_or_a_mass():
    with pytest.raises(DescriptionError, match="gravity: nothing of 'cantilever' has weight"):
        cantilever("plane-stress", lambda block: [Gravity((0, -G))], material=fm.Material("nylon", 2000.0, 0.0))
