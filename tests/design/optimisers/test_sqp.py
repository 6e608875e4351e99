"""Sequential quadratic programming finds known constrained optima in any units, past infeasible points, and resumes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.constrained import KNOWN, FormulaProblem, Formulas
from fenicsmech.design import BFGS, SQP, Barrier, Iterate, LevenbergMarquardt, Quadratic, Reason, Start
from fenicsmech.errors import DescriptionError


def minimised(problem: FormulaProblem, optimiser: SQP | None = None, start: Start | None = None) -> list[Iterate]:
    history: list[Iterate] = []
    optimiser = optimiser or SQP(tolerance=1e-9, violation=1e-8, iterations=100)
    optimiser.minimise(problem, start or Start(problem.start), watch=history.append)
    return history


@pytest.mark.parametrize("name", KNOWN)
def test_known_optima_are_found_and_satisfy_the_conditions_of_karush_kuhn_and_tucker(name):
    problem = FormulaProblem(KNOWN[name])
    last = minimised(problem)[-1]
    assert last.reason is Reason.CONVERGED
    assert last.evaluations == problem.asked <= 30
    here = last.evaluation
    assert here.parameters == pytest.approx(KNOWN[name].optimum, abs=3e-4)
    c = here.inequalities
    assert np.all(c.values <= 1e-8)
    active = c.values > -1e-4
    multipliers = np.linalg.lstsq(c.jacobian[active].T, -here.gradient, rcond=None)[0]
    assert np.all(multipliers > 0.0)
    size = np.linalg.norm(problem.lengths * here.gradient)
    left = here.gradient + c.jacobian[active].T @ multipliers
    assert np.linalg.norm(problem.lengths * left) < 1e-3 * size


@pytest.mark.parametrize(("unit", "scale"), [(1e6, 1.0), (1e-6, 1.0), (1.0, 1e-3), (1e3, 1e3)])
@pytest.mark.parametrize("name", ["HS22 as least squares", "HS43", "stepped cantilever"])
def test_units_of_objective_and_parameters_change_nothing(name, unit, scale):
    units = scale ** np.arange(1, len(KNOWN[name].start) + 1)
    ways = []
    for problem in (FormulaProblem(KNOWN[name]), FormulaProblem(KNOWN[name], unit=unit, units=units)):
        history = minimised(problem, SQP(tolerance=1e-6))
        ways.append(np.array([iterate.evaluation.parameters / problem.units for iterate in history]))
    assert ways[1] == pytest.approx(ways[0], rel=1e-6, abs=1e-6)


def test_infeasible_points_shorten_steps():
    sharp = Formulas((0.2,), (1e-2**0.5,), ("1e-2/x1**2 - 1",), "x1", domain="x1 - 0.09")
    problem = FormulaProblem(sharp)
    last = minimised(problem, SQP(tolerance=1e-9, damping=1e-6))[-1]
    assert problem.outside > 0
    assert last.reason is Reason.CONVERGED
    assert last.evaluation.parameters == pytest.approx(sharp.optimum, abs=1e-4)


class Walled(FormulaProblem):
    """With a wall of the regulariser at x1 = 0.5."""

    WALL = Barrier(0.5, 0.02)

    def regulariser(self, parameters):
        x, size = parameters[:1], len(parameters)
        gradient, curvature = np.zeros(size), np.zeros((size, size))
        gradient[0], curvature[0, 0] = self.WALL.slope(x)[0], self.WALL.curvature(x)[0]
        return Quadratic(float(self.WALL.value(x)[0]), gradient, curvature)


def test_walls_of_the_regulariser_cost_no_evaluations():
    problem = Walled(KNOWN["HS22 as least squares"])
    problem.start = np.array([-1.0, 3.0])
    last = minimised(problem, SQP(tolerance=1e-8))[-1]
    assert last.reason is Reason.CONVERGED
    x, y = last.evaluation.parameters
    assert 0.5 < x < 0.6
    assert y == pytest.approx(1.0, abs=1e-3)
    assert last.evaluations <= 10


def test_inequalities_that_contradict_each_other_end_where_they_are_violated_least():
    contradictory = Formulas((3.0, 2.0), (0.0, 0.0), ("x1**2 + 1 - x2", "x2 + x1**2"), "x1 + x2")
    last = minimised(FormulaProblem(contradictory), SQP(iterations=100))[-1]
    assert last.reason is Reason.VIOLATED and not last.reason.converged
    assert last.evaluation.parameters[0] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("name", ["HS22 as least squares", "HS43"])
def test_resuming_from_any_iterate_gives_the_same_iterates(name):
    history = minimised(FormulaProblem(KNOWN[name]))
    for index, iterate in enumerate(history[:-1]):
        numbers = json.loads(json.dumps([iterate.evaluation.parameters.tolist(), iterate.memory.tolist()]))
        start = Start(np.array(numbers[0]), iterate.number, iterate.evaluations, np.array(numbers[1]))
        again = minimised(FormulaProblem(KNOWN[name]), start=start)
        assert [one.number for one in again] == [one.number for one in history[index:]]
        for ours, theirs in zip(again, history[index:], strict=True):
            assert ours.evaluations == theirs.evaluations + 1
            assert ours.evaluation.parameters == pytest.approx(theirs.evaluation.parameters, rel=1e-12, abs=1e-12)


def test_without_inequalities_it_is_levenberg_marquardt_whose_damping_has_the_unit_of_the_objective():
    banana = Formulas((-1.2, 1.0), (1.0, 1.0), (), residuals=("10*(x2 - x1**2)", "1 - x1"))
    problem = FormulaProblem(banana)
    here = problem.evaluate(problem.start)
    scale = max(here.value, float(np.linalg.norm(problem.lengths * here.gradient)))
    ways = [
        np.array([iterate.evaluation.parameters for iterate in minimised(FormulaProblem(banana), optimiser)])
        for optimiser in (
            SQP(tolerance=1e-8, damping=1e-3, least_damping=1e-9),
            LevenbergMarquardt(tolerance=1e-8, damping=1e-3 * scale, least_damping=1e-9 * scale),
        )
    ]
    assert ways[0] == pytest.approx(ways[1], rel=1e-9)
    assert ways[0][-1] == pytest.approx(banana.optimum, abs=1e-4)


@pytest.mark.parametrize("optimiser", [LevenbergMarquardt(), BFGS()], ids=lambda optimiser: type(optimiser).__name__)
def test_other_optimisers_refuse_inequalities_and_name_the_remedy(optimiser):
    with pytest.raises(DescriptionError, match=r"x1 \+ x2 - 2.*fm\.SQP\(\)"):
        minimised(FormulaProblem(KNOWN["HS22"]), optimiser)


def test_levenberg_marquardt_refuses_objectives_that_are_not_sums_of_squares():
    with pytest.raises(DescriptionError, match=r"more than a sum of squares.*fm\.SQP\(\)"):
        minimised(FormulaProblem(Formulas((1.0,), (0.0,), (), "x1**2")), LevenbergMarquardt())


@pytest.mark.parametrize("optimiser", [SQP(), BFGS()], ids=lambda optimiser: type(optimiser).__name__)
def test_minima_below_zero_take_no_more_iterations_than_those_above(optimiser):
    above, below = (
        minimised(
            FormulaProblem(Formulas((1.0, -0.5), (2.0, 0.0), (), f"(x1 - 2)**2 + (x1 - 2)**4 + 3*x2**2 {c}")), optimiser
        )
        for c in ("+ 3", "- 3")
    )
    assert below[-1].reason is Reason.CONVERGED and len(below) <= len(above)


@pytest.mark.parametrize("option", ["tolerance", "violation", "damping"])
def test_options_are_positive(option):
    with pytest.raises(DescriptionError, match=f"{option} of SQP"):
        SQP(**{option: 0.0})
