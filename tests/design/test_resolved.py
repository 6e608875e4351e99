"""An optimisation ends where the gain left is below the elements' error; results move by less than their errors."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import Reason, ShapeBounds, StayClose

from .mechanisms import Case, objective, truss

COARSE = {"size": 5.0, "order": 1}
TARGETS = (0.1, 5.0), (0.4, 7.0)


def errors(case: Case, simulation: fm.Simulation) -> np.ndarray:
    """Estimates at the targets, relative to them."""
    curve = simulation.load_displacement(
        case.targets[0].quantity.part, forces=[target.sample.magnitude for target in case.targets]
    )
    return np.abs(curve.error_estimates()) / [target.wanted[0] for target in case.targets]


@pytest.mark.thorough
def test_targets_move_by_less_than_the_error_of_the_elements_when_iterations_continue():
    case = truss(*TARGETS)
    results, doubts = [], []
    for optimiser in (fm.LevenbergMarquardt(), fm.LevenbergMarquardt(tolerance=1e-4)):
        problem = case.problem(comm=MPI.COMM_WORLD, **COARSE)
        results.append(problem.optimise(optimiser=optimiser, correction=fm.Correction(estimates=False)))
        doubts.append(errors(case, problem.simulation))
    early, late = results
    assert early.reason == Reason.RESOLVED.value and early.converged
    assert late.reason == Reason.CONVERGED.value
    assert early.evaluations < late.evaluations
    moved = [abs(a.error - b.error) for a, b in zip(early.targets, late.targets, strict=True)]
    assert np.all(moved < doubts[0])


@pytest.mark.parallel
@pytest.mark.thorough
def test_errors_of_the_objective_are_those_of_its_simulation():
    case = truss(*TARGETS)
    whole, parts = objective(case, ShapeBounds() + 1e-4 * StayClose(), comm=MPI.COMM_WORLD, **COARSE)
    start = parts.rest.initial
    moved = start + 0.05 * parts.rest.lengths * np.sin(np.arange(len(start)))
    for parameters in (start, moved):
        evaluation = whole.evaluate(parameters)
        found = evaluation.errors()
        case_there = truss(*TARGETS)
        problem = case_there.problem(comm=MPI.COMM_SELF, **COARSE)
        there = problem.simulation.with_design(problem.rest_shape(parameters))
        assert found == pytest.approx(errors(case_there, there), rel=1e-3)
        whole.begin(None)
