"""Problems of scripts as projects: what comes back is the problem that was opened, with its curves."""

from __future__ import annotations

import json
import random
import runpy
from contextlib import suppress
from copy import deepcopy
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.live import (
    Refused,
    ServerOptions,
    Solver,
    draw,
    example,
    forces_of,
    live,
    project_of,
    read_project,
    script,
    solve_solid,
)

DEMOS = ("switch", "constant_force", "gripper", "suspension", "claw", "truss", "klann")


def reopened(problem, result=None):
    """The project of a problem after a trip through a file, and what is drawn from it."""
    project = read_project(json.loads(json.dumps(project_of(problem, result), allow_nan=False)))
    return project, draw(project)


def demo(name):
    """The problem of a demo with coarse elements."""
    module = import_module(f"demos.{name}")
    described = module.describe()
    sim = fm.Simulation(described[0], space="plane-stress", size=2.0 * module.QUICK, order=1)
    return fm.DesignProblem(sim, **module.wanted(*described))


@pytest.mark.parametrize(
    "name", [name if name == "switch" else pytest.param(name, marks=pytest.mark.thorough) for name in DEMOS]
)
def test_the_problem_of_a_demo_is_opened_with_its_targets_and_its_curves(name):
    problem = demo(name)
    project, drawing = reopened(problem)
    again = drawing.problem(project)
    assert {target.name: target for target in again.targets} == {target.name: target for target in problem.targets}
    assert list(map(str, again.designs)) == list(map(str, problem.designs))
    for number, curve in enumerate(project["curves"]):
        sample = next(
            target.sample
            for target in problem.targets
            if target.sample is not None
            and target.sample.value * curve["largest"] > 0.0
            and {motor.name: at for motor, at in target.sample.configuration.positions} == curve["positions"]
        )
        begin = forces_of(project, number)[:3]
        given = {"displacements" if sample.moved else "forces": begin}
        expected = problem.simulation.load_displacement(sample.part, configuration=sample.configuration, **given)
        found = drawing.simulation.compute(drawing.request(project, number, begin))
        for own in ("forces", "displacements"):
            scale = np.abs(getattr(expected, own)).max()
            assert np.abs(getattr(found, own) - getattr(expected, own)).max() < 1e-9 * scale


def test_links_have_the_shapes_and_materials_of_the_simulation():
    mechanism, soft, stiff = fm.Mechanism("leaf spring"), fm.Material("soft", 1e3, 0.3), fm.Material("stiff", 3e3, 0.35)
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    leaf = mechanism.flexible("leaf", fm.strip([(0, 0), (40, 0)], thickness=2.0, depth=8.0), soft)
    mechanism.clamp(base, leaf, end="start", length=3.0)
    mechanism.clamp(hand, leaf, end="end", length=3.0)
    push = mechanism.force(on=hand, at=(40, 0), direction=(0, 1), name="push")
    drawn = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=4.0, order=1)
    bent = fm.strip([(0, 0), (20, 3), (40, 0)], thickness=3.0, depth=8.0)
    simulation = drawn.with_shapes({leaf: bent}).with_material(soft, stiff)
    problem = fm.DesignProblem(
        simulation, [fm.SplineDesign(leaf, segments=2)], targets=[fm.Target(push, force=1, displacement=2)]
    )
    project, drawing = reopened(problem)
    assert drawing.problem(project).simulation.materials.popitem()[1].law == stiff.law
    expected = simulation.load_displacement(push, forces=[1.0]).displacements
    found = drawing.simulation.compute(drawing.request(project, 0, [1.0])).displacements
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_problem_whose_target_is_in_space_stays_there():
    module = import_module("demos.truss")
    scene, push, _ = module.describe()
    (diagonal,) = scene.mechanism.flexible_links
    sim, sample = fm.Simulation(scene, space="3d", size=2.0 * module.QUICK, order=1), fm.Sample({push: 0.1})
    aside = fm.Target(fm.Displacement(diagonal, at=(18, 34)), sample, equals=(1.0, -1.0, 0.0))
    along = fm.Target(push, force=0.1, displacement=2.0)
    spaces = [
        reopened(fm.DesignProblem(sim, [fm.SplineDesign(diagonal, 3)], targets=targets))[0]["simulation"]["space"]
        for targets in ([along, aside], [along])
    ]
    assert spaces == ["3d", "plane-stress"]


