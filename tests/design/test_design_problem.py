"""Design problems: targets that can be reached and targets that cannot, what a result holds, any number of ranks."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import group_count

from .mechanisms import PLASTIC, Case, bow, strained, truss
from .refusal import refused

REACHABLE = ((0.1, 2.0), (0.4, 3.2))


@pytest.fixture(scope="module")
def reached() -> tuple[fm.DesignProblem, fm.DesignResult]:
    """The truss finger, optimised for targets that can be reached."""
    whole = truss(*REACHABLE).problem()
    return whole, whole.optimise()


def test_targets_are_reached(reached):
    whole, result = reached
    assert result.converged
    assert result.worst_error < 0.01
    for target, wanted in zip(result.targets, REACHABLE, strict=True):
        assert (target.force, target.wanted) == wanted
        assert target.corrected == pytest.approx(target.reached + target.finer_elements_add, rel=1e-12)
        assert target.corrected == pytest.approx(target.wanted, rel=0.002)
        assert target.error == pytest.approx(target.corrected / target.wanted - 1.0)
        assert abs(target.started - target.wanted) > 0.2 * target.wanted
    assert result.objective[1] < 1e-3 * result.objective[0]
    assert result.active == ()
    assert (result.processes, result.groups) == (1, 1)
    assert result.mesh_ratio_max == pytest.approx(whole.simulation.with_design(result).mesh_ratio_max)
    assert sum(result.phases.values()) <= result.seconds


def test_the_simulation_stays_as_it_was_and_gives_one_of_the_best_shape(reached):
    whole, result = reached
    push = whole.targets[0].quantity.part
    drawn = truss(*REACHABLE).problem()
    stays, fresh = (
        problem.simulation.load_displacement(problem.targets[0].quantity.part, forces=[0.1, 0.4])
        for problem in (whole, drawn)
    )
    assert stays.displacements == pytest.approx(fresh.displacements, rel=1e-10)
    curve = whole.simulation.with_design(result).load_displacement(push, forces=[0.1, 0.4])
    assert curve.displacements == pytest.approx([target.reached for target in result.targets], rel=1e-8)


def test_a_result_says_what_its_links_look_like(reached):
    whole, result = reached
    (link,) = result.links
    assert link.name == "diagonal"
    assert len(link.parameters) == result.parameters == len(whole.initial)
    controls = np.array(link.controls)
    assert controls.shape == (4, 2, 3)
    assert controls[[0, -1], 0] == pytest.approx(np.array([(0, 0, 1), (40, 60, 1)]))
    least, most = result.thickness
    assert 1.5 < least <= 3.0 <= most < 6.0
    assert 0.0 < link.bend < 0.08


@pytest.mark.parametrize("route", ["result", "file", "parameters"])
def test_applying_a_result_restores_its_shape(reached, route, tmp_path):
    _, result = reached
    fresh = truss(*REACHABLE).problem()
    push = fresh.targets[0].quantity.part
    expected = [target.reached for target in result.targets]
    given = result
    if route == "file":
        result.save(tmp_path / "design.json")
        given = fm.DesignResult.load(tmp_path / "design.json")
    elif route == "parameters":
        given = fresh.rest_shape(np.array(result.links[0].parameters))
    drawn = fresh.simulation.load_displacement(push, forces=[0.1, 0.4]).displacements
    again = fresh.simulation.with_design(given).load_displacement(push, forces=[0.1, 0.4]).displacements
    # parameters alone do not tell which of several good handle positions was found on the way
    assert again == pytest.approx(expected, rel=1e-10 if route != "parameters" else 1e-2)
    assert np.abs(again - drawn).min() > 0.1 * drawn.min()


def test_the_drawn_shape_is_the_initial_design(reached):
    whole = truss(*REACHABLE).problem()
    push = whole.targets[0].quantity.part
    drawn = whole.simulation.load_displacement(push, forces=[0.4]).displacements
    initial = whole.simulation.with_design(whole.rest_shape(whole.initial))
    # as drawn up to how the spline follows the centreline, and better placed handles
    assert initial.load_displacement(push, forces=[0.4]).displacements == pytest.approx(drawn, rel=0.03)
    assert reached[1].targets[1].started == pytest.approx(drawn[0], rel=0.03)


def test_simulations_of_another_design_are_refused(reached):
    whole, result = reached
    changed = whole.simulation.with_design(result)
    for describe in (
        lambda: fm.DesignProblem(changed, whole.designs, targets=whole.targets),
        lambda: whole.optimise(surrogate=changed),
    ):
        refused(describe, part="design problem", problem="another design", remedy="start=result")


@pytest.mark.thorough
def test_an_unreachable_target_ends_with_the_best_design_and_says_what_holds_it_back():
    result = truss((0.4, 0.05), thickness=(2.0, 3.5)).problem(size=4.0).optimise()
    (target,) = result.targets
    assert target.wanted < target.reached < target.started
    assert target.error == pytest.approx(target.corrected / 0.05 - 1.0)
    assert result.worst_error > 1.0
    assert "largest thickness 3.5 of 'diagonal'" in result.active
    assert 3.4 < result.thickness[1] < 3.55
    assert result.objective[1] < 0.5 * result.objective[0]
    # wider bounds lead closer to it
    wider = truss((0.4, 0.05), thickness=(2.0, 4.5)).problem(size=4.0).optimise()
    assert wider.targets[0].reached < 0.9 * target.reached


def test_contradicting_targets_end_with_their_compromise():
    result = truss((0.4, 2.0), (0.4, 3.0)).problem().optimise(optimiser=fm.LevenbergMarquardt(tolerance=1e-6))
    # (u − 2) / 4 + (u − 3) / 9 = 0
    assert [target.corrected for target in result.targets] == pytest.approx([30.0 / 13.0] * 2, rel=1e-3)
    assert result.converged
    assert [target.error for target in result.targets] == pytest.approx([2.0 / 13.0, -3.0 / 13.0], abs=1e-3)


def test_weights_shift_the_compromise():
    case = truss((0.4, 2.0), (0.4, 3.0))
    push = case.targets[0].quantity.part
    wanted = [fm.Target(push, force=0.4, displacement=2.0), fm.Target(push, force=0.4, displacement=3.0, weight=9.0)]
    result = Case(case.scene, case.designs, wanted).problem().optimise(optimiser=fm.LevenbergMarquardt(tolerance=1e-6))
    # (u − 2) / 4 + 9 (u − 3) / 9 = 0
    assert result.targets[0].corrected == pytest.approx(2.8, rel=1e-3)


@pytest.mark.thorough
def test_the_optimum_found_from_a_coarser_one_is_the_same():
    exact, regulariser = fm.LevenbergMarquardt(tolerance=1e-10), fm.ShapeBounds() + 1e-2 * fm.StayClose()
    case = truss((0.4, 2.2))
    coarse = case.problem(regulariser=regulariser, size=4.0, order=1).optimise()
    on_mesh = {"optimiser": exact, "correction": fm.Correction(estimates=False)}
    direct = case.problem(regulariser=regulariser, size=2.5).optimise(**on_mesh)
    refined = case.problem(regulariser=regulariser, size=2.5).optimise(**on_mesh, start=coarse)
    assert direct.converged and refined.converged
    assert refined.objective[1] == pytest.approx(direct.objective[1], rel=1e-6)
    assert refined.objective[0] < 0.1 * direct.objective[0]
    assert refined.targets[0].started != pytest.approx(direct.targets[0].started, rel=1e-2)
    lengths = np.where(np.arange(18) % 3 == 2, 1.0, 3.0)
    assert refined.links[0].parameters / lengths == pytest.approx(direct.links[0].parameters / lengths, abs=1e-3)


def test_a_second_optimisation_of_a_problem_repeats_the_first():
    whole = truss((0.4, 1.8)).problem()
    first, second = whole.optimise(), whole.optimise()
    assert second.links == first.links
    assert second.objective == first.objective
    assert (second.iterations, second.evaluations) == (first.iterations, first.evaluations)


def test_a_bfgs_run_reaches_the_targets_too():
    result = truss((0.4, 1.8)).problem().optimise(optimiser=fm.BFGS(iterations=40, tolerance=1e-4))
    assert result.worst_error < 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("case", [bow(20.0, 60.0), strained(1.0, 3.0)], ids=["bow", "strained"])
def test_links_that_carry_their_force_themselves_or_are_strained_by_motors_can_be_designed(case):
    drawn = case.problem()
    (first, last) = case.targets
    curve = drawn.simulation.with_design(drawn.rest_shape(drawn.initial)).load_displacement(
        first.quantity.part,
        forces=[first.sample.magnitude, last.sample.magnitude],
        configuration=first.sample.configuration,
    )
    wanted = [
        fm.Target(t.quantity, t.sample, equals=1.3 * float(u))
        for t, u in zip(case.targets, curve.displacements, strict=True)
    ]
    result = Case(case.scene, case.designs, wanted).problem().optimise()
    assert result.worst_error < 0.01


@pytest.mark.parametrize("thickness", [(1.0, 2.9), (3.1, 5.0)])
def test_bounds_that_exclude_the_drawn_thickness_are_refused(thickness):
    whole = truss(*REACHABLE, thickness=thickness).problem()
    refused(lambda: whole.initial, part="'diagonal'", problem="drawn thickness 3 is not between", remedy="widen")


def test_a_design_that_does_not_carry_its_loads_is_refused():
    with pytest.raises(fm.EquilibriumError, match="no value") as caught:
        truss((1e4, 5.0)).problem().optimise()
    assert "truss finger" in caught.value.part
    assert "smaller loads" in caught.value.remedy


def test_results_of_other_links_are_refused():
    short, long = truss((0.4, 1.8)).problem(), truss((0.4, 1.8)).problem()
    result = short.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    case = truss((0.4, 1.8))
    two = fm.DesignProblem(case.simulate(), [fm.SplineDesign(case.designs[0].link, 2)], targets=case.targets)
    for use in (two.rest_shape, lambda result: two.optimise(start=result)):
        refused(
            lambda use=use: use(result),
            part="truss finger",
            problem="18 parameters of link 'diagonal' instead of 12",
            remedy="segments",
        )
    for parameters in (np.zeros(3), np.full(18, np.nan)):
        refused(
            lambda parameters=parameters: long.rest_shape(parameters),
            part="design",
            problem="parameters",
            remedy="18 finite",
        )


@pytest.mark.parallel
@pytest.mark.parametrize("wanted", [REACHABLE, ((0.4, 1.8),)], ids=["groups", "one group"])
def test_the_optimum_does_not_depend_on_the_number_of_ranks(wanted, shared_tmp_path):
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        whole = truss(*wanted).problem(comm=comm)
        file = shared_tmp_path / f"{comm.size}.json" if comm.size > 1 else None
        results.append(whole.optimise(checkpoint=file))
        push = whole.targets[0].quantity.part
        curve = whole.simulation.with_design(results[-1]).load_displacement(push, forces=[force for force, _ in wanted])
        assert curve.displacements == pytest.approx([target.reached for target in results[-1].targets], rel=1e-8)
    alone, together = results
    assert together.links[0].parameters == pytest.approx(alone.links[0].parameters, rel=1e-6, abs=1e-6)
    assert together.objective == pytest.approx(alone.objective, rel=1e-6)
    assert (together.reason, together.iterations) == (alone.reason, alone.iterations)
    assert together.processes == MPI.COMM_WORLD.size
    assert together.groups == group_count(MPI.COMM_WORLD.size, len(wanted))
    # all processes have the same result
    described = (together.links, together.targets, together.objective, together.groups)
    assert MPI.COMM_WORLD.allgather(described) == [described] * MPI.COMM_WORLD.size


@pytest.mark.parallel
def test_refusals_are_the_same_on_all_ranks(shared_tmp_path):
    file = shared_tmp_path / "checkpoint.json"
    whole = truss((0.4, 1.8)).problem(comm=MPI.COMM_WORLD)
    whole.optimise(optimiser=fm.LevenbergMarquardt(iterations=1), checkpoint=file)
    MPI.COMM_WORLD.Barrier()
    with pytest.raises(fm.DescriptionError, match="targets") as caught:
        truss((0.4, 1.9)).problem(comm=MPI.COMM_WORLD).optimise(checkpoint=file, resume=True)
    assert len(set(MPI.COMM_WORLD.allgather(str(caught.value)))) == 1
    with pytest.raises(fm.EquilibriumError, match="no value"):
        truss((0.4, 1.8), (1e4, 5.0)).problem(comm=MPI.COMM_WORLD).optimise()
    with pytest.raises(fm.DescriptionError, match="drawn thickness"):
        truss((0.4, 1.8), thickness=(1.0, 2.0)).problem(comm=MPI.COMM_WORLD).optimise()
    # an error while the checkpoint is written, which only the first process does
    with pytest.raises(OSError):
        whole.optimise(checkpoint=file / "not a folder" / "checkpoint.json")


@pytest.mark.parallel
def test_a_point_beside_its_link_in_the_targets_of_one_group_is_refused_on_all_ranks():
    case = truss((0.4, 1.8))
    (design,), (target,) = case.designs, case.targets
    (force, _), *_ = target.sample.forces
    away = fm.Target(fm.Displacement(design.link, at=(500, 500)), fm.Sample({force: 0.1}), equals=(1.0, 1.0))
    problem = Case(case.scene, case.designs, [target, away]).problem(comm=MPI.COMM_WORLD)
    with pytest.raises(fm.DescriptionError, match=r"500") as caught:
        problem.optimise()
    assert len(set(MPI.COMM_WORLD.allgather(str(caught.value)))) == 1


def test_elements_too_large_for_the_handles_of_a_thin_strip_are_refused():
    mechanism = fm.Mechanism("thin strip")
    base, tip = mechanism.rigid("base", fixed=True), mechanism.rigid("tip")
    strip = mechanism.flexible("strip", fm.strip([(0, 0), (18, 34), (40, 60)], thickness=1.0, depth=20.0), PLASTIC)
    mechanism.revolute(base, strip, at=(0, 0), interface_radius=3.0)
    mechanism.revolute(strip, tip, at=(40, 60), interface_radius=3.0)
    mechanism.prismatic(base, tip, at=(40, 60), axis=(0, 1))
    push = mechanism.force(on=tip, at=(40, 60), direction=(0, -1))
    case = Case(fm.Scene(mechanism), [fm.SplineDesign(strip, 3)], [fm.Target(push, force=0.1, displacement=1.0)])
    refused(
        lambda: case.problem(size=5.0, order=1).initial,
        part="'strip'",
        problem="handles move no vertex, as its elements are too large: 2 of 42",
        remedy="smaller elements",
    )
