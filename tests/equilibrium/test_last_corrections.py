"""Last corrections are solved with the factor at hand: fewer factors, the same equilibria, the same stability."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import fenicsmech as fm
from fenicsmech.equilibrium import LoadControl

from . import toggle
from .column import EULER, column
from .finger import finger

STIFF = 200.0  # MPa of the toggle's stilt: the force's point follows the toggle
LOADS = {"plane-stress": [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0], "3d": [0.5, 1.0, 1.5, 2.0, 3.0]}
ALWAYS_ANEW = fm.PrimalDualNewton(reuse_factor=0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("space", LOADS)
def test_fewer_factors_lead_to_the_same_curve(space):
    curves = []
    for solver in (fm.PrimalDualNewton(), ALWAYS_ANEW):
        simulation, push = finger(space, solver=solver)
        curves.append(simulation.load_displacement(push, forces=LOADS[space]))
    quick, slow = curves
    assert quick.displacements == pytest.approx(slow.displacements, rel=1e-8)
    assert [frame.unstable_modes for frame in quick.frames] == [frame.unstable_modes for frame in slow.frames]
    assert max(frame.residuals[-1] for frame in quick.frames) <= fm.PrimalDualNewton().tolerance
    counts = [sum(frame.iterations for frame in curve.frames) for curve in curves]
    assert counts[0] <= 0.9 * counts[1]


@pytest.mark.thorough
@pytest.mark.parametrize("space", LOADS)
def test_rates_at_the_equilibria_are_as_good_as_those_of_a_new_factor(space):
    simulation, push = finger(space)
    newton = simulation.solver(push)
    system, state = newton.system, simulation.load_displacement(push, forces=[1.0]).frames[0].state
    corrected = 0
    for load in (1.1, 1.2, 1.3, 1.4):
        control = LoadControl(load)
        solution = newton.solve(system.moved(state, solution_rate(newton, state).scaled(0.1)), control)
        state = solution.state
        system.load(state)
        at = newton.linearise(state, control)
        rate = at.step(at.rate())
        off = system.size(rate + solution.tangent.scaled(-1.0)) / system.size(rate)
        assert off < newton.options.reuse_factor
        corrected += 0.0 < off
    assert corrected  # a tangent of the equilibrium itself would have no error at all


def test_rates_without_reused_factors_are_those_of_a_new_one():
    simulation, push = finger("plane-stress", solver=ALWAYS_ANEW)
    newton = simulation.solver(push)
    start = simulation.load_displacement(push, forces=[1.0]).frames[0].state
    for load in (1.01, 1.1, 1.3):
        solution = newton.solve(start, LoadControl(load))
        rate = solution_rate(newton, solution.state)
        assert newton.system.size(rate + solution.tangent.scaled(-1.0)) < 1e-9 * newton.system.size(rate)


def solution_rate(newton, state):
    """The rate of a loaded equilibrium with the force, by a factor of its own."""
    at = newton.linearise(state, LoadControl(state.force))
    return at.step(at.rate())


@pytest.mark.parametrize("nearness", [1e-2, 1e-3, 1e-4])
def test_stability_changes_at_the_limit_point_and_nowhere_else(nearness):
    highest = minimize_scalar(
        lambda sunk: -toggle.force(sunk), bounds=(0.0, 5.0), method="bounded", options={"xatol": 1e-10}
    ).x
    sunk = highest * np.array([0.5, 1.0 - nearness, 1.0 + nearness, 1.2])
    case = toggle.toggle(stilt_modulus=STIFF)
    curve = case.simulation.load_displacement(case.push, displacements=toggle.displacement(sunk, STIFF))
    assert curve.forces == pytest.approx(toggle.force(sunk), rel=1e-8)
    assert list(curve.stable) == [True, True, False, False]


def test_stability_next_to_a_buckling_load_is_that_of_new_factors():
    loads = EULER * np.concatenate([[0.9], 1.0 + np.linspace(-0.01, 0.01, 9)])
    modes = []
    for solver in (fm.PrimalDualNewton(), ALWAYS_ANEW):
        case = column(size=2.0, solver=solver)
        modes.append([f.unstable_modes for f in case.simulation.load_displacement(case.push, forces=loads).frames])
    assert modes[0] == modes[1]
    assert {0, 1} == set(modes[0])