def test_a_target_of_zero_keeps_the_scale_that_its_problem_gives_it():
    module = import_module("demos.truss")
    scene, push, _ = module.describe()
    (diagonal,) = scene.mechanism.flexible_links
    sim = fm.Simulation(scene, space="plane-stress", size=2.0 * module.QUICK, order=1)
    targets = [fm.Target(push, force=0.1, displacement=0.0), fm.Target(push, force=0.4, displacement=9.0)]
    project, drawing = reopened(fm.DesignProblem(sim, [fm.SplineDesign(diagonal, 3)], targets=targets))
    assert [own["scale"] for own in project["targets"] if own["displacement"] == 0.0] == pytest.approx([0.9])
    assert drawing.problem(project).targets[0].scale == pytest.approx(0.9)


def test_a_problem_of_a_script_is_the_project_that_describes_it():
    drawn = example("truss-finger")
    finger = fm.Mechanism("truss finger")
    base = finger.rigid("base", fixed=True)
    left, right, tip = (finger.rigid(name) for name in ("left leg", "right leg", "tip"))
    shape = fm.strip([(0, 0), (18, 34), (40, 60)], thickness=3.0, depth=20.0)
    diagonal = finger.flexible("diagonal", shape, fm.SMOOTH_SIL_950)
    for (a, b), at, name in (
        ((base, left), (0, 0), "foot of left leg"),
        ((base, right), (40, 0), "foot of right leg"),
        ((left, tip), (0, 60), "head of left leg"),
        ((right, tip), (40, 60), "head of right leg"),
    ):
        finger.revolute(a, b, at=at, name=name)
    finger.revolute(base, diagonal, at=(0, 0), interface_radius=3.0, name="foot of diagonal")
    finger.revolute(diagonal, tip, at=(40, 60), interface_radius=3.0, name="head of diagonal")
    push = finger.force(on=tip, at=(20, 70), direction=(1, 0), name="push on tip")
    sim = fm.Simulation(fm.Scene(finger), space="3d", size=3.0)
    targets = [fm.Target(push, force=0.1, displacement=6.0), fm.Target(push, force=0.4, displacement=9.0)]
    problem = fm.DesignProblem(sim, [fm.SplineDesign(diagonal, segments=3, thickness=(1.5, 6.0))], targets=targets)
    assert project_of(problem) == drawn | {"design": None}


