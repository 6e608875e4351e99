"""Optimisations that go on from a checkpoint: only from one of the same problem, and only if asked to."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm

from .mechanisms import Case, strained, truss

REACHABLE = ((0.1, 2.0), (0.4, 3.2))


@pytest.fixture(scope="module")
def after_one(tmp_path_factory) -> Path:
    """A checkpoint after one iteration, which tests leave as it is."""
    file = tmp_path_factory.mktemp("after one") / "checkpoint.json"
    truss((0.4, 1.8)).problem().optimise(optimiser=fm.LevenbergMarquardt(iterations=1), checkpoint=file)
    return file


def test_a_checkpoint_that_is_missing_or_not_requested_is_not_used(tmp_path):
    file = tmp_path / "checkpoint.json"
    missing = truss((0.4, 1.8)).problem().optimise(checkpoint=file, resume=True)
    assert file.exists()
    again = truss((0.4, 1.8)).problem().optimise(checkpoint=file)
    assert again.links == missing.links
    assert again.evaluations == missing.evaluations


def test_resuming_from_a_checkpoint_ends_where_one_run_does(tmp_path):
    file = tmp_path / "checkpoint.json"
    direct = truss(*REACHABLE).problem().optimise()
    first = truss(*REACHABLE).problem().optimise(optimiser=fm.LevenbergMarquardt(iterations=3), checkpoint=file)
    assert not first.converged
    resumed = truss(*REACHABLE).problem().optimise(checkpoint=file, resume=True)
    assert resumed.iterations == direct.iterations
    assert resumed.evaluations == direct.evaluations + 1
    assert resumed.objective == pytest.approx(direct.objective, rel=1e-6)
    assert resumed.links[0].parameters == pytest.approx(direct.links[0].parameters, abs=1e-5)


def soft_truss() -> Case:
    """The truss finger with a diagonal of another material."""
    case = truss((0.4, 1.8))
    mechanism = fm.Mechanism("truss finger")
    base = mechanism.rigid("base", fixed=True)
    left, right, tip = (mechanism.rigid(name) for name in ("left leg", "right leg", "tip"))
    soft = fm.Material("soft", 1.5, 0.45)
    diagonal = mechanism.flexible("diagonal", case.designs[0].link.shape, soft)
    for a, b, at in ((base, left, (0, 0)), (base, right, (40, 0)), (left, tip, (0, 60)), (right, tip, (40, 60))):
        mechanism.revolute(a, b, at=at)
    mechanism.revolute(base, diagonal, at=(0, 0), interface_radius=3.0)
    mechanism.revolute(diagonal, tip, at=(40, 60), interface_radius=3.0)
    push = mechanism.force(on=tip, at=(20, 70), direction=(1, 0), name="push on tip")
    return Case(
        fm.Scene(mechanism),
        [fm.SplineDesign(diagonal, 3, thickness=(1.5, 6.0))],
        [fm.Target(push, force=0.4, displacement=1.8)],
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("differs", "case", "options"),
    [
        ("targets", lambda: truss((0.4, 1.9)), {}),
        ("targets", lambda: truss((0.4, 1.8), (0.1, 1.0)), {}),
        ("sizes", lambda: truss((0.4, 1.8)), {"size": 2.9}),
        ("order", lambda: truss((0.4, 1.8)), {"order": 1}),
        ("space", lambda: truss((0.4, 1.8)), {"space": "plane-strain"}),
        ("regulariser", lambda: truss((0.4, 1.8)), {"regulariser": fm.StayClose()}),
        ("bounds", lambda: truss((0.4, 1.8), thickness=(1.5, 3.1)), {}),
        ("bounds", lambda: truss((0.4, 1.8), bend=0.05), {}),
        ("drawing", soft_truss, {}),
    ],
)
def test_checkpoints_of_another_problem_are_refused(differs, case, options, after_one):
    before = after_one.read_bytes()
    with pytest.raises(fm.DescriptionError, match=f"another problem.*{differs}"):
        case().problem(**options).optimise(checkpoint=after_one, resume=True)
    assert after_one.read_bytes() == before


@pytest.mark.thorough
def test_checkpoints_of_other_motor_positions_are_refused(tmp_path):
    file = tmp_path / "checkpoint.json"
    strained(1.0).problem().optimise(optimiser=fm.LevenbergMarquardt(iterations=1), checkpoint=file)
    with pytest.raises(fm.DescriptionError, match="another problem, with other targets"):
        strained(1.0, angle=0.09).problem().optimise(checkpoint=file, resume=True)


def test_checkpoints_of_another_optimiser_are_refused_but_not_those_of_other_limits(after_one, tmp_path):
    file = shutil.copy(after_one, tmp_path)
    with pytest.raises(fm.DescriptionError, match="optimiser"):
        truss((0.4, 1.8)).problem().optimise(optimiser=fm.BFGS(), checkpoint=file, resume=True)
    resumed = (
        truss((0.4, 1.8))
        .problem()
        .optimise(optimiser=fm.LevenbergMarquardt(iterations=5, tolerance=1e-2), checkpoint=file, resume=True)
    )
    assert resumed.iterations >= 1


@pytest.mark.thorough
def test_a_search_with_other_limits_does_not_return_what_those_before_led_to(tmp_path):
    problem, few = truss((0.4, 1.8)).problem(), fm.Scatter(starts=1, trial=1)
    problem.search(few, optimiser=fm.LevenbergMarquardt(iterations=1), checkpoint=tmp_path / "search")
    with pytest.raises(fm.DescriptionError, match="with other options of the optimiser"):
        more = fm.LevenbergMarquardt(iterations=3)
        problem.search(few, optimiser=more, checkpoint=tmp_path / "search", resume=True)


@dataclass(frozen=True)
class Pushed(fm.Effect):
    """Nothing, where a function says so."""

    where: Callable[[np.ndarray], np.ndarray]

    def explain(self) -> str:
        return "nothing"


def pulled(
    *, thickness: float = 3.0, depth: float = 5.0, E: float = 2000.0, arm: float = 20.0, **fidelity
) -> fm.DesignProblem:
    """A strip whose depth may change, and whose hand moves a rigid slide."""
    rig = fm.Mechanism("cantilever")
    wall, hand, slide = rig.rigid("wall", fixed=True), rig.rigid("hand"), rig.rigid("slide")
    shape = fm.strip([(0, 0), (40, 0)], thickness=thickness, depth=depth)
    strip = rig.flexible("strip", shape, fm.Material("plastic", E, 0.35))
    rig.clamp(wall, strip, end="start", length=5.0)
    rig.clamp(hand, strip, end="end", length=5.0)
    rig.revolute(hand, slide, at=(40, arm))
    rig.prismatic(wall, slide, at=(0, 30), axis=(1, 0))
    push = rig.force(on=hand, at=(40, 0), direction=(1, 0))
    scene = fm.Scene(rig, effects=[Pushed(lambda points: points[:, 0] > 0.0)])
    sim = fm.Simulation(scene, **{"space": "plane-stress", "size": 3.0} | fidelity)
    numbers = [fm.Number(fm.Depth(strip), 3.0, 9.0)]
    return fm.DesignProblem(sim, numbers, targets=[fm.Target(push, force=2.0, displacement=0.01)])


def test_checkpoints_of_the_same_words_with_other_numbers_are_refused(tmp_path):
    file, once = tmp_path / "checkpoint.json", fm.LevenbergMarquardt(iterations=1)
    pulled().optimise(optimiser=once, checkpoint=file)
    assert pulled().optimise(optimiser=once, checkpoint=file, resume=True).iterations == 1
    for differs, changes in (
        ("drawing", {"thickness": 2.9}),
        ("drawing", {"depth": 5.1}),
        ("drawing", {"E": 1990.0}),
        ("drawing", {"arm": 21.0}),
        ("elements", {"formulation": fm.DisplacementFormulation()}),
        ("elements", {"segments": 10}),
        ("elements", {"quadrature": fm.Quadrature.for_order(3, 2)}),
    ):
        with pytest.raises(fm.DescriptionError, match=f"another problem.*{differs}"):
            pulled(**changes).optimise(optimiser=once, checkpoint=file, resume=True)


def test_checkpoints_of_another_material_or_shape_of_the_simulation_are_refused(tmp_path):
    file, once, problem = tmp_path / "checkpoint.json", fm.LevenbergMarquardt(iterations=1), pulled()
    problem.optimise(optimiser=once, checkpoint=file)
    (strip,) = problem.simulation.scene.mechanism.flexible_links
    for differs, other in (
        ("materials", problem.simulation.with_material(strip.material, fm.Material("plastic", 1990.0, 0.35))),
        ("shapes", problem.simulation.with_shapes({strip: replace(strip.shape, thickness=2.9)})),
    ):
        with pytest.raises(fm.DescriptionError, match=f"another problem.*{differs}"):
            changed = fm.DesignProblem(other, problem.designs, targets=problem.targets)
            changed.optimise(optimiser=once, checkpoint=file, resume=True)
