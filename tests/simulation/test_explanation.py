"""Explanations name what a simulation leaves out; their figures agree with simulations that include it."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.simulation import weight_influence

from .demo_scenes import describe

STIFF = fm.Material("stiff", 2000.0, 0.3)


def hint(explanation, what: str):
    """The hint of that name, None if there is none."""
    return next((hint for hint in explanation.left_out if hint.what == what), None)


@pytest.mark.thorough
@pytest.mark.parametrize("space", [pytest.param("plane-stress", marks=pytest.mark.parallel), "3d-symmetric", "3d"])
def test_hint_on_weight_is_what_gravity_does(space):
    scene, push = describe("claw")
    simulation = fm.Simulation(scene, space=space, size=4.0)
    curve = simulation.load_displacement(push, forces=[2.0])
    influence = weight_influence(simulation.model, simulation.solver(push), curve.equilibrium(curve.frames[-1]))
    direction = influence / np.linalg.norm(influence)
    density = 1e-2 * 1.2e-9 * 9810.0  # light enough to be linear
    weighed = fm.Scene(scene.mechanism, effects=[fm.Gravity(tuple(direction * density / fm.ONYX.density))])
    heavy = fm.Simulation(weighed, space=space, size=4.0).load_displacement(push, forces=[2.0])
    change = heavy.displacements[0] - curve.displacements[0]
    assert change == pytest.approx(density * np.linalg.norm(influence), rel=1e-3)


def test_weight_matters_to_the_soft_finger_and_not_to_the_stiff_claw():
    for name, force, matters in (("truss", 0.4, True), ("claw", 10.0, False)):
        scene, push = describe(name)
        simulation = fm.Simulation(scene, space="plane-stress", size=4.0)
        curve = simulation.load_displacement(push, forces=[force])
        assert hint(curve.explain(), "weight").matters is matters


def test_hint_on_weight_knows_all_forces_that_act():
    rig = fm.Mechanism("arm")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    link = rig.flexible(
        "link", fm.strip([(-3, 0), (63, 0)], thickness=2.0, depth=6.0), fm.Material("soft", 100.0, 0.3, density=1.2e-9)
    )
    for a, b, x in ((wall, link, -1.5), (link, hand, 61.5)):
        rig.weld(a, b, at=(x, 0), region=fm.Rectangle(3, 4))
    push = rig.force(on=hand, at=(60, 0), direction=(0, 1))
    # far from the link, where its turning counts
    pull = rig.force(on=hand, at=(110, 0), direction=(-1, 0), name="pull")
    simulation = fm.Simulation(fm.Scene(rig), space="plane-stress", size=2.0)
    curve = simulation.load_displacement(push, forces=[0.01], others={pull: 0.3})
    weighed = fm.Scene(rig, effects=[fm.Gravity((0, -1e-3 * 9810.0))])
    heavy = fm.Simulation(weighed, space="plane-stress", size=2.0)
    sunk = heavy.load_displacement(push, forces=[0.01], others={pull: 0.3}).displacements[0] - curve.displacements[0]
    printed = float(hint(curve.explain(), "weight").text.split("at most ")[1].split()[0])
    assert printed == pytest.approx(abs(1e3 * sunk), rel=0.1)


def test_effects_that_are_listed_are_named_and_not_hinted_at():
    scene, push = describe("truss")
    gravity = fm.Gravity((0, -9810))
    simulation = fm.Simulation(fm.Scene(scene.mechanism, effects=[gravity]), space="plane-stress", size=4.0)
    curve = simulation.load_displacement(push, forces=[0.1])
    explanation = curve.explain()
    assert "weight of flexible links by their density" in explanation.simulated
    assert hint(explanation, "weight") is None
    assert "Simulated:" in str(explanation)
    assert "Left out:" in str(explanation)


def test_joints_are_ideal_but_for_the_compliance_that_is_listed():
    scene, push = describe("truss")
    pin = scene.mechanism.joints[0]
    for effects, others in (([], ""), ([fm.JointCompliance(pin, 0.1)], "other ")):
        simulation = fm.Simulation(fm.Scene(scene.mechanism, effects=effects), space="plane-stress", size=4.0)
        simulated = simulation.load_displacement(push, forces=[0.1]).explain().simulated
        assert any(f"without play, friction or {others}compliance" in text for text in simulated)
        assert ("compliance 0.1 of" in simulated[-1]) == bool(effects)


def pinned(
    material: fm.Material,
    *,
    depth: float = 4.0,
    space: str = "plane-stress",
    order: int = 2,
    formulation=None,
    knob: tuple[float, float] | None = None,
):
    """A straight link on a slider, compressed along its axis, maybe with a ``knob`` that nothing acts on."""
    rig = fm.Mechanism("strut")
    ground, slide = rig.rigid("ground", fixed=True), rig.rigid("slide")
    strut = rig.flexible("strut", fm.strip([(0, 0), (60, 0)], thickness=6.0, depth=depth), material)
    rig.revolute(ground, strut, at=(0, 0), interface_radius=2.0)
    rig.revolute(strut, slide, at=(60, 0), interface_radius=2.0)
    rig.prismatic(ground, slide, at=(60, 0), axis=(1, 0, 0))
    if knob is not None:
        rig.weld(strut, rig.rigid("knob"), at=knob, interface_radius=2.0)
    push = rig.force(on=slide, at=(60, 0), direction=(-1, 0))
    return fm.Simulation(fm.Scene(rig), space=space, size=4.0, order=order, formulation=formulation), push


def euler(*, thickness: float, depth: float = 4.0) -> float:
    """Euler load of a stiff link, 60 long, that bends out of the plane."""
    return np.pi**2 * STIFF.law.E * thickness * depth**3 / 12.0 / 60.0**2


def test_compression_is_compared_with_the_load_that_buckles_a_link_out_of_the_plane():
    critical = euler(thickness=6.0)
    for fraction in (0.05, 0.5):
        simulation, push = pinned(STIFF)
        curve = simulation.load_displacement(push, forces=[fraction * critical])
        found = hint(curve.explain(), "bending out of the plane")
        assert f"about {fraction:.2g} " in found.text
        assert found.matters is (fraction > 0.2)


@pytest.mark.parametrize("knob", [(30, 0), (0, 0)], ids=["between", "at the same place as another"])
def test_compression_and_length_do_not_depend_on_joints_that_carry_nothing(knob):
    simulation, push = pinned(STIFF, knob=knob)
    curve = simulation.load_displacement(push, forces=[0.5 * euler(thickness=6.0)])
    assert "about 0.5 " in hint(curve.explain(), "bending out of the plane").text


def test_compression_is_compared_with_the_buckling_load_of_the_shape_that_is_simulated():
    simulation, push = pinned(STIFF)
    (strut,) = simulation.scene.mechanism.flexible_links
    thicker = simulation.with_shapes({strut: fm.strip([(0, 0), (60, 0)], thickness=8.0, depth=4.0)})
    curve = thicker.load_displacement(push, forces=[0.5 * euler(thickness=8.0)])
    assert "about 0.5 " in hint(curve.explain(), "bending out of the plane").text


def test_tension_does_not_buckle_a_link():
    simulation, push = pinned(STIFF)
    curve = simulation.load_displacement(push, forces=[-0.5 * euler(thickness=6.0)])
    assert not hint(curve.explain(), "bending out of the plane").matters


def test_force_across_a_link_does_not_buckle_it():
    rig = fm.Mechanism("cantilever")
    ground, end = rig.rigid("ground", fixed=True), rig.rigid("end")
    leaf = rig.flexible("leaf", fm.strip([(0, 0), (60, 0)], thickness=6.0, depth=1.0), STIFF)
    rig.weld(ground, leaf, at=(0, 0), interface_radius=2.0)
    rig.weld(leaf, end, at=(60, 0), interface_radius=2.0)
    push = rig.force(on=end, at=(60, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(rig), space="plane-stress", size=4.0)
    curve = simulation.load_displacement(push, forces=[0.5 * euler(thickness=6.0, depth=1.0)])
    assert not hint(curve.explain(), "bending out of the plane").matters


@pytest.mark.parametrize(
    ("poisson", "space", "order", "formulation", "hinted", "pressed"),
    [
        (0.3, "plane-strain", 2, None, False, False),
        (0.495, "plane-strain", 2, None, False, True),
        (0.495, "plane-strain", 2, fm.DisplacementFormulation(), True, False),
        (0.495, "plane-strain", 1, None, True, False),
        (0.485, "plane-strain", 2, None, True, False),
        (0.485, "plane-strain", 2, fm.MixedFormulation(above=0.48), False, True),
        (0.495, "plane-stress", 2, None, False, False),
    ],
)
def test_nearly_incompressible_links_have_a_pressure_or_are_pointed_out(
    poisson, space, order, formulation, hinted, pressed
):
    simulation, push = pinned(fm.Material("rubber", 2.0, poisson), space=space, order=order, formulation=formulation)
    curve = simulation.load_displacement(push, forces=[0.01])
    explanation, what = curve.explain(), "pressure as an unknown"
    found = hint(explanation, what)
    assert (found is not None and found.matters) == hinted
    assert (f"{what} (u–p elements) in strut" in explanation.simulated) == pressed


def test_links_that_cross_are_pointed_out():
    rig = fm.Mechanism("scissors")
    ground, end = rig.rigid("ground", fixed=True), rig.rigid("end")
    one = rig.flexible("one", fm.strip([(0, 0), (40, 30)], thickness=3.0, depth=4.0), fm.ONYX)
    other = rig.flexible("other", fm.strip([(0, 30), (40, 0)], thickness=3.0, depth=4.0), fm.ONYX)
    for link, start, stop in ((one, (0, 0), (40, 30)), (other, (0, 30), (40, 0))):
        rig.revolute(ground, link, at=start, interface_radius=2.0)
        rig.revolute(link, end, at=stop, interface_radius=2.0)
    push = rig.force(on=end, at=(40, 15), direction=(1, 0))
    simulation = fm.Simulation(fm.Scene(rig), space="plane-stress", size=3.0)
    curve = simulation.load_displacement(push, forces=[1.0])
    assert "one and other" in hint(curve.explain(), "contact between links").text