def many():
    """A problem with much that the page cannot edit: effects, laws, outlines, regions, requirements, numbers."""
    made = fm.Mechanism("everything")
    ground, slide, cart = made.rigid("ground", fixed=True), made.rigid("slide", fixed=True), made.rigid("cart")
    rubber = fm.Material("rubber", law=fm.Yeoh(1.0, 0.1, 0.0, nu=0.45), density=1e-9, expansion=1e-4)
    steel = fm.Material("steel", 2e5, 0.3, density=7.8e-9, expansion=1e-5, strength=fm.Strength(yield_stress=300.0))
    bow = fm.outline((0, 0), [fm.Line((30, 0)), fm.Arc((32, 2), (30, 4)), fm.Line((0, 4)), fm.Line((0, 0))], depth=5.0)
    soft = made.flexible("soft", bow, rubber)
    leaf, twin = (
        made.flexible(name, fm.strip([(0, y), (30, y)], thickness=2.0, depth=5.0), steel)
        for name, y in (("leaf", 10), ("twin", 20))
    )
    made.weld(ground, soft, at=(1, 2), region=fm.Rectangle(2.0, 4.0))
    made.revolute(soft, cart, at=(29, 2), interface_radius=1.0)
    pins = [made.revolute(ground, link, at=(0, y), interface_radius=2.0) for link, y in ((leaf, 10), (twin, 20))]
    for link, y in ((leaf, 10), (twin, 20)):
        made.weld(link, cart, at=(30, y), interface_radius=2.0)
    rail = made.prismatic(slide, cart, at=(40, 10), axis=(3, 4))
    spring = fm.JointSpring(rail, 3.0, rest=0.5)
    motor = made.motor(pins[0], name="motor")
    push = made.force(on=cart, at=(40, 10), direction=(1, 0), name="push")
    spread = made.force(on=leaf, at=(15, 10), direction=(0, -1), region=fm.Disc(1.0), name="spread")
    tip = made.output(on=twin, at=(15, 20), direction=(0, 1), name="tip")
    effects = [
        fm.Gravity((0, -9810), masses={cart: fm.Mass(1e-5, at=(40, 10))}),
        spring,
        fm.JointCompliance(pins[1], 1e-4),
        fm.Pressure(soft, 0.01),
        fm.Prestrain(leaf, 1.001),
        fm.Temperature({leaf: 20.0, twin: 10.0}),
        fm.Contact(twin, fm.HalfPlane((0, 30), (0, -1))),
        fm.Contact(cart, fm.Cylinder((60, 10), 3.0), stiffness=10.0, points=[(45, 10)]),
    ]
    sizes = {soft: 2.0, leaf: 1.0, twin: 1.0}
    formulation = fm.DisplacementFormulation()
    sim = fm.Simulation(
        fm.Scene(made, effects), space="plane-strain", size=sizes, order=1, segments=10, formulation=formulation
    )
    turned = sim.scene.configuration("turned", {motor: 0.1})
    grasp, held = fm.Sample({push: 2.0, spread: 1.0}, turned), fm.Sample({push: fm.at(0.5), spread: 1.0})
    designs = [
        fm.SplineDesign(leaf, 3, thickness=(1.0, 4.0), bend=0.07, same=twin),
        fm.Number(fm.SpringStiffness(spring), 1.0, 9.0),
        fm.Number(fm.LawParameter("C1", soft), 0.5, 2.0),
        fm.Number(fm.Depth(soft), 2.0, 9.0),
        fm.Number(fm.MotorOffset(motor), -0.2, 0.2),
    ]
    targets = [
        fm.Target(fm.Displacement(cart, at=(40, 10)), grasp, equals=(1.0, 0.2), weight=3.0),
        fm.Target(fm.Displacement(tip), grasp, at_most=0.4),
        fm.Target(fm.Rotation(leaf, joint=pins[0]), held, at_least=0.01),
        fm.Target(fm.ForceMagnitude(push), held, equals=0.0, scale=2.0),
        fm.Target(fm.MotorTorque(motor), grasp, at_most=30.0),
        fm.Target(fm.Magnitude(fm.JointForce(rail)), grasp, at_most=9.0),
        fm.Target(fm.LargestStress([leaf, twin], margin=1.0), grasp, at_most=250.0),
        fm.Target(fm.LeastThickness(leaf), at_least=1.2),
        fm.Target(fm.LinkMass([leaf, soft]), least=True),
        fm.Target(push, force=1.5, displacement=0.3),
    ]
    regulariser = fm.MeshQuality(limit=20.0) + fm.ShapeBounds() + fm.NumberBounds() + 1e-3 * fm.StayClose()
    return fm.DesignProblem(sim, designs, targets=targets, regulariser=regulariser)


def same(found, given):
    """Whether two problems are described alike."""
    assert sorted(map(repr, found.targets)) == sorted(map(repr, given.targets))
    assert found.designs == given.designs and found.regulariser == given.regulariser
    scenes = found.simulation.scene, given.simulation.scene
    for parts in ("links", "joints", "motors", "forces", "outputs"):
        assert getattr(scenes[0].mechanism, parts) == getattr(scenes[1].mechanism, parts)
    assert [own.explain() for own in scenes[0].effects] == [own.explain() for own in scenes[1].effects]
    assert scenes[0].effects[1:] == scenes[1].effects[1:] and scenes[0].effects[0].masses == scenes[1].effects[0].masses
    assert found.simulation.fidelity == given.simulation.fidelity


def test_what_the_page_cannot_edit_is_carried_through_project_and_script(tmp_path, monkeypatch):
    problem = many()
    project, drawing = reopened(problem)
    same(drawing.problem(project), problem)
    described, _, _ = script(project).partition("\n\ncurve_0 = ")
    (tmp_path / "design.py").write_text(described)
    same(runpy.run_path(str(tmp_path / "design.py"))["problem"], problem)


STRANGE = [None, True, -1, 1e300, "x", "", [], {}, {"is": "Target"}, {"part": "links", "name": "leaf"}, {"pairs": []}]


def places(data, path=()):
    """The paths of all values in plain data."""
    yield path
    for key in data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        yield from places(data[key], (*path, key))


@pytest.mark.thorough
def test_a_project_that_is_changed_anyhow_is_refused_or_has_a_script():
    base, rng, read = project_of(many()), random.Random(0), 0
    for _ in range(400):
        project = deepcopy(base)
        *way, last = rng.choice([path for path in places(project) if path])
        at = project
        for step in way:
            at = at[step]
        at[last] = deepcopy(rng.choice(STRANGE))
        with suppress(Refused):
            compile(script(read_project(project)), "script", "exec")
            read += 1
    assert 10 < read < 200


