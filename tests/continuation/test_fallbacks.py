"""Fallbacks are tried in the order that ``LoadStepper``'s module states, and end after counted attempts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.continuation import HermitePredictor, LoadStepper, LoadSteps, LoadStepsFailed
from fenicsmech.equilibrium import (
    EquilibriumPoint,
    EquilibriumSolver,
    LoadControl,
    NotConverged,
    Stability,
    State,
    Step,
)

from ..simulation.demo_scenes import describe
from .test_limit_loads import OneFreedom, start


class Stubborn(OneFreedom):
    """A straight path y = p on which a solve succeeds if its step is short enough, as ``LoadStepper`` sees it.

    Args:
        longest: step that succeeds.
    """

    def __init__(self, longest: float) -> None:
        super().__init__()
        self.longest, self.reached = longest, 0.0
        self.tried: list[tuple[float, float]] = []  # prescribed value and least shift of each solve
        self.failed = 0

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        self.tried.append((control.prescribed, start.minimum_shift))
        if abs(control.prescribed - self.reached) > self.longest:
            self.failed += 1
            raise NotConverged("too far", 25)
        self.reached = control.prescribed
        tangent = Step(np.ones(1), np.zeros(0), np.zeros(0), 1.0)
        state = State(np.array([self.reached]), np.zeros((0, 1)), np.zeros(0), self.reached, np.zeros(0))
        return EquilibriumPoint(state, control, tangent, 1.0, Stability(0, 0), 4, (0.0,), None)


def stepper(path: Stubborn, *, minimum_shift: float = 0.0) -> LoadStepper:
    state = replace(start(), minimum_shift=minimum_shift)
    return LoadStepper(path, state, LoadControl(), predictor=HermitePredictor())


def test_smaller_shifts_come_before_half_the_step():
    path, shift = Stubborn(0.0), LoadSteps().minimum_shift
    with pytest.raises(LoadStepsFailed) as failure:
        stepper(path, minimum_shift=shift).advance(LoadControl(0.1))
    shifts = [factor * shift for factor in LoadSteps().shift_factors]
    assert sorted(shifts, reverse=True) == shifts and len(shifts) == 3
    first, rest = path.tried[:1], path.tried[1:]  # at the start
    assert first == [(0.0, shifts[0])]
    steps = [rest[k : k + 3] for k in range(0, len(rest), 3)]
    assert [[tried for _, tried in step] for step in steps] == [shifts] * len(steps)
    values = np.array([value for value, _ in rest[::3]])
    assert values == pytest.approx(0.1 * 0.5 ** np.arange(len(values)))
    assert failure.value.tried == tuple(values) and failure.value.reached == 0.0


@pytest.mark.parametrize("part", [2.0 * LoadSteps().smallest, 1.1 / 64.0, 0.1])  # halves of these are not too small
def test_a_path_on_which_only_steps_of_one_length_succeed_is_walked_to_its_end(part):
    path = Stubborn(0.1 * part)
    assert stepper(path).advance(LoadControl(0.1)).state.force == 0.1
    # steps double after each success, and halve: at most every other one fails
    assert path.failed <= 0.5 * len(path.tried) + math.log2(1.0 / part)


@pytest.mark.parametrize("before", [1e-12, 1e-6, 1e-2])
def test_steps_that_only_fail_end_after_a_bounded_number_with_the_last_equilibrium(before):
    path = Stubborn(math.inf)
    walk = stepper(path)
    walk.advance(LoadControl(before))
    path.longest, solved = 0.0, len(path.tried)
    with pytest.raises(LoadStepsFailed, match="too far") as failure:
        walk.advance(LoadControl(1.0))
    steps = LoadSteps()
    halvings = math.ceil(math.log2(steps.motion / (before * steps.smallest)))  # motions limit the first step
    assert len(path.tried) - solved == len(failure.value.tried) == min(halvings, steps.failures)
    assert failure.value.last.state.force == failure.value.reached == before


def test_a_path_that_needs_many_steps_without_failures_is_not_cut_short():
    path = Stubborn(math.inf)
    assert stepper(path).advance(LoadControl(400.0)).state.force == 400.0
    assert len(path.tried) > 1000  # motions of a step are limited


@pytest.fixture
def factorisations(monkeypatch):
    """Numbers of factorisations of each solve."""
    counts, factor, solve = [], EquilibriumSolver.factor, EquilibriumSolver.solve

    def counted(self, shift):
        counts[-1] += 1
        return factor(self, shift)

    def begun(self, start, control):
        counts.append(0)
        return solve(self, start, control)

    monkeypatch.setattr(EquilibriumSolver, "factor", counted)
    monkeypatch.setattr(EquilibriumSolver, "solve", begun)
    return counts


def test_displacement_beyond_reach_ends_within_the_bounds_with_part_value_remedy_and_all_frames(factorisations):
    scene, push = describe("truss")
    method = fm.PrimalDualNewton()
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=8.0, solver=method)
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[1.0, 2.0, 500.0])
    error = caught.value
    assert repr(push.name) in error.part and "500" in error.problem and error.remedy
    assert [frame.displacement for frame in error.frames] == pytest.approx([1.0, 2.0])
    assert error.last.displacement > 2.0
    assert max(factorisations) <= method.factorisations + method.shifts
    tried = int(error.problem.split(";")[-1].split()[0])
    assert 1 < tried <= LoadSteps().failures


@pytest.mark.parametrize("most", [4, fm.PrimalDualNewton().factorisations])
def test_a_solve_ends_after_the_factorisations_it_is_given(factorisations, most):
    scene, push = describe("truss")
    method = fm.PrimalDualNewton(factorisations=most)
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=8.0, solver=method)
    with pytest.raises(fm.EquilibriumError):
        simulation.load_displacement(push, displacements=[500.0])
    assert max(factorisations) <= most + method.shifts
    assert (max(factorisations) > 4 + method.shifts) == (most > 4)
