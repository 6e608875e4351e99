"""Limit loads are located as closely, at hardly more cost, however far beyond them the load asked for lies."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.continuation import HermitePredictor, LoadStepper, LoadStepsFailed
from fenicsmech.equilibrium import EquilibriumPoint, LoadControl, NotConverged, Stability, State, Step

from ..equilibrium import toggle
from ..equilibrium.finger import finger

BEYOND = [1.01, 3.0, 100.0, 1e4, 1e5]  # times the limit load
RESOLUTION = 2.0 / 1024.0  # of it


class OneFreedom:
    """A path with a limit load of one, p = 1 − (1 − y)², in closed form, as ``LoadStepper`` sees it."""

    potentials, contact, comm, turning = (), None, MPI.COMM_SELF, None

    def __init__(self, *, hidden: bool = False) -> None:
        self.system, self.solved, self.failed, self.softest, self.hidden = self, 0, 0, 1.0, hidden

    def hides(self, state: State, control: LoadControl) -> bool:
        return self.hidden

    def patient(self, factor: int) -> OneFreedom:
        return self

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        self.solved += 1
        if control.prescribed > 1.0:
            self.failed += 1
            raise NotConverged("no equilibrium", 25)
        stiffness = math.sqrt(1.0 - control.prescribed)
        self.softest = min(self.softest, stiffness)
        rate = math.inf if stiffness == 0.0 else 0.5 / stiffness
        tangent = Step(np.array([rate]), np.zeros(0), np.zeros(0), 1.0)
        state = State(np.array([1.0 - stiffness]), np.zeros((0, 1)), np.zeros(0), control.prescribed, np.zeros(0))
        return EquilibriumPoint(state, control, tangent, rate, Stability(0, 0), 4, (0.0,), None)

    def size(self, step: Step) -> float:
        return float(np.abs(step.u).max())

    def difference(self, later: State, earlier: State) -> Step:
        return Step(later.u - earlier.u, np.zeros(0), np.zeros(0), later.force - earlier.force)

    def independent(self, step: Step, state: State) -> Step:
        return step

    def touching(self, state: State) -> np.ndarray:
        return np.zeros(0, bool)

    def moved(self, state: State, step: Step) -> State:
        return State(state.u + step.u, state.poses, state.multipliers, state.force + step.force, state.motors)


def start() -> State:
    return State(np.zeros(1), np.zeros((0, 1)), np.zeros(0), 0.0, np.zeros(0))


@pytest.mark.parametrize("beyond", BEYOND)
def test_last_equilibrium_is_next_to_the_limit_load_and_has_lost_its_stiffness(beyond):
    freedom = OneFreedom()
    path = LoadStepper(freedom, start(), LoadControl(), predictor=HermitePredictor())
    with pytest.raises(LoadStepsFailed) as failure:
        path.advance(LoadControl(beyond))
    assert 1.0 - RESOLUTION < failure.value.reached <= 1.0
    assert freedom.softest < math.sqrt(RESOLUTION)
    assert freedom.solved < 20 and freedom.failed <= 4  # failures take all iterations there are


@pytest.mark.parametrize("beyond", BEYOND)
def test_load_steps_after_the_first_locate_it_as_closely_and_a_load_on_the_way_back_is_reached(beyond):
    path = LoadStepper(OneFreedom(), start(), LoadControl(), predictor=HermitePredictor())
    path.advance(LoadControl(0.5))
    with pytest.raises(LoadStepsFailed) as failure:
        path.advance(LoadControl(beyond))
    assert 1.0 - RESOLUTION < failure.value.reached <= 1.0
    assert path.advance(LoadControl(-0.5)).state.force == -0.5


def test_it_is_located_as_closely_where_rounding_hides_what_resists():
    path = LoadStepper(OneFreedom(hidden=True), start(), LoadControl(), predictor=HermitePredictor())
    for load in (0.5, 0.9):
        path.advance(LoadControl(load))
    with pytest.raises(LoadStepsFailed) as failure:
        path.advance(LoadControl(1.5))
    assert failure.value.hidden and failure.value.fold == pytest.approx(1.0, abs=0.01)
    assert 1.0 - RESOLUTION < failure.value.reached <= 1.0


class FoundElsewhereOnce(OneFreedom):
    """The first solve above 0.3, under contact, ends on another path."""

    contact, elsewhere = object(), False

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        point = super().solve(start, control)
        if control.prescribed < 0.3 or self.elsewhere:
            return point
        self.elsewhere = True
        return replace(point, state=replace(point.state, u=point.state.u + 5.0))


def test_equilibria_kept_under_contact_that_steps_have_passed_are_not_returned_to():
    path = LoadStepper(FoundElsewhereOnce(), start(), LoadControl(), predictor=HermitePredictor())
    with pytest.raises(LoadStepsFailed) as failure:
        path.advance(LoadControl(3.0))
    assert 1.0 - RESOLUTION < failure.value.reached <= 1.0
    assert path.solver.elsewhere and path.snaps == 0


@pytest.fixture(scope="module")
def pulled():
    """The finger with two forces in the same place, which snaps below 60 N."""
    simulation, push = finger("plane-stress")
    mechanism = simulation.scene.mechanism
    other = mechanism.force(on=push.on, at=push.at, direction=push.direction, name="other")
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=8.0), push, other


@pytest.mark.thorough
def test_prescribed_forces_and_constant_loads_snap_at_the_same_limit_however_far_they_go_beyond(pulled, caplog):
    simulation, push, other = pulled
    for load in (80.0, 8e4):
        (led,) = simulation.load_displacement(push, forces=[load]).frames
        (constant,) = simulation.load_displacement(push, forces=[0.0], others={other: load}).frames
        assert led.snapped_through and constant.snapped_through and led.stable and constant.stable
        assert constant.displacement == pytest.approx(led.displacement, rel=1e-8)
    limits = [float(found) for found in re.findall(r"between (\S+) and \S+ the path turns back", caplog.text)]
    assert limits * np.array([1.0, 80.0, 1.0, 8e4]) == pytest.approx([limits[0]] * 4, rel=1e-5)  # of printed digits


@pytest.mark.parametrize("beyond", [3.0, 1e3, 1e5])
def test_snap_through_is_logged_next_to_the_limit_load(caplog, beyond):
    case = toggle.toggle(stilt_modulus=100.0)
    limit = toggle.force(np.linspace(0.0, toggle.RISE, 100001)).max()
    assert case.simulation.load_displacement(case.push, forces=[beyond * limit]).snapped_through.all()
    ((before, after),) = re.findall(r"between (\S+) and (\S+) the path turns back", caplog.text)
    assert float(before) <= limit <= float(after) * (1.0 + 1e-6)
    assert float(after) - float(before) < limit / 32.0
