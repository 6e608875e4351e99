"""The error of plane stress is estimated within a factor of two, and in the right direction."""

from __future__ import annotations

from math import cos, cosh, pi, sin, sinh, sqrt

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..design.test_edges import OPTIMUM
from ..simulation.demo_scenes import demo
from ..simulation.refined import cantilever


@pytest.mark.thorough
def test_estimate_is_near_what_space_adds():
    scene, push, load = cantilever()
    flat = fm.Simulation(scene, space="plane-stress", order=3, size=5.0)
    curve = flat.load_displacement(push, forces=[0.5 * load, load])
    deep = fm.Simulation(scene, space="3d-symmetric", order=3, size=7.5, layers=1)
    there = deep.load_displacement(push, forces=[0.5 * load, load])
    added = there.displacements[-1] + there.error_estimates()[-1] - curve.displacements[-1]
    assert added < 0.0
    assert 0.5 < curve.modelling_errors()[-1] / added < 2.0


def strip(
    depth: float,
    length: float,
    turn: float = 0.0,
    poisson: float = 0.4,
    pinned: bool = False,
    law: fm.Law | None = None,
):
    """A link of thickness 1 that opens by ``turn``, a force that bends it, and the load EI / L² of a cantilever.

    Its ends are clamped to the wall and to a hand that is pushed across; or they are pinned, and the hand slides.
    """
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    angles = np.linspace(0.0, turn, 9 if turn else 2)
    points = [(0.0, 0.0), (length, 0.0)]
    if turn:
        points = [(length / turn * sin(angle), length / turn * (1.0 - cos(angle))) for angle in angles]
    link = rig.flexible(
        "link",
        fm.strip(points, thickness=1.0, depth=depth),
        fm.Material("plastic", law=law or fm.NeoHookean(1000.0, poisson)),
    )
    if pinned:
        rig.prismatic(wall, hand, at=points[-1], axis=(1, 0, 0))
        rig.revolute(wall, link, at=points[0], interface_radius=1.0)
        rig.revolute(link, hand, at=points[-1], interface_radius=1.0)
    else:
        rig.clamp(wall, link, end="start", length=0.05 * length)
        rig.clamp(hand, link, end="end", length=0.05 * length)
    across = (-1.0, 0.0) if pinned else (-sin(turn), cos(turn))
    push = rig.force(on=hand, at=points[-1], direction=across)
    return fm.Scene(rig), push, 1000.0 * depth / 12.0 / length**2


def bent_by_a_couple(radius: float, opening: float, depth: float, poisson: float):
    """A curved link of thickness 1, clamped to a wall and to a hand that two opposite forces turn, and these forces."""
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    points = [(radius * sin(angle), radius * (1.0 - cos(angle))) for angle in np.linspace(0.0, opening, 9)]
    link = rig.flexible("link", fm.strip(points, thickness=1.0, depth=depth), fm.Material("plastic", 1000.0, poisson))
    rig.clamp(wall, link, end="start", length=3.0)
    rig.clamp(hand, link, end="end", length=3.0)
    (x, y), pair = points[-1], {}
    for sense in (1.0, -1.0):
        pair[rig.force(on=hand, at=(x + sense, y), direction=(0.0, sense), name=f"force {sense:+g}")] = 1.0
    return fm.Scene(rig), fm.ForceGroup("couple", pair)


def estimate_over_true(flat: fm.Simulation, deep: fm.Simulation, push, forces) -> np.ndarray:
    """Estimates over what space adds, at each force."""
    curve, there = (simulation.load_displacement(push, forces=forces) for simulation in (flat, deep))
    added = there.displacements + there.error_estimates() - curve.displacements - curve.error_estimates()
    return curve.modelling_errors() / added


WIDE = [(10.0, 30.0, 0.5 * pi), (30.0, 10.0, 0.0)]


@pytest.mark.parametrize(("depth", "length", "turn"), WIDE)
def test_estimate_finds_how_much_stiffer_wide_thin_strips_are_in_space(depth, length, turn):
    scene, push, load = strip(depth, length, turn)
    flat = fm.Simulation(scene, space="plane-stress", size=2.0)
    deep = fm.Simulation(scene, space="3d-symmetric", size=2.0, layers=2)
    found = estimate_over_true(flat, deep, push, [0.05 * load, load])
    assert np.all((found > 0.5) & (found < 2.0))


@pytest.mark.thorough
@pytest.mark.parametrize("along", [(0.0, 1.0), (0.0, 0.0, 1.0)])
def test_estimate_finds_how_much_stiffer_wide_strips_of_fibres_are_in_space(along):
    scene, push, load = strip(10.0, 10.0, law=fm.TransverselyIsotropic(3000.0, 1000.0, 0.3, 0.5, 300.0, along=along))
    flat = fm.Simulation(scene, space="plane-stress", size=2.0)
    deep = fm.Simulation(scene, space="3d-symmetric", size=2.0, layers=2)
    found = estimate_over_true(flat, deep, push, [0.05 * load, load])
    assert np.all((found > 0.5) & (found < 2.0))


