"""Designs of numbers: moduli and depths found from what is wanted, in closed form and beside shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Correction, MeshQuality, NumberBounds, ShapeBounds, StayClose

from ..effects.levers import ARM, lever
from .mechanisms import Case, objective, truss
from .refusal import refused

PLASTIC = fm.Material("plastic", 2000.0, 0.35, density=1.2e-9)
EXACT = {"optimiser": fm.LevenbergMarquardt(tolerance=1e-16), "correction": Correction(estimates=False)}


def cantilever(depth: float = 5.0, modulus: float = 2000.0) -> tuple[fm.Scene, fm.FlexibleLink, fm.Force]:
    rig = fm.Mechanism("cantilever")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    material = fm.Material("plastic", modulus, 0.35, density=1.2e-9)
    strip = rig.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=depth), material)
    rig.clamp(wall, strip, end="start", length=5.0)
    rig.clamp(hand, strip, end="end", length=5.0)
    return fm.Scene(rig), strip, rig.force(on=hand, at=(40, 0), direction=(0, 1))


def curve(sim: fm.Simulation, push: fm.Force, forces: list[float]) -> np.ndarray:
    return np.array(sim.load_displacement(push, forces=forces).displacements)


def test_a_modulus_is_recovered_from_a_curve_computed_with_it():
    scene, strip, push = cantilever(modulus=1234.5)
    known = curve(fm.Simulation(scene, space="plane-stress", size=3.0), push, [1.0, 4.0])
    scene, strip, push = cantilever()
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    targets = [fm.Target(push, force=f, displacement=u) for f, u in zip((1.0, 4.0), known, strict=True)]
    problem = fm.DesignProblem(sim, [fm.Number(fm.LawParameter("E", strip), 500.0, 4000.0)], targets=targets)
    result = problem.optimise(**EXACT)
    (modulus,) = result.numbers
    assert modulus.value == pytest.approx(1234.5, rel=1e-6)
    assert (modulus.name, modulus.unit, modulus.drawn) == ("E of 'strip'", "MPa", 2000.0)
    assert curve(sim.with_design(result), push, [1.0, 4.0]) == pytest.approx(known, rel=1e-6)
    assert curve(sim, push, [1.0, 4.0]) != pytest.approx(known, rel=0.1)


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_depth_is_found_with_which_a_link_drawn_as_deep_moves_as_wanted(space):
    scene, strip, push = cantilever(depth=5.0)
    sim = fm.Simulation(scene, space=space, size=3.0)
    (moved,) = curve(sim, push, [2.0])
    targets = [fm.Target(push, force=2.6, displacement=float(moved))]
    problem = fm.DesignProblem(sim, [fm.Number(fm.Depth(strip), 3.0, 9.0)], targets=targets)
    result = problem.optimise(surrogate=None, **EXACT)
    (depth,) = result.numbers
    if space == "plane-stress":  # in space the clamps hold the contraction across the depth, of deeper links more
        assert depth.value == pytest.approx(5.0 * 1.3, rel=1e-9)
    assert curve(sim.with_design(result), push, [2.6]) == pytest.approx([moved], rel=1e-9)
    drawn, _, force = cantilever(depth=depth.value)
    assert curve(fm.Simulation(drawn, space=space, size=3.0), force, [2.6]) == pytest.approx([moved], rel=1e-3)


def test_depths_change_the_solid_that_is_exported_and_verified(tmp_path):
    scene, strip, push = cantilever(depth=5.0)
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    (moved,) = curve(sim, push, [2.0])
    targets = [fm.Target(push, force=2.6, displacement=float(moved))]
    problem = fm.DesignProblem(sim, [fm.Number(fm.Depth(strip), 3.0, 9.0)], targets=targets)
    result = problem.verify(problem.optimise(**EXACT), tmp_path)
    (found,) = result.targets
    assert found.part.value == pytest.approx(found.reached, rel=5e-3)
    again = fm.Mechanism("again")
    wall, hand = again.rigid("wall", fixed=True), again.rigid("hand")
    part = again.flexible("part", fm.step_file(tmp_path / "strip.step", depth=1.0), PLASTIC)
    for link, at in ((wall, (2.5, 0)), (hand, (37.5, 0))):
        again.weld(link, part, at=at, region=fm.Rectangle(5.0, 3.0))
    solid = fm.Simulation(fm.Scene(again), space="3d", size=3.0)
    heights = solid.model.mesh.vertices[:, 2]
    assert np.ptp(heights) == pytest.approx(6.5, rel=1e-6)


def test_results_print_their_numbers_and_keep_them_in_files(tmp_path):
    scene, strip, push = cantilever()
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    numbers = [fm.Number(fm.Depth(strip), 3.0, 9.0), fm.Number(fm.LawParameter("E", strip), 500.0, 4000.0)]
    problem = fm.DesignProblem(sim, numbers, targets=[fm.Target(push, force=2.0, displacement=1.0)])
    result = problem.optimise(checkpoint=tmp_path / "checkpoint.json")
    assert "depth of 'strip': " in str(result) and "drawn with 5 mm" in str(result)
    assert result.parameters == 2 and result.links == () and result.thickness is None
    result.save(tmp_path / "design.json")
    loaded = fm.DesignResult.load(tmp_path / "design.json")
    assert loaded == result
    once, again = (curve(sim.with_design(own), push, [2.0]) for own in (result, loaded))
    assert again == pytest.approx(once, rel=1e-12)
    assert problem.optimise(checkpoint=tmp_path / "checkpoint.json", resume=True).numbers == result.numbers
    wider = fm.DesignProblem(sim, [fm.Number(fm.Depth(strip), 3.0, 9.5), numbers[1]], targets=problem.targets)
    with pytest.raises(fm.DescriptionError, match="another problem, with other numbers"):
        wider.optimise(checkpoint=tmp_path / "checkpoint.json", resume=True)
    other, _, _ = cantilever()
    other.mechanism.name = "other"
    assert loaded.values(other) == result.values(other)


def test_mass_and_volume_see_the_depth():
    scene, strip, push = cantilever(depth=5.0)
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    (moved,) = curve(sim, push, [1.0])
    targets = [
        fm.Target(fm.LinkMass(strip), least=True),
        fm.Target(fm.Displacement(push), fm.Sample({push: 1.0}), at_most=1.25 * float(moved)),
    ]
    result = fm.DesignProblem(sim, [fm.Number(fm.Depth(strip), 2.0, 9.0)], targets=targets).optimise(
        correction=Correction(estimates=False)
    )
    assert result.numbers[0].value == pytest.approx(4.0, rel=0.02)
    mass = result.targets[0]
    assert mass.reached / mass.started == pytest.approx(result.numbers[0].value / 5.0, rel=1e-9)


def both(case: Case) -> Case:
    """A case with the depth and the modulus of its first link beside its shapes."""
    link = case.designs[0].link
    numbers = [fm.Number(fm.Depth(link), 8.0, 40.0), fm.Number(fm.LawParameter("E", link), 1.0, 4.0)]
    return replace(case, designs=[*case.designs, *numbers])


@pytest.mark.parametrize(
    ("space", "size", "order"),
    [
        ("plane-stress", 3.0, 2),
        pytest.param("3d-symmetric", 4.0, 2, marks=pytest.mark.thorough),
        pytest.param("3d", 4.0, 2, marks=pytest.mark.thorough),
    ],
)
def test_gradients_of_the_objective_by_shapes_and_numbers_agree_with_central_differences(space, size, order):
    regulariser = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + NumberBounds() + 1e-3 * StayClose()
    whole, bench = objective(both(truss((0.1, 2.0), (0.4, 3.2))), regulariser, space=space, size=size, order=order)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    assert len(p) == 20
    here = whole.evaluate(p)

    def slope(of) -> np.ndarray:
        """Central differences, extrapolated: numbers bend the objective more than shapes do."""
        found = []
        for step in (1e-3, 2e-3):
            ahead, back = (of(whole.evaluate(p + h * direction)) for h in (step, -step))
            found.append((ahead - back) / (2 * step))
        return (4.0 * found[0] - found[1]) / 3.0

    assert here.gradient @ direction == pytest.approx(slope(lambda own: own.value), rel=1e-5)
    residuals = slope(lambda own: own.residuals)
    assert here.jacobian @ direction == pytest.approx(residuals, rel=1e-5, abs=1e-5 * np.abs(residuals).max())


@pytest.mark.parallel
def test_any_number_of_processes_finds_the_same_derivatives_by_numbers():
    seen = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        whole, bench = objective(both(truss((0.1, 2.0), (0.4, 3.2))), StayClose(), comm=comm)
        whole.evaluate(bench.rest.initial)
        here = whole.evaluate(bench.design(0.05, seed=5))
        seen.append((here.value, here.gradient))
    for one, together in zip(*seen, strict=True):
        assert together == pytest.approx(one, rel=1e-7, abs=1e-7 * np.abs(one).max())


def test_invalid_numbers_are_refused():
    scene, strip, push = cantilever()
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    targets, depth = [fm.Target(push, force=2.0, displacement=1.0)], fm.Depth(strip)
    _, other, _ = cantilever(depth=4.0)

    def problem(*numbers: fm.Number) -> fm.DesignProblem:
        return fm.DesignProblem(sim, numbers, targets=targets)

    refused(lambda: fm.Number(strip, 2.0, 3.0), part="number", problem="not a kind", remedy="Depth(link)")
    refused(lambda: fm.Number(fm.Depth, 2.0, 3.0), part="number", problem="Depth'> is not a kind", remedy="Depth(link)")
    refused(lambda: fm.Number(depth, 6.0, 2.0), part="depth of 'strip'", problem="6 to 2", remedy="smaller one first")
    refused(lambda: fm.Number(depth, -1.0, 2.0), part="depth of 'strip'", problem="-1", remedy="greater than zero")
    refused(
        lambda: fm.Number(fm.LawParameter("nu", strip), 0.2, 0.6), part="NeoHookean", problem="0.6", remedy="0.5, both"
    )
    refused(lambda: fm.Depth(), part="depth", problem="no part", remedy="Name one")
    refused(lambda: problem(fm.Number(fm.Depth(other), 2.0, 6.0)), part="depth", problem="has none", remedy="'strip'")
    refused(
        lambda: problem(fm.Number(fm.LawParameter("mu", strip), 2.0, 6.0)), part="mu", problem="no such", remedy="E, nu"
    )
    refused(
        lambda: problem(fm.Number(depth, 2.0, 6.0), fm.Number(depth, 2.0, 7.0)),
        part="depth of 'strip'",
        problem="twice",
        remedy="once",
    )
    refused(
        lambda: problem(fm.Number(depth, 6.0, 9.0)).initial,
        part="depth of 'strip'",
        problem="5 is drawn",
        remedy="Widen",
    )


def test_numbers_of_a_design_are_refused_as_those_of_a_problem_are():
    scene, strip, _ = cantilever()
    _, other, _ = cantilever(depth=4.0)
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)
    weld = scene.mechanism.joints[0]

    def given(*numbers: tuple[object, float]) -> fm.Simulation:
        return sim.with_design(fm.Design(np.zeros_like(sim.model.elastic.shape.x.array), dict(numbers)))

    for number, words in (
        (("depth", 3.0), ("number", "not a kind", "Depth(link)")),
        ((fm.Depth, 3.0), ("number", "not a kind", "Depth(link)")),
        ((fm.Depth(strip), -1.0), ("depth of 'strip'", "-1", "greater than zero")),
        ((fm.Depth(strip), float("nan")), ("depth of 'strip'", "nan", "finite number")),
        ((fm.LawParameter("nu", strip), 0.6), ("NeoHookean", "0.6", "0.5, both")),
        ((fm.LawParameter("mu", strip), 2.0), ("mu", "no such", "E, nu")),
        ((fm.Depth(other), 3.0), ("depth", "has none", "'strip'")),
        ((fm.JointAxis(weld), 4.0), ("axis", "4 rad", "half a turn")),
        ((fm.JointAxis(weld, about=(1, 0, 0)), 0.1), ("axis", "no axis in the plane", "sliders")),
        ((fm.JointPosition(weld, direction=(0, 0, 1)), 1.0), ("position", "leaves the plane", "two coordinates")),
    ):
        part, problem, remedy = words
        refused(lambda number=number: given(number), part=part, problem=problem, remedy=remedy)
    both = (fm.Depth(strip), 3.0), (fm.Depth(other, strip), 3.0)
    refused(lambda: given(*both), part="depth", problem="both change the same", remedy="once")


def test_springs_are_as_stiff_as_the_moment_of_the_force_requires():
    rest, angle, force = -0.2, 0.5, 1.5
    case = lever(lambda hinge: [fm.JointSpring(hinge, 60.0, rest=rest)])
    (spring,) = case.simulation.scene.effects
    targets = [fm.Target(case.force, force=force, displacement=ARM * np.sin(angle))]
    for kind, bounds, wanted in (
        (fm.SpringStiffness(spring), (20.0, 200.0), force * ARM * np.cos(angle) / (angle - rest)),
        (fm.SpringRest(spring), (-1.5, 0.5), angle - force * ARM * np.cos(angle) / 60.0),
    ):
        problem = fm.DesignProblem(case.simulation, [fm.Number(kind, *bounds)], targets=targets)
        result = problem.optimise(**EXACT)
        assert result.numbers[0].value == pytest.approx(wanted, rel=1e-6)
        found = curve(case.simulation.with_design(result), case.force, [force])
        assert found == pytest.approx([ARM * np.sin(angle)], rel=1e-6)


def test_paths_are_those_of_springs_as_designed():
    # two springs in a row share the travel of a motor, k₁ x₁ = k₂ x₂
    rig = fm.Mechanism("slides")
    ground, slide, crank = rig.rigid("ground", fixed=True), rig.rigid("slide"), rig.rigid("crank")
    leaf = rig.flexible("leaf", fm.strip([(0, -30), (20, -30)], thickness=6.0, depth=6.0), PLASTIC)
    rig.weld(ground, leaf, at=(3, -30), interface_radius=2.0)
    springs = [
        fm.JointSpring(rig.prismatic(*links, at=(0, 0), axis=(1, 0)), 2.0)
        for links in ((ground, slide), (slide, crank))
    ]
    motor = rig.motor(rig.prismatic(ground, crank, at=(0, 0), axis=(1, 0)))
    push, scene = rig.force(on=slide, at=(0, 0), direction=(1, 0)), fm.Scene(rig, effects=springs)
    sim = fm.Simulation(scene, space="plane-stress", order=1, size=6.0)
    apart = [scene.configuration("apart", {motor: 5.0})]
    soft = sim.with_design(fm.Design(sim.model.design.field, {fm.SpringStiffness(springs[0]): 0.5}))
    assert soft.path(push, apart)[0] == pytest.approx((4.0, 0.0), abs=1e-9)
    assert sim.path(push, apart)[0] == pytest.approx((2.5, 0.0), abs=1e-9)


def test_one_of_two_springs_in_a_joint_is_refused():
    case = lever(lambda hinge: [fm.JointSpring(hinge, 60.0), fm.JointSpring(hinge, 40.0)])
    numbers = [fm.Number(fm.SpringStiffness(case.simulation.scene.effects[1]), 20.0, 200.0)]
    targets = [fm.Target(case.force, force=1.0, displacement=5.0)]
    refused(
        lambda: fm.DesignProblem(case.simulation, numbers, targets=targets),
        part="stiffness of the spring",
        problem="2 parts of that name",
        remedy="as one",
    )


def test_numbers_are_shared_by_links_that_are_alike_in_the_simulation():
    rig = fm.Mechanism("two leaves")
    ground, hand = rig.rigid("ground", fixed=True), rig.rigid("hand")
    links, materials = [], [fm.Material(name, 2000.0, 0.35) for name in ("one", "other")]
    for y, material in zip((0, 10), materials, strict=True):
        links.append(rig.flexible(material.name, fm.strip([(0, y), (30, y)], thickness=2.0, depth=5.0), material))
        rig.clamp(ground, links[-1], end="start", length=4.0)
        rig.clamp(hand, links[-1], end="end", length=4.0)
    sim = fm.Simulation(fm.Scene(rig), space="plane-stress", size=3.0)
    assert sim.model.number(fm.Depth(*links)).drawn == 5.0
    assert sim.model.number(fm.LawParameter("E", *links)).drawn == 2000.0
    deeper = sim.with_shapes({links[1]: replace(links[1].shape, depth=6.0)})
    refused(lambda: deeper.model.number(fm.Depth(*links)), part="depth", problem="5, 6", remedy="alike")
    stiffer = sim.with_material(materials[1], fm.Material("stiff", 3000.0, 0.35))
    refused(
        lambda: stiffer.model.number(fm.LawParameter("E", *links)), part="E of", problem="2000, 3000", remedy="alike"
    )


def test_laws_and_depths_of_rigid_links_are_refused():
    scene, _, _ = cantilever()
    wall = scene.mechanism.rigid_links[0]
    refused(lambda: fm.LawParameter("E", wall), part="parameter", problem="'wall'.*not a flexible link", remedy="Give")
    refused(lambda: fm.Depth(wall), part="depth", problem="'wall'.*not a flexible link", remedy="Give")


def test_coordinates_of_directions_are_no_numbers():
    fibres = fm.Material("fibres", law=fm.TransverselyIsotropic(30.0, 2.0, 0.3, 0.5, 0.9))
    rig = fm.Mechanism("strip")
    strip = rig.flexible("strip", fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=5.0), fibres)
    assert fm.LawParameter("E_along", strip).described(strip) == 30.0
    for name in ("along0", "along1"):
        kind = fm.LawParameter(name, strip)
        with pytest.raises(fm.DescriptionError, match="direction of the law of 'fibres'.*unit length") as caught:
            kind.check(fm.Scene(rig), 3)
        assert "with_material" in caught.value.remedy
        assert caught.value.remedy.endswith("E_along, E_across, nu_along, nu_across, G_along")


@pytest.mark.parametrize(
    ("law", "moduli"),
    [
        (fm.NeoHookean(3.0, 0.4), "E"),
        (fm.Ogden((1.0, 0.5), (2.0, -2.0), 0.4), "mu0 mu1"),
        (fm.Gent(1.0, 30.0, 0.4), "mu"),
        (fm.MooneyRivlin(1.0, 0.2, 0.4), "C10 C01"),
        (fm.Yeoh(1.0, 0.2, 0.1, 0.4), "C1 C2 C3"),
        (fm.Orthotropic(10.0, 4.0, 2.0, 0.3, 0.35, 0.4, 1.5, 1.2, 0.7), "E1 E2 E3 G12 G13 G23"),
        (fm.TransverselyIsotropic(30.0, 2.0, 0.3, 0.5, 0.9), "E_along E_across G_along"),
    ],
    ids=lambda own: type(own).__name__,
)
def test_moduli_have_the_unit_of_stress(law, moduli):
    shape, units = fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=5.0), fm.Units()
    strip = fm.Mechanism("strip").flexible("strip", shape, fm.Material("own", law=law))
    found = [name for name in law.constants if fm.LawParameter(name, strip).unit(units) == units.stress]
    assert found == moduli.split()


def test_files_of_lengths_in_another_unit_are_warned_of(tmp_path, caplog):
    scene, strip, push = cantilever()
    targets = [fm.Target(push, force=2.0, displacement=1.0)]
    for unit in ("mm", "cm"):
        sim = fm.Simulation(replace(scene, units=fm.Units(length=unit)), space="plane-stress", size=3.0)
        problem = fm.DesignProblem(sim, [fm.Number(fm.Depth(strip), 3.0, 9.0)], targets=targets)
        problem.export(tmp_path, problem.initial)
        assert ("scale them" in caplog.text) == (unit == "cm")
