"""Accuracy control takes the cheapest level that it expects to do, climbs until the estimate agrees, and says so."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRESS, SPATIAL, MixedFormulation
from fenicsmech.estimates import AccuracyControl, AccuracyOptions, FidelityLevel, LevelErrors, Trial, fidelity_levels
from fenicsmech.files import read_csv

from ..simulation.demo_scenes import demo, describe
from ..simulation.five_problems import case
from ..simulation.refined import arch, cantilever


def control(accuracy: float, **changes) -> AccuracyControl:
    return AccuracyControl(cantilever()[0], accuracy, None, MixedFormulation(), **changes)


class Recorder:
    """Pretends to simulate: errors of elements shrink as the levels predict; that of plane stress is given."""

    def __init__(self, elements: float, plane_stress: float) -> None:
        self.elements, self.plane_stress, self.levels = elements, plane_stress, []

    def __call__(self, level) -> LevelErrors:
        self.levels.append(level)
        if level.model is PLANE_STRESS:
            return LevelErrors(10.0, 10.0 * self.elements * level.gain, 10.0 * self.plane_stress, 100)
        return LevelErrors(10.0, 10.0 * (self.elements + 0.55 * self.plane_stress) * level.gain, 0.0, 1000)


def test_the_pilot_is_taken_if_its_estimate_will_do():
    run = Recorder(0.01, 0.01)
    choice = control(0.05).choose(run)
    assert run.levels == fidelity_levels(PLANE_STRESS)[:1]
    assert choice.reached
    assert choice.chosen.error == pytest.approx(1.7 * 0.01 + 0.6 * 0.01)


def test_elements_are_refined_in_the_plane_as_long_as_they_are_what_is_wrong():
    run = Recorder(0.03, 0.001)
    assert control(0.01).choose(run).reached
    assert {level.model for level in run.levels} == {PLANE_STRESS}
    assert len(run.levels) == 2


@pytest.mark.parametrize("accuracy", [0.02, 0.01, 0.003, 0.001])
def test_errors_of_plane_stress_lead_to_space_without_detours(accuracy):
    run = Recorder(0.005, 0.03)
    assert control(accuracy).choose(run).reached
    assert run.levels[0].model is PLANE_STRESS
    assert {level.model for level in run.levels[1:]} == {MID_PLANE_SYMMETRIC}
    assert len(run.levels) <= 3


def test_the_finest_level_is_taken_and_reported_where_none_will_do(caplog):
    run = Recorder(0.5, 0.5)
    choice = control(1e-5).choose(run)
    assert not choice.reached
    assert run.levels[-1] == fidelity_levels(MID_PLANE_SYMMETRIC)[-1]
    assert "the finest there is" in str(choice)
    assert "error of the finest level" in caplog.text


def test_the_next_curve_starts_from_the_level_that_did():
    made = control(0.01)
    made.choose(Recorder(0.005, 0.03))
    run = Recorder(0.005, 0.03)
    made.choose(run)
    assert len(run.levels) == 1
    assert run.levels[0].model is MID_PLANE_SYMMETRIC


def test_finer_levels_predict_smaller_errors_and_more_work():
    for model in (PLANE_STRESS, MID_PLANE_SYMMETRIC, SPATIAL):
        levels = fidelity_levels(model)
        assert all(a.gain > b.gain and a.work < b.work for a, b in zip(levels[:-1], levels[1:], strict=True))


def test_choice_prints_what_was_tried_and_what_ten_times_the_accuracy_would_cost():
    choice = control(0.05).choose(Recorder(0.01, 0.01))
    text = str(choice)
    assert "chosen: plane stress P2" in text
    assert "ten times the accuracy: 3D symmetric" in text
    assert text.rstrip().endswith(" s")


@pytest.mark.thorough
def test_corrected_curves_are_as_accurate_as_requested(tmp_path):
    scene, push = describe("truss")[:2]
    forces = [0.2, 0.4]
    finest = fm.Simulation(scene, space="3d-symmetric", order=3, size=3.6, layers=2, segments=16)
    reference = finest.load_displacement(push, forces=forces).displacements[-1]
    for accuracy, model in ((0.05, PLANE_STRESS), (0.01, PLANE_STRESS), (0.005, MID_PLANE_SYMMETRIC)):
        simulation = fm.Simulation(scene, accuracy=accuracy)
        curve = simulation.load_displacement(push, forces=forces)
        assert simulation.choice.reached
        assert simulation.fidelity.model is model
        error, computed = (abs(value / reference - 1.0) for value in (curve.corrected[-1], curve.displacements[-1]))
        assert error < accuracy
        assert error < 0.5 * computed
    curve.write_csv(tmp_path / "curve.csv", errors=True)
    columns = read_csv(tmp_path / "curve.csv")
    assert columns["corrected displacement [mm]"] == pytest.approx(curve.displacements + curve.corrections)


def test_curve_that_fails_on_a_finer_level_leaves_no_answers_of_a_coarser_one(monkeypatch):
    scene, push = describe("claw")
    simulation, compute, computed = fm.Simulation(scene, accuracy=1e-4), fm.Simulation.compute, []

    def once(*arguments, **options):
        if computed:
            raise fm.EquilibriumError("the second level", "it fails", "Do not ask for it")
        computed.append(compute(*arguments, **options))
        return computed[0]

    monkeypatch.setattr(fm.Simulation, "compute", once)
    with pytest.raises(fm.EquilibriumError, match="second level"):
        simulation.load_displacement(push, forces=[1.0])
    assert computed and simulation.choice is None


def test_simulations_derived_from_a_choice_have_its_fidelity():
    scene, push, load = cantilever()
    (link,) = scene.mechanism.flexible_links
    simulation = fm.Simulation(scene, accuracy=0.02)
    curve = simulation.load_displacement(push, forces=[load])
    assert len(simulation.choice.trials) > 1  # not the pilot's
    nothing = np.zeros_like(simulation.model.elastic.shape.x.array)
    for derived in (
        simulation.with_design(nothing),
        simulation.with_material(link.material, link.material),
        simulation.with_shapes({link: link.shape}),
    ):
        assert derived.fidelity == simulation.fidelity
        again = derived.load_displacement(push, forces=[load])
        assert again.displacements == pytest.approx(curve.displacements, rel=1e-8)


def test_design_problems_keep_the_fidelity_chosen_before():
    scene, push, load = arch()
    (link,) = scene.mechanism.flexible_links
    simulation = fm.Simulation(scene, accuracy=0.02)
    simulation.load_displacement(push, forces=[0.01 * load])
    chosen = simulation.fidelity
    target = fm.Target(push, force=0.01 * load, displacement=0.01)
    problem = fm.DesignProblem(simulation, [fm.SplineDesign(link, 2)], targets=[target])
    drawn = problem.rest_shape(problem.initial)
    simulation.load_displacement(push, forces=[load])
    assert simulation.fidelity != chosen == problem.simulation.fidelity
    assert problem.simulation.with_design(drawn).fidelity == chosen


@pytest.mark.thorough
def test_forces_are_as_accurate_as_requested_where_displacements_are_prescribed():
    scene, push, load = cantilever()
    finest = fm.Simulation(scene, space="3d-symmetric", order=3, size=3.0, layers=2, segments=16)
    reference = finest.load_displacement(push, displacements=[5.0, 10.0]).forces[-1]
    simulation = fm.Simulation(scene, accuracy=0.02)
    curve = simulation.load_displacement(push, displacements=[5.0, 10.0])
    assert list(curve.displacements) == pytest.approx([5.0, 10.0])
    assert abs(curve.corrected[-1] / reference - 1.0) < 0.02
    assert curve.corrected[-1] != curve.forces[-1] == curve.frames[-1].force


def test_estimates_beyond_first_order_are_not_used_as_corrections():
    found = AccuracyOptions().corrections(np.array([0.01, -0.5, 0.02]), np.array([0.1, 0.5, 1.0]))
    assert found.tolist() == [0.01, 0.0, 0.02]


def test_links_from_step_files_are_measured_and_reach_the_accuracy_of_drawn_ones(tmp_path):
    scene, push = describe("truss")[:2]
    (diagonal,) = scene.mechanism.flexible_links
    drawn = fm.Simulation(scene, space="plane-stress", size=3.0)
    targets = [fm.Target(push, force=0.4, displacement=3.0)]
    problem = fm.DesignProblem(drawn, [fm.SplineDesign(diagonal, 3)], targets=targets)
    problem.export(tmp_path, problem.initial)
    again = demo("truss").describe(tmp_path / "diagonal.step")[0]
    (thrust,) = again.mechanism.forces
    sims = [fm.Simulation(own, accuracy=0.02) for own in (scene, again)]
    sizes = [sim.fidelity.size_text for sim in sims]
    assert float(sizes[1]) == pytest.approx(float(sizes[0]), rel=0.4)  # with the eyes, of the same order
    wanted, found = (
        sim.load_displacement(force, forces=[0.2, 0.4]).corrected
        for sim, force in zip(sims, (push, thrust), strict=True)
    )
    assert sims[1].choice.reached
    assert np.max(np.abs(found - wanted)) <= 2 * 0.02 * np.max(np.abs(wanted))  # either may be off by as much


@pytest.mark.slow
def test_errors_after_correction_are_within_their_bound():
    scene, push, load = case("arch")
    forces = [0.5 * load, load]
    *levels, finest = [*fidelity_levels(PLANE_STRESS), *fidelity_levels(MID_PLANE_SYMMETRIC)[:4]]
    simulation = _at(scene, finest)
    curve = simulation.load_displacement(push, forces=forces)
    reference = curve.displacements[-1] + curve.error_estimates()[-1]
    for level in levels:
        simulation = _at(scene, level)
        curve = simulation.load_displacement(push, forces=forces)
        elements, plane_stress = (errors[-1] / reference for errors in curve.errors_by_kind())
        left = curve.displacements[-1] / reference - 1.0 + elements + plane_stress
        assert abs(left) < Trial(level, elements, plane_stress, 0, 0.0).error


def _at(scene: fm.Scene, level: FidelityLevel) -> fm.Simulation:
    fidelity = AccuracyControl(scene, 1.0, None, MixedFormulation()).fidelity(level)
    return fm.Simulation(
        scene,
        space=fidelity.model.name,
        order=fidelity.order,
        size=fidelity.sizes,
        layers=fidelity.layers,
        segments=fidelity.segments,
    )


@pytest.mark.slow
def test_all_accuracies_are_kept_on_the_claw():
    scene, push = describe("claw")
    forces = [5.0, 10.0]
    finest = fm.Simulation(scene, space="3d-symmetric", order=3, size=3.0, layers=2, segments=24)
    curve = finest.load_displacement(push, forces=forces)
    reference = curve.displacements[-1] + curve.error_estimates()[-1]
    for accuracy in (0.05, 0.01, 0.002):
        simulation = fm.Simulation(scene, accuracy=accuracy)
        reached = simulation.load_displacement(push, forces=forces).corrected[-1]
        assert abs(reached / reference - 1.0) < accuracy


def test_invalid_accuracies_are_refused():
    scene = cantilever()[0]
    with pytest.raises(fm.DescriptionError, match="accuracy"):
        fm.Simulation(scene, accuracy=0.0)
    with pytest.raises(fm.DescriptionError, match="size"):
        fm.Simulation(scene)