@pytest.mark.parallel
def test_any_number_of_ranks_estimates_the_same_of_fibres():
    scene, push, load = strip(10.0, 10.0, law=fm.TransverselyIsotropic(3000.0, 1000.0, 0.3, 0.5, 300.0, along=(1, 0)))
    alone, together = (
        fm.Simulation(scene, space="plane-stress", size=2.0, comm=comm)
        .load_displacement(push, forces=[load])
        .modelling_errors()
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert together == pytest.approx(alone, rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("length", "depth", "options"),
    [
        pytest.param(10.0, 1.0, {"poisson": 0.3}, id="short, narrow"),
        pytest.param(30.0, 10.0, {"turn": 0.5 * pi}, id="arc, wide"),
        pytest.param(30.0, 10.0, {"turn": pi / 3.0, "pinned": True}, id="pinned arc"),
    ],
)
def test_estimate_finds_how_much_stiffer_strips_of_all_depths_are_in_space(length, depth, options):
    scene, push, load = strip(depth, length, **options)
    loads = [factor * load for factor in ((0.05, 1.5) if "pinned" in options else (0.05, 3.0))]
    flat = fm.Simulation(scene, space="plane-stress", order=3, size=1.5)
    deep = fm.Simulation(scene, space="3d-symmetric", order=3, size=2.0, layers=2)
    found = estimate_over_true(flat, deep, push, loads)
    assert np.all((found > 0.5) & (found < 2.0))


@pytest.mark.parametrize(
    "effect",
    [lambda link: fm.Pressure(link, 5.0), lambda link: fm.Prestrain(link, 1.01)],
    ids=["pressure", "prestrain"],
)
def test_estimate_finds_how_far_effects_across_the_depth_push_in_space(effect):
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    link = rig.flexible("link", fm.strip([(0, 0), (10, 0)], thickness=1.0, depth=3.0), fm.Material("plastic", 1e3, 0.4))
    rig.clamp(wall, link, end="start", length=1.0)
    rig.clamp(hand, link, end="end", length=1.0)
    push = rig.force(on=hand, at=(10, 0), direction=(1, 0))
    scene = fm.Scene(rig, effects=[effect(link)])
    flat = fm.Simulation(scene, space="plane-stress", size=0.7)
    deep = fm.Simulation(scene, space="3d-symmetric", size=0.7, layers=2)
    found = estimate_over_true(flat, deep, push, [1e-6])
    assert np.all((found > 0.8) & (found < 1.25)), found


def swollen_strip(pressure: float, stretch: float, length: float):
    """A strip of thickness and depth 1 between clamps, E = 1000, ν = 0.4, and a force that pulls it."""
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    shape = fm.strip([(0, 0), (length, 0)], thickness=1.0, depth=1.0)
    link = rig.flexible("link", shape, fm.Material("plastic", 1e3, 0.4))
    rig.clamp(wall, link, end="start", length=1.0)
    rig.clamp(hand, link, end="end", length=1.0)
    pull = rig.force(on=hand, at=(length, 0), direction=(1, 0))
    effects = [fm.Prestrain(link, stretch), *([fm.Pressure(link, pressure)] if pressure else [])]
    return fm.Scene(rig, effects=effects), pull


def test_pressure_on_faces_of_a_swollen_link_lengthens_it_by_what_its_volume_at_rest_does():
    """Of a slender strip that swells by λ, by P L/E (λ ν − (1 − ν) (λ − 1)).

    Under pressure on all faces it shortens by λ (1 − 2 ν) P L/E, on those of the drawn depth alone by (1 − ν) P L/E.
    """
    pressure, stretch, poisson, errors = 1.0, 1.3, 0.4, []
    for load in (0.0, pressure):
        for length in (22.0, 42.0):
            scene, pull = swollen_strip(load, stretch, length)
            flat = fm.Simulation(scene, space="plane-stress", size=0.7)
            errors.append(flat.load_displacement(pull, forces=[1e-6]).modelling_errors()[0])
    # ends add the same to either length
    found = (errors[3] - errors[2]) - (errors[1] - errors[0])
    lengthened = pressure * 20.0 / 1e3 * (stretch * poisson - (1.0 - poisson) * (stretch - 1.0))
    assert found == pytest.approx(lengthened, rel=0.02)


@pytest.mark.parametrize("stretch", [0.7, 1.4])
def test_estimate_of_a_link_that_swells_much_counts_its_elastic_strain(stretch):
    scene, pull = swollen_strip(0.0, stretch, 12.0)
    flat = fm.Simulation(scene, space="plane-stress", size=0.35)
    deep = fm.Simulation(scene, space="3d-symmetric", size=0.35, layers=2)
    found = estimate_over_true(flat, deep, pull, [1e-6])
    assert np.all((found > 0.5) & (found < 2.0))


@pytest.mark.thorough
def test_estimate_finds_how_much_stiffer_the_designed_claw_is_in_space():
    script = demo("claw")
    scene, grasp, configurations = script.describe()
    flat = fm.Simulation(scene, space="plane-stress", size=script.QUICK)
    result = fm.DesignProblem(flat, **script.wanted(scene, grasp, configurations)).optimise()
    deep = fm.Simulation(scene, space="3d-symmetric", size=script.QUICK, layers=1)
    found = estimate_over_true(flat.with_design(result), deep.with_design(result), grasp, [4.0, 10.0])
    assert np.all((found > 0.5) & (found < 2.0))


@pytest.mark.thorough
def test_estimate_finds_how_much_stiffer_the_designed_truss_is_in_space_even_pulled_straight(tmp_path):
    script = demo("truss")
    scene, push, configurations = script.describe()
    (diagonal,) = scene.mechanism.flexible_links
    drawn = fm.Simulation(scene, space="plane-stress", size=script.QUICK)
    problem = fm.DesignProblem(drawn, **script.wanted(scene, push, configurations))
    problem.export(tmp_path, OPTIMUM)
    # of one outline: it has its full length at the last force, whose displacement that decides
    part = {diagonal: fm.step_file(tmp_path / "diagonal.step", depth=20.0)}
    flat = fm.Simulation(scene, space="plane-stress", size=script.QUICK).with_shapes(part)
    deep = fm.Simulation(scene, space="3d-symmetric", size=script.QUICK, layers=1).with_shapes(part)
    (found,) = estimate_over_true(flat, deep, push, [0.4])
    assert 0.8 < found < 1.25


@pytest.mark.parametrize("depth", [10.0, 20.0, 40.0])
def test_curved_strips_stiffen_from_beams_to_plates_as_in_closed_form(depth):
    radius, poisson, changes, turns = 100.0, 0.4, [], []
    for opening in (0.6, 1.2):
        scene, couple = bent_by_a_couple(radius, opening, depth, poisson)
        simulation = fm.Simulation(scene, space="plane-stress", size=2.0)
        curve = simulation.load_displacement(couple, forces=[1e-5 * depth])
        changes.append(curve.modelling_errors()[-1])
        turns.append(curve.displacements[-1])
    # the ends are the same in both
    found = (changes[1] - changes[0]) / (turns[1] - turns[0])
    searle = depth**2 / radius
    assert found == pytest.approx(-(poisson**2) * searle**2 / (60.0 + searle**2), rel=0.05)
    theta = (3.0 * (1.0 - poisson**2)) ** 0.25 * sqrt(searle)
    g = 2.0 / theta * (cosh(theta) - cos(theta)) / (sinh(theta) + sin(theta))
    assert 0.95 < found / (-(poisson**2) * (1.0 - g) / (1.0 - poisson**2 * g)) < 1.3


def test_blocking_all_contraction_is_plane_strain():
    scene, push, load = strip(1e4, 20.0)
    curves = [
        fm.Simulation(scene, space=space, size=2.0).load_displacement(push, forces=[1e-3 * load])
        for space in ("plane-stress", "plane-strain")
    ]
    free, blocked = (curve.displacements[-1] for curve in curves)
    # first order of a change of 16 %
    assert curves[0].modelling_errors()[-1] == pytest.approx(blocked - free, rel=0.2)


@pytest.mark.parallel
def test_estimate_is_the_same_on_any_number_of_processes():
    scene, push, load = cantilever()
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        simulation = fm.Simulation(scene, space="plane-stress", size=3.0, comm=comm)
        found.append(simulation.load_displacement(push, forces=[load]).modelling_errors()[-1])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_other_models_are_refused():
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-strain", size=3.0)
    curve = simulation.load_displacement(push, forces=[load])
    with pytest.raises(fm.DescriptionError, match="plane-strain"):
        curve.modelling_errors()


def test_both_kinds_of_error_need_one_factor_per_frame_once(monkeypatch):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    loads = [0.5 * load, load]
    apart, together = (simulation.load_displacement(push, forces=loads) for _ in range(2))
    one, other = apart.error_estimates(), apart.modelling_errors()
    newton, factored = type(simulation.solver(push)), []
    plain = newton.linearise
    monkeypatch.setattr(newton, "linearise", lambda *arguments: factored.append(arguments) or plain(*arguments))
    assert together.corrections == pytest.approx(one + other, rel=1e-10)
    assert together.corrected == pytest.approx(together.displacements + one + other, rel=1e-10)
    assert list(together.displacements) == [frame.displacement for frame in together.frames]
    assert list(together.error_estimates()) == pytest.approx(list(one), rel=1e-10)
    assert len(factored) == len(loads)


def test_errors_too_large_to_be_added_are_named(caplog):
    scene, push, load = strip(30.0, 10.0)
    curve = fm.Simulation(scene, space="plane-stress", size=2.0).load_displacement(push, forces=[0.05 * load])
    assert curve.corrections.tolist() == [0.0]
    assert "1 of 1 estimated errors" in caplog.text
    assert "3d" in caplog.text
