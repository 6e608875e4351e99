"""The tangent at a state serves as long as it is held, and refuses once its factor is gone."""

import numpy as np
import pytest

from fenicsmech.equilibrium import DisplacementControl, LoadControl

from .finger import finger


@pytest.fixture(scope="module")
def solved():
    simulation, push = finger("plane-stress")
    curve = simulation.load_displacement(push, forces=[1.0, 2.0])
    return simulation.solver(push), [frame.state for frame in curve.frames]


def test_tangent_solves_for_rates_corrections_and_stability(solved):
    solver, (state, _) = solved
    system = solver.system
    at = solver.linearise(state, LoadControl(state.force))
    assert system.size(at.step(at.solve(at.residual.vector))) < 1e-8
    point = at.point((), 0)
    assert (point.unstable_modes, point.unstable_under_control) == (0, 0)
    rate = at.control.tangent(at.step(at.rate()))
    assert system.size(point.tangent + rate.scaled(-1.0)) < 1e-9 * system.size(point.tangent)
    # the compliance of the force's point is the inverse of its stiffness while it is held
    system.load(state)
    held = solver.linearise(state, DisplacementControl(system.load_displacement(state))).point((), 0)
    assert point.conjugate_rate == pytest.approx(1.0 / held.conjugate_rate, rel=1e-7)
    assert system.size(held.tangent.scaled(point.conjugate_rate) + point.tangent.scaled(-1.0)) < 1e-7 * system.size(
        point.tangent
    )


def test_displacements_are_those_of_its_own_state_wherever_the_system_is(solved):
    solver, (state, later) = solved
    at = solver.linearise(state, LoadControl(state.force))
    x = at.rate()
    expected = at.displacements(x)
    solver.system.load(later)
    solver.system.residual(later, LoadControl(later.force))
    assert np.array_equal(at.displacements(x), expected)


def test_tangent_refuses_once_another_was_factored(solved):
    solver, (state, later) = solved
    at = solver.linearise(state, LoadControl(state.force))
    right = at.residual.vector
    solver.linearise(later, LoadControl(later.force))
    for ask in (lambda: at.solve(right), at.rate, lambda: at.point((), 0)):
        with pytest.raises(RuntimeError, match="out of date"):
            ask()


def test_frames_print_their_figures():
    simulation, push = finger("plane-stress")
    (frame,) = simulation.load_displacement(push, forces=[1.0]).frames
    assert repr(frame).startswith("<Frame: force 1, displacement ") and repr(frame).endswith(", stable>")