def test_targets_where_displacements_are_held_are_points_of_the_curve_that_the_page_moves():
    problem = demo("switch")
    project, drawing = reopened(problem)
    assert "requirements" not in project and project["curves"][0]["held"]
    assert [(own["displacement"], own["force"]) for own in project["targets"]] == [(3.4, 1.0), (15.0, 0.0)]
    project["targets"][0] |= {"displacement": 4.0, "force": 0.8}
    moved, other = drawing.problem(read_project(project)).targets
    force = moved.sample.part
    assert moved == fm.Target(fm.ForceMagnitude(force), fm.Sample({force: fm.at(4.0)}), equals=0.8, weight=10.0)
    assert other == problem.targets[1] and 4.0 in forces_of(project, 0)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"displacement": -3.0}, id="against the curve"),
        pytest.param({"displacement": 0.0}, id="at its begin"),
        pytest.param({"scale": 0.0}, id="no scale"),
        pytest.param({"scale": "1"}, id="a scale in words"),
        pytest.param({"kind": "held"}, id="an entry that is none"),
    ],
)
def test_a_target_where_displacements_are_held_is_refused_where_it_means_nothing(change):
    project = project_of(demo("switch"))
    project["targets"][0] |= change
    with pytest.raises(Refused):
        read_project(project)


def test_zero_is_wanted_of_a_force_with_a_scale_alone():
    project = project_of(demo("switch"))
    del project["targets"][1]["scale"]
    with pytest.raises(Refused, match="zero, to which no error is relative"):
        read_project(project)


def ball():
    """A problem with joints that only space has."""
    made = fm.Mechanism("ball")
    ground, rod = made.rigid("ground", fixed=True), made.rigid("rod")
    beam = made.flexible("beam", fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=4.0), fm.ONYX)
    made.weld(ground, beam, at=(2, 0), region=fm.Rectangle(4.0, 3.0))
    made.spherical(beam, rod, at=(38, 0, 0), interface_radius=1.0)
    made.universal(rod, ground, at=(38, 20, 5), axis=(0, 1, 0))
    push = made.force(on=beam, at=(20, 0, 1), direction=(0, 0, 1), name="push")
    sim = fm.Simulation(fm.Scene(made), space="3d", size=3.0, order=1, layers=2)
    targets = [fm.Target(push, force=0.1, displacement=0.2)]
    return fm.DesignProblem(sim, [fm.SplineDesign(beam, 1)], targets=targets)


def test_joints_that_only_space_has_keep_the_project_in_space():
    problem = ball()
    project, drawing = reopened(problem)
    found, given = drawing.simulation, problem.simulation
    assert project["simulation"]["space"] == "3d" and found.fidelity == given.fidelity
    assert found.scene.mechanism.joints == given.scene.mechanism.joints
    assert found.scene.mechanism.forces == given.scene.mechanism.forces


@pytest.mark.thorough
def test_a_project_in_space_is_solved_and_drawn_there_and_not_once_more_as_a_solid():
    project, drawing = reopened(ball())
    project["curves"][0]["steps"] = 2
    events, solid = [], []
    Solver(events.append).run({"task": 1, "kind": "solve", "project": project, "fit": False})
    (curve,) = (event for event in events if event["event"] == "curve")
    found = drawing.simulation.compute(drawing.request(project, 0, forces_of(project, 0)))
    assert [point["displacement"] for point in curve["points"]] == pytest.approx(found.displacements, rel=1e-5)
    assert all(len(point["nodes"][0]) > 100 for point in curve["points"])
    solve_solid(project, 0, solid.append)
    assert solid[0]["state"] == "failed" and "in space already" in solid[0]["problem"]


@pytest.mark.thorough
def test_a_link_from_a_file_takes_its_file_along(tmp_path):
    module = import_module("demos.truss")
    described = module.describe(Path("meshes/diagonal.step"))
    sim = fm.Simulation(described[0], space="plane-stress", size=3.0, order=1)
    project, drawing = reopened(fm.DesignProblem(sim, **module.wanted(*described)))
    assert "/" not in json.dumps([own.get("shape", {}).get("name", "") for own in project["links"]])
    (own,) = drawing.simulation.scene.mechanism.flexible_links
    assert own.shape.path.read_bytes() == Path("meshes/diagonal.step").read_bytes()
    with pytest.raises(fm.DescriptionError, match="elements of 0.1 mm, not at most"):
        draw({**project, "simulation": {**project["simulation"], "size": 0.1}})
    assert 'fm.step_file(Path("part_diagonal.step")' in script(project).replace("'", '"')


