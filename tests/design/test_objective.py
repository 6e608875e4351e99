"""The design objective: its value, its gradient away from the initial design, what it refuses, groups of processes."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import (
    Comparison,
    Infeasible,
    LevenbergMarquardt,
    MeshQuality,
    Quadratic,
    Regulariser,
    ShapeBounds,
    ShapeError,
    Start,
    StayClose,
    TooHigh,
)

from .mechanisms import Case, objective, strained, truss

TARGETS = ((0.1, 2.0), (0.4, 3.2))
REGULARISER = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + 1e-3 * StayClose()


def away(bench, change: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """A design away from the initial one, and a direction from there."""
    return bench.design(change, seed=5), bench.direction(6)


def test_value_is_half_the_weighted_sum_of_squared_relative_errors():
    case = truss(*TARGETS)
    light, heavy = (
        fm.Target(t.quantity, t.sample, equals=t.wanted, weight=w)
        for t, w in zip(case.targets, (0.5, 3.0), strict=True)
    )
    whole, bench = objective(Case(case.scene, case.designs, [light, heavy]), StayClose())
    here = whole.evaluate(bench.rest.initial)
    errors = (whole.reached - [2.0, 3.2]) / [2.0, 3.2]
    assert here.value == pytest.approx(0.5 * (0.5 * errors[0] ** 2 + 3.0 * errors[1] ** 2), rel=1e-10)
    curve = bench.simulation.load_displacement(light.quantity.part, forces=[0.1, 0.4])
    assert whole.reached == pytest.approx(curve.displacements, rel=1e-8)
    whole.correction = np.array([0.2, -0.1])
    errors = (whole.reached + [0.2, -0.1] - [2.0, 3.2]) / [2.0, 3.2]
    assert whole.evaluate(bench.rest.initial).value == pytest.approx(
        0.5 * (0.5 * errors[0] ** 2 + 3.0 * errors[1] ** 2), rel=1e-10
    )


def test_targets_that_are_next_to_nothing_are_measured_by_the_largest_one():
    (push,) = truss().scene.mechanism.forces
    wanted = [fm.Target(push, force=1.0, displacement=displacement) for displacement in (0.0, 5.0, -0.1, -2.0)]
    assert Comparison(wanted, fm.Units()).scales == pytest.approx([0.5, 5.0, 0.5, 2.0])
    with pytest.raises(fm.DescriptionError, match="zero is wanted.*scale="):
        Comparison(wanted[:1], fm.Units())


@pytest.mark.parametrize(
    ("space", "size", "order"), [("plane-stress", 3.0, 2), ("3d-symmetric", 4.0, 1), ("3d", 4.0, 1)]
)
def test_gradient_agrees_with_central_differences_away_from_the_initial_design(space, size, order):
    whole, bench = objective(truss(*TARGETS), REGULARISER, space=space, size=size, order=order)
    p, direction = away(bench)
    assert len(p) == 18
    here = whole.evaluate(p)
    assert here.penalty.value > 1e-5
    step = 1e-3
    ahead, back = (whole.evaluate(p + h * direction) for h in (step, -step))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / (2 * step), rel=1e-5)
    slope = (ahead.residuals - back.residuals) / (2 * step)
    assert here.jacobian @ direction == pytest.approx(slope, rel=1e-5, abs=1e-5 * np.abs(slope).max())


def test_gradient_does_not_depend_on_the_way_to_a_design():
    seen = []
    for through in (0, 1, 2):
        whole, bench = objective(truss(*TARGETS), REGULARISER)
        p, direction = away(bench)
        for fraction in np.linspace(0.0, 1.0, through + 1)[:-1]:
            whole.evaluate(bench.rest.initial + fraction * (p - bench.rest.initial) + 0.01 * fraction * direction)
        here = whole.evaluate(p)
        seen.append([here.value, *here.gradient])
    for other in seen[1:]:
        assert other == pytest.approx(seen[0], rel=1e-6, abs=1e-6 * np.abs(seen[0]).max())


def test_values_above_the_limit_are_refused_without_derivatives(monkeypatch):
    whole, bench = objective(truss(*TARGETS), StayClose())
    p, _ = away(bench)
    value = whole.evaluate(p).value
    assert whole.evaluate(p, below=1.001 * value).value == pytest.approx(value, rel=1e-8)

    def never(known):
        raise AssertionError("derivatives were computed")

    monkeypatch.setattr(bench.equilibria, "gradients", never)
    with pytest.raises(TooHigh, match="merit is"):
        whole.evaluate(p, below=0.999 * value)


def test_reached_displacements_are_those_of_the_last_accepted_evaluation():
    whole, bench = objective(truss(*TARGETS), StayClose())
    assert np.all(np.isnan(whole.reached))
    value = whole.evaluate(bench.rest.initial).value
    reached = whole.reached.copy()
    with pytest.raises(TooHigh):
        whole.evaluate(bench.design(0.3), below=1e-6 * value)
    assert np.array_equal(whole.reached, reached)


def test_designs_that_turn_cells_inside_out_are_infeasible():
    whole, bench = objective(truss(*TARGETS), StayClose())
    p = np.where(bench.rest.lengths == 1.0, -3.0, bench.rest.initial)
    with pytest.raises(Infeasible, match="inverted"):
        whole.evaluate(p)
    whole.begin(None)
    with pytest.raises(Infeasible, match="inverted"):
        whole.evaluate(p)
    assert np.isfinite(whole.evaluate(bench.rest.initial).value)  # it recovers


def test_designs_without_derivatives_are_infeasible(monkeypatch):
    whole, bench = objective(truss(*TARGETS), StayClose())
    before = whole.evaluate(bench.rest.initial)

    def open_handles(placement, by_field):
        raise ShapeError(
            "shape of link 'diagonal'", "its mesh leaves positions of handles open", "Use smaller elements"
        )

    with monkeypatch.context() as patched:
        patched.setattr(bench.rest, "gradient", open_handles)
        with pytest.raises(Infeasible, match="leaves positions of handles open"):
            whole.evaluate(bench.design(0.05))
    assert whole.evaluate(bench.rest.initial).value == pytest.approx(before.value, rel=1e-8)


def test_loads_that_no_equilibrium_carries_are_infeasible():
    whole, bench = objective(truss((1e4, 5.0)), StayClose())
    with pytest.raises(Infeasible, match="push on tip"):
        whole.evaluate(bench.rest.initial)


def test_bounds_that_hold_a_design_back_are_named():
    whole, bench = objective(truss(*TARGETS, thickness=(2.9, 3.1)), REGULARISER)
    whole.evaluate(bench.rest.initial)
    link = bench.rest.links[0]
    p = bench.rest.initial.copy()
    p[np.flatnonzero(link.spline.is_thickness)[1:-1]] += 0.1
    assert "largest thickness 3.1 of 'diagonal'" in whole.active(p)


def test_targets_are_reached_by_changing_the_shape():
    whole, bench = objective(truss(*TARGETS), ShapeBounds() + 1e-4 * StayClose())
    last = LevenbergMarquardt().minimise(whole, Start(bench.rest.initial), watch=lambda iterate: None)
    whole.evaluate(last.evaluation.parameters)
    assert whole.reached == pytest.approx([2.0, 3.2], rel=0.01)


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("case", "fidelity", "digits"),
    [
        (lambda: truss(*TARGETS), {}, 1e-10),
        # each group takes its own steps to its targets, and so leaves other residuals
        (lambda: strained(1.0, 3.0, 2.0), {}, 1e-8),
        pytest.param(lambda: truss(TARGETS[1]), {}, 1e-7, marks=pytest.mark.thorough),
    ],
    ids=["truss", "braced four-bar", "one target"],
)
def test_any_number_of_processes_finds_the_same_value_and_derivatives(case, fidelity, digits):
    seen = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        whole, bench = objective(case(), REGULARISER, comm=comm, **fidelity)
        whole.evaluate(bench.rest.initial)
        here = whole.evaluate(away(bench)[0])
        seen.append((here.value, here.residuals, here.gradient, here.jacobian))
    # processes that share a mesh add up in another order, those that share targets only do not
    if comm.allreduce(bench.simulation.comm.size, op=MPI.MAX) > 1:
        digits = 1e-7
    for one, together in zip(*seen, strict=True):
        assert together == pytest.approx(one, rel=digits, abs=digits * np.abs(one).max())


@pytest.mark.parallel
def test_a_design_infeasible_in_one_group_is_infeasible_in_all():
    whole, bench = objective(truss((0.1, 2.0), (1e4, 5.0)), StayClose(), comm=MPI.COMM_WORLD)
    with pytest.raises(Infeasible, match="push on tip"):
        whole.evaluate(bench.rest.initial)


class Rounded(Regulariser):
    """1, which some processes round differently, as sums over meshes that are distributed differently are."""

    def around(self, rest, placement):
        value = 1.0 + 1e-8 * MPI.COMM_WORLD.rank
        return lambda p: Quadratic(value, np.zeros(len(p)), np.zeros((len(p), len(p))))


@pytest.mark.parallel
def test_processes_agree_on_what_is_too_high_however_they_round():
    whole, bench = objective(truss(*TARGETS), Rounded(), comm=MPI.COMM_WORLD)
    value = MPI.COMM_WORLD.bcast(whole.evaluate(bench.rest.initial).value)
    whole.evaluate(bench.rest.initial, below=value + 0.5e-8)
    with pytest.raises(TooHigh):
        whole.evaluate(bench.rest.initial, below=value - 0.5e-8)
