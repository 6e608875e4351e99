"""Searches from scattered starts: known optima are all found, best first, on any number of processes, past failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import (
    Barrier,
    Bounds,
    Checkpoint,
    DesignedLink,
    Evaluation,
    LinkSpline,
    Quadratic,
    ScaledNumbers,
    Search,
    ShapeBounds,
    ShapeError,
    SplineSamples,
    Start,
)

from ..effects.levers import lever
from .mechanisms import PLASTIC, Case
from .shapes import own_parameters

H = 3.0  # thickness of the link
SCATTER = fm.Scatter(starts=8, trial=4, distinct=0.3)


class TwoValleys:
    """A straight link whose middle is moved by q h: r = (q² − wanted, (q − 1) / 10, …) has minima near ±√wanted.

    Attributes:
        rest: its spline and bounds.
        asked: parameters of all starts.
    """

    BARRIER = Barrier(1.5, 0.01)

    def __init__(self, *, wanted: float = 1.0, broken: Sequence[int] = (), inverted: float = np.inf) -> None:
        controls = np.zeros((3, 2, 3))
        controls[:, 0, 0], controls[:, 1, 0], controls[:, 0, 2] = (0.0, 30.0, 60.0), 30.0, 1.0
        spline = LinkSpline(controls, np.array([True, False, True]))
        (own,), samples = own_parameters([spline]), SplineSamples(spline)
        link = DesignedLink("bar", own, spline, samples, H, Bounds((1.0, 6.0), 0.08), controls[:, 0, :2])
        self.lengths = np.where(spline.is_thickness, 1.0, H)
        size = len(spline.initial)
        numbers = {"numbers": ScaledNumbers(None, []), "of_numbers": slice(size, size)}
        self.rest = SimpleNamespace(initial=spline.initial, lengths=self.lengths, links=(link,), **numbers)
        (self.middle,) = np.flatnonzero(spline.entries == 7)  # of points (x, y, δ, x′, y′, δ′)
        self.wanted, self.broken, self.inverted = wanted, tuple(broken), inverted
        self.asked: list[np.ndarray] = []

    def q(self, p: np.ndarray) -> float:
        return float(p[self.middle] / H)

    def rest_shape(self, design: np.ndarray) -> np.ndarray:
        if self.q(design) > self.inverted:
            raise ShapeError("bar", "cells are inverted", "Bend it less")
        return design

    def optimise(
        self, *, optimiser: fm.Optimiser, start: np.ndarray | fm.DesignResult, correction: fm.Correction
    ) -> fm.DesignResult:
        p = np.array(start.links[0].parameters) if isinstance(start, fm.DesignResult) else start
        self.asked.append(p)
        if len(self.asked) - 1 in self.broken:
            raise fm.EquilibriumError("design of 'bar'", "it has no value", "Draw it otherwise")
        before = self.evaluate(p).value
        last = optimiser.minimise(self, Start(p), watch=lambda iterate: None)
        here, q = last.evaluation, self.q(last.evaluation.parameters)
        error = q * q / self.wanted - 1.0
        bow = fm.TargetResult("bow", "", 1.0, "mm", "equals", self.wanted, 0.0, q * q, 0.0, q * q, error)
        return fm.DesignResult(
            mechanism="bar",
            links=(fm.LinkDesign("bar", tuple(here.parameters.tolist()), (), (), (H, H), 0.0),),
            numbers=(),
            targets=(bow,),
            reason=last.reason.value,
            converged=last.reason.converged,
            verified=True,
            active=("largest bow of 'bar'",) if abs(q) > self.BARRIER.limit else (),
            objective=(before, here.value),
            objective_error=0.0,
            surrogate=None,
            corrections=(0.0,),
            iterations=last.number,
            evaluations=last.evaluations,
            mesh_ratio_max=2.0,
            seconds=0.0,
            phases={},
            processes=1,
            groups=1,
        )

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        q, away = self.q(parameters), (parameters - self.rest.initial) / self.lengths
        away[self.middle] = q - 1.0
        jacobian = np.vstack([np.zeros(len(away)), 0.1 * np.diag(1.0 / self.lengths)])
        jacobian[0, self.middle] = 2.0 * q / H
        return Evaluation(parameters, np.append(q * q - self.wanted, 0.1 * away), jacobian, self.regulariser)

    def regulariser(self, parameters: np.ndarray) -> Quadratic:
        x, found = self.q(parameters), Quadratic.zero(len(parameters))
        found.gradient[self.middle] = np.sign(x) * self.BARRIER.slope(abs(x)) / H
        found.curvature[self.middle, self.middle] = self.BARRIER.curvature(abs(x)) / H**2
        return Quadratic(float(self.BARRIER.value(abs(x))), found.gradient, found.curvature)


def searched(problem: TwoValleys, scatter: fm.Scatter = SCATTER, *, comm: MPI.Comm = MPI.COMM_SELF, **files):
    return Search(comm, problem, problem.rest, scatter, fm.LevenbergMarquardt(tolerance=1e-9), **files).run()


def middles(problem: TwoValleys, found: fm.SearchResult) -> list[float]:
    return [problem.q(np.array(design.links[0].parameters)) for design in found.optima]


def test_both_optima_are_found_and_the_better_one_comes_first():
    found = searched(problem := TwoValleys())
    assert middles(problem, found) == pytest.approx([1.0, -1.0], abs=0.05)
    assert found.best is found.optima[0]
    assert found.optima[0].objective[1] < found.optima[1].objective[1]
    given_up = {start.number for start in found.starts if start.given_up}
    assert sorted([*sum(found.sources, ()), *given_up]) == list(range(SCATTER.starts))
    assert found.evidence == ()
    assert "2 distinct designs from 8 starts, 0 infeasible" in str(found)


def test_starts_are_the_drawn_design_and_feasible_shapes_spread_evenly():
    searched(problem := TwoValleys(), fm.Scatter(starts=16, trial=50))
    link, (drawn, *scattered) = problem.rest.links[0], problem.asked[:16]
    assert np.array_equal(drawn, problem.rest.initial)
    for p in scattered:
        assert ShapeBounds().active(problem.rest, SimpleNamespace(p=p)) == ()
        assert np.all(np.abs(p - drawn) <= 2.0 * problem.lengths)
        assert np.all(np.abs(p - drawn)[link.spline.is_thickness] <= 1.0 / 3.0 + 1e-12)  # half of the way to 1 mm
    q = np.array([problem.q(p) for p in scattered])
    assert q.min() < -1.2 and q.max() > 1.2


def test_designs_are_in_the_order_of_their_objectives_wherever_they_started():
    class Least(TwoValleys):
        """With another quantity, as small as possible, that is relative to its value as drawn in all starts."""

        def optimise(self, **given) -> fm.DesignResult:
            result = super().optimise(**given)
            started = float(10 ** (len(self.asked) % 3))
            mass = fm.TargetResult("mass", "", None, "t", "least", None, started, 1.0, 0.0, 1.0, 0.0)
            return replace(result, targets=(*result.targets, mass))

    found = searched(problem := Least())
    assert middles(problem, found) == pytest.approx([1.0, -1.0], abs=0.05)
    assert [design.objective[1] for design in found.optima] == sorted(design.objective[1] for design in found.optima)


def test_other_seeds_give_other_starts_and_the_same_seed_the_same():
    first, same, other = (TwoValleys() for _ in range(3))
    for problem, seed in ((first, 3), (same, 3), (other, 4)):
        searched(problem, fm.Scatter(starts=4, seed=seed))
    assert np.array_equal(first.asked, same.asked)
    assert not np.allclose(first.asked[1], other.asked[1])


def test_shapes_with_inverted_cells_are_drawn_again():
    found = searched(problem := TwoValleys(inverted=0.0))
    assert all(problem.q(p) <= 0.0 for p in problem.asked[: SCATTER.starts])
    assert sum(start.rejected for start in found.starts) > 0
    assert all(start.result is not None for start in found.starts)


def test_starts_for_which_no_feasible_shape_is_drawn_are_reported():
    found = searched(TwoValleys(inverted=-np.inf), fm.Scatter(starts=3, attempts=5))
    assert [start.result is None for start in found.starts] == [False, True, True]
    assert str(found.starts[1]) == "start 1: no feasible shape was found, 5 shapes rejected before"


def test_infeasible_starts_do_not_end_a_search_and_are_reported():
    found = searched(TwoValleys(broken=(0, 3)))
    assert [start.number for start in found.starts if start.result is None] == [0, 3]
    assert "it has no value" in str(found.starts[3])
    assert len(found.optima) == 2


def test_a_search_without_a_single_value_is_an_error_with_the_reason():
    with pytest.raises(fm.EquilibriumError, match="none of 4 starts has a value: start 0: design of 'bar': it has no"):
        searched(TwoValleys(broken=range(4)), fm.Scatter(starts=4))


def test_the_worse_half_is_given_up_unless_it_has_ended():
    found = searched(TwoValleys(wanted=1.0), fm.Scatter(starts=8, trial=1))
    given_up = [start for start in found.starts if start.given_up]
    assert 1 <= len(given_up) <= 4
    best_given_up = min(start.result.objective[1] for start in given_up)
    assert found.best.objective[1] < best_given_up
    assert not {start.number for start in given_up} & set(sum(found.sources, ()))


def test_targets_out_of_reach_are_reported_with_the_bound_at_which_all_designs_end():
    found = searched(TwoValleys(wanted=9.0))
    (sentence,) = found.evidence
    reached = [1.0 - start.result.targets[0].reached / 9.0 for start in found.starts if start.result]
    assert f"by at least {min(reached):.2%}" in sentence
    assert "missed by" in sentence and "8 starts" in sentence
    assert "all end at largest bow of 'bar': widen that" in sentence
    assert sentence in str(found)


def test_a_missed_target_without_a_common_bound_is_not_attributed_to_bounds():
    found = searched(TwoValleys(wanted=-0.5))
    (sentence,) = found.evidence
    assert "no bound is common to them" in sentence and "widen" not in sentence


def checkpoints(folder: Path, **changes):
    return lambda name: Checkpoint(folder / f"{name}.json", {"wanted": 1.0, **changes})


class Killed(Exception):
    """Ends a run as a signal would."""


@pytest.mark.parametrize("after", [1, 5, 9, 14])
def test_a_search_that_was_killed_continues_and_gives_the_same_list(tmp_path, after):
    whole = searched(undisturbed := TwoValleys())

    class Mortal(Checkpoint):
        def write(self, data):
            if len(list(tmp_path.iterdir())) == after:
                raise Killed
            super().write(data)

    with pytest.raises(Killed):
        searched(TwoValleys(), checkpoint=lambda name: Mortal(tmp_path / f"{name}.json", {"wanted": 1.0}))
    resumed = TwoValleys()
    again = searched(resumed, checkpoint=checkpoints(tmp_path), resume=True)
    assert again == whole
    assert len(resumed.asked) < len(undisturbed.asked)
    assert searched(TwoValleys(), checkpoint=checkpoints(tmp_path)) == whole  # resumes only if asked to


def test_checkpoints_of_another_search_are_refused(tmp_path):
    searched(TwoValleys(), checkpoint=checkpoints(tmp_path))
    with pytest.raises(fm.DescriptionError, match="another problem, with other wanted"):
        searched(TwoValleys(wanted=2.0), checkpoint=checkpoints(tmp_path, wanted=2.0), resume=True)


@pytest.mark.parallel
def test_processes_share_the_starts_and_have_the_same_outcome():
    alone, shared, comm = TwoValleys(), TwoValleys(), MPI.COMM_WORLD
    expected, found = searched(alone), searched(shared, comm=comm)
    assert found == expected
    assert sum(comm.allgather(len(shared.asked))) == len(alone.asked)
    assert len(shared.asked) < len(alone.asked) or comm.size == 1


@pytest.mark.parametrize("option", ["starts", "spread", "attempts", "trial", "distinct"])
def test_numbers_of_a_search_are_positive(option):
    with pytest.raises(fm.DescriptionError, match=f"{option}.*search|search.*{option}"):
        fm.Scatter(**{option: 0})


# -- real designs ---


def pulled_bar(pull: float, displacement: float, *, comm: MPI.Comm = MPI.COMM_SELF, **design) -> fm.DesignProblem:
    """A straight bar between two pins, pulled by one of them: bows to either side make it softer."""
    mechanism = fm.Mechanism("pulled bar")
    base, slide = mechanism.rigid("base", fixed=True), mechanism.rigid("slide")
    bar = mechanism.flexible("bar", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=8.0), PLASTIC)
    mechanism.prismatic(base, slide, at=(60, 0), axis=(1, 0))
    mechanism.revolute(base, bar, at=(0, 0), interface_radius=2.0)
    mechanism.revolute(bar, slide, at=(60, 0), interface_radius=2.0)
    force = mechanism.force(on=slide, at=(60, 0), direction=(1, 0), name="pull")
    case = Case(
        fm.Scene(mechanism),
        [fm.SplineDesign(bar, 2, **design)],
        [fm.Target(force, force=pull, displacement=displacement)],
    )
    return case.problem(space="3d", size=2.0, comm=comm)


@pytest.mark.parallel
@pytest.mark.thorough
def test_a_bar_may_bow_to_either_side_and_its_search_is_in_plane_stress_on_any_number_of_processes():
    found = pulled_bar(20.0, 0.5, comm=MPI.COMM_WORLD).search(fm.Scatter(starts=4))
    up, down = sorted(found.optima, key=lambda design: -design.links[0].controls[1][0][1])
    assert up.links[0].controls[1][0][1] == pytest.approx(-down.links[0].controls[1][0][1], rel=1e-3)
    assert up.objective[1] == pytest.approx(down.objective[1], rel=1e-2)
    assert max(up.worst_error, down.worst_error) < 0.01
    assert found.evidence == ()
    assert up.processes == 1
    everywhere = MPI.COMM_WORLD.allgather([design.links for design in found.optima])
    assert everywhere == everywhere[:1] * len(everywhere)


@pytest.mark.thorough
def test_numbers_that_leave_the_plane_are_searched_in_space():
    case = lever(lambda hinge: [fm.JointSpring(hinge, 60.0)], space="3d")
    (spring,) = case.simulation.scene.effects
    numbers = [
        fm.Number(fm.JointAxis(case.joint, about=(1, 0, 0)), -0.4, 0.5),
        fm.Number(fm.SpringStiffness(spring), 20.0, 200.0),
    ]
    targets = [fm.Target(case.force, force=0.5, displacement=10.0)]
    problem = fm.DesignProblem(case.simulation, numbers, targets=targets)
    found = problem.search(fm.Scatter(starts=1, trial=1), optimiser=fm.LevenbergMarquardt(iterations=1))
    assert found.best.targets[0].error != 0.0
    assert [own.name for own in found.best.numbers] == [str(own) for own in numbers]


def test_bounds_that_hold_a_bar_back_are_reported():
    found = pulled_bar(20.0, 5.0, thickness=(2.8, 3.2), bend=0.01).search(fm.Scatter(starts=3, spread=0.5))
    (sentence,) = found.evidence
    assert "pull" in sentence and "curvature 0.01 of 'bar'" in sentence


def test_searches_keep_materials_and_shapes_that_the_simulation_was_given():
    case = pulled_bar(20.0, 0.5)
    (bar,), (target,) = case.simulation.scene.mechanism.flexible_links, case.targets
    flat = fm.Simulation(case.simulation.scene, space="plane-stress", size=3.0)
    for change in (
        lambda sim: sim.with_material(PLASTIC, fm.Material("soft", 1000.0, 0.35)),
        lambda sim: sim.with_shapes({bar: fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=4.0)}),
    ):
        problem = fm.DesignProblem(change(case.simulation), case.designs, targets=case.targets)
        once = fm.Scatter(starts=1, trial=1)
        best = problem.search(once, optimiser=fm.LevenbergMarquardt(iterations=1)).best
        wanted, other = (
            sim.with_design(best).load_displacement(target.quantity.part, forces=[20.0]).displacements[0]
            for sim in (change(flat), flat)
        )
        assert best.targets[0].reached == pytest.approx(wanted, rel=1e-6)
        assert best.targets[0].reached != pytest.approx(other, rel=0.1)