@pytest.mark.parametrize(
    ("change", "reason", "remedy"),
    [
        pytest.param({"where": lambda x: x[:, 0] < 1.0}, "a function", "without functions", id="a predicate"),
        pytest.param({"units": fm.Units("m", "N", "Pa")}, "units", "in mm and N", id="other units"),
        pytest.param({"rest": True}, "no force acts", "under a force", id="no force"),
    ],
)
def test_what_has_no_plain_data_is_refused_by_name(change, reason, remedy):
    made = fm.Mechanism("beam")
    ground = made.rigid("ground", fixed=True)
    beam = made.flexible(
        "beam", fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=4.0), fm.Material("nylon", 1770.0, 0.42)
    )
    made.weld(ground, beam, at=(0, 0), interface_radius=1.0)
    push = made.force(on=beam, at=(40, 0), direction=(0, 1))
    effects = [fm.Pressure(beam, 0.1, where=change["where"], about=(0.0, 0.0))] if "where" in change else []
    scene = fm.Scene(made, effects, **({"units": change["units"]} if "units" in change else {}))
    target = fm.Target(push, force=0.1, displacement=0.2)
    if "rest" in change:
        target = fm.Target(fm.LinkVolume(beam), at_most=1e3)
    sim = fm.Simulation(scene, space="plane-stress", size=2.0)
    problem = fm.DesignProblem(sim, [fm.SplineDesign(beam, 2)], targets=[target])
    with pytest.raises(fm.DescriptionError, match=reason) as refused:
        project_of(problem)
    assert refused.value.part == "live page of 'beam'" and remedy in refused.value.remedy


def test_a_result_is_opened_with_a_problem_alone():
    with pytest.raises(fm.DescriptionError, match="with a project"):
        live(example("truss-finger"), result=object())


def test_a_port_is_given_once():
    with pytest.raises(fm.DescriptionError, match="beside the options"):
        live(example("truss-finger"), port=8000, options=ServerOptions())


@pytest.mark.parametrize(
    "data",
    [
        {"is": "system"},
        {"is": "Path", "path": "/"},
        {"is": "Target", "quantity": {"is": "LinkMass", "nothing": 1}, "at_most": 1.0},
        {"is": "Target", "quantity": {"is": "LinkMass", "links": {"part": "links", "name": "nobody"}}, "at_most": 1.0},
        {"is": "Target", "quantity": {"is": "LinkMass", "links": {"part": "files", "name": "tip"}}, "at_most": 1.0},
        {"is": "Target", "quantity": {"pairs": [[1, 2]]}, "at_most": 1.0},
        {"is": "Target", "quantity": {"is": ["LinkMass"]}, "at_most": 1.0},
        {"is": "Target", "quantity": [[[[[[[[[[[[1]]]]]]]]]]]], "at_most": 1.0},
        {"is": "Target", "quantity": {"is": "LinkMass"}, "at_most": float("inf")},
    ],
)
def test_plain_data_make_nothing_but_what_a_project_may_have(data):
    project = example("truss-finger") | {"requirements": [{"name": "strange", "data": data}]}
    with pytest.raises(Refused):
        read_project(project)


@pytest.mark.thorough
def test_an_optimised_design_is_opened_and_its_script_computes_its_curve(tmp_path, monkeypatch):
    problem = demo("switch")
    result = problem.optimise()
    project, drawing = reopened(problem, result)
    begin = forces_of(project, 0)
    finger = problem.simulation.scene.mechanism.forces[0]
    expected = problem.simulation.with_design(result).load_displacement(finger, displacements=begin)
    events = []
    Solver(events.append).run({"task": 1, "kind": "solve", "project": project, "fit": False})
    (curve,) = (event for event in events if event["event"] == "curve")
    scale = np.abs(expected.forces).max()
    assert [point["force"] for point in curve["points"]] == pytest.approx(expected.forces, abs=1e-5 * scale)
    (estimated,) = (event for event in events if event["event"] == "errors")
    corrected = {
        point["displacement"]: point["force"] + error
        for point, error in zip(curve["points"], estimated["errors"], strict=True)
    }
    found = [corrected[target["displacement"]] for target in project["targets"]]
    assert found == pytest.approx([target.corrected for target in result.targets], abs=1e-4)
    (tmp_path / "design.py").write_text(script(project))
    monkeypatch.chdir(tmp_path)
    found = runpy.run_path("design.py")["curve_0"]
    assert np.abs(found.forces - expected.forces).max() < 1e-9 * scale
