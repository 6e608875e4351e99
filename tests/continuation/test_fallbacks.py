"""Fallbacks are tried in the order that ``LoadStepper``'s module states, and end after counted attempts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.continuation import DeadCentreStepper, HermitePredictor, LoadStepper, LoadSteps, LoadStepsFailed
from fenicsmech.effects import JointSpring
from fenicsmech.equilibrium import (
    EquilibriumPoint,
    EquilibriumSolver,
    InvertedGuess,
    LoadControl,
    NotConverged,
    Stability,
    State,
    Step,
)

from ..equilibrium import toggle
from ..simulation.demo_scenes import describe
from .test_limit_loads import OneFreedom, start


class Stubborn(OneFreedom):
    """A straight path y = p on which a solve succeeds if its step is short enough, as ``LoadStepper`` sees it.

    Args:
        longest: step that succeeds.
        alike: whether solves fail in the same way whatever the least shift.
        enduring: the same with more iterations; by default it finds nothing.
        hidden: whether rounding hides what resists.
        iterations: of a solve that succeeds.
    """

    def __init__(
        self,
        longest: float,
        *,
        alike: bool = False,
        enduring: Stubborn | None = None,
        hidden: bool = False,
        iterations: int = 4,
    ) -> None:
        super().__init__(hidden=hidden)
        self.needed = iterations
        self.longest, self.alike, self.enduring, self.reached = longest, alike, enduring, 0.0
        self.tried: list[tuple[float, float]] = []  # prescribed value and least shift of each solve
        self.failed = 0

    def patient(self, factor: int) -> Stubborn:
        assert factor == LoadSteps().snap_iterations
        return self.enduring or Stubborn(-1.0)

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        self.tried.append((control.prescribed, start.minimum_shift))
        if abs(control.prescribed - self.reached) > self.longest:
            self.failed += 1
            raise NotConverged("too far" + f" with a shift of {start.minimum_shift:g}" * (not self.alike), 25)
        self.reached = control.prescribed
        tangent = Step(np.ones(1), np.zeros(0), np.zeros(0), 1.0)
        state = State(np.array([self.reached]), np.zeros((0, 1)), np.zeros(0), self.reached, np.zeros(0))
        return EquilibriumPoint(state, control, tangent, 1.0, Stability(0, 0), self.needed, (0.0,), None)


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


def test_where_two_shifts_fail_alike_half_the_step_comes_before_the_third():
    path, shift = Stubborn(0.0, alike=True), LoadSteps().minimum_shift
    with pytest.raises(LoadStepsFailed) as failure:
        stepper(path, minimum_shift=shift).advance(LoadControl(0.1))
    assert [tried for _, tried in path.tried[1:]] == [shift, 1e-3 * shift] * len(failure.value.tried)
    assert failure.value.reason == "too far"


def test_where_no_turn_is_seen_one_longer_solve_comes_before_the_end():
    enduring = Stubborn(math.inf)
    path = Stubborn(0.0, enduring=enduring)
    with pytest.raises(LoadStepsFailed) as failure:
        stepper(path).advance(LoadControl(0.1))
    (found,) = [value for value, _ in enduring.tried]
    assert failure.value.reached == found and 0.0 < found <= 2.0 * LoadSteps().smallest * 0.1
    assert found in failure.value.tried


def test_where_rounding_hides_what_resists_a_few_failures_come_before_the_end():
    path = Stubborn(0.0, hidden=True)
    with pytest.raises(LoadStepsFailed) as failure:
        stepper(path).advance(LoadControl(0.1))
    assert failure.value.hidden and len(failure.value.tried) == LoadSteps().failures_hidden


def test_shifts_where_loads_resist_are_the_smallest_first_away_from_the_start_and_stay_so_after_failures():
    path, largest = Stubborn(0.0), LoadSteps().minimum_shift
    shifts = LoadSteps().least_shifts(largest, loads_resist=True)
    walk = LoadStepper(path, start(), LoadControl(), predictor=HermitePredictor(), shifts=shifts)
    path.reached = 1.0  # the start fails as well
    for wanted in (0.1, 0.1):
        with pytest.raises(LoadStepsFailed):
            walk.advance(LoadControl(wanted))
    for value, tried in ((0.0, shifts.at_start), (0.1, shifts.elsewhere)):
        used = [shift for prescribed, shift in path.tried if prescribed == value]
        assert used == [*tried] * 2
    assert shifts.at_start[0] == shifts.elsewhere[-1] == largest and shifts.at_start[-1] == shifts.elsewhere[0] == 0.0
    path.longest = math.inf
    walk.advance(LoadControl(0.1))
    assert path.tried[-1] == (0.1, 0.0)
    walk.advance(LoadControl(0.0))
    assert path.tried[-1] == (0.0, largest)


def test_steps_that_turn_links_come_before_half_the_step_and_the_kind_that_succeeded_comes_first():
    path, turning = Stubborn(0.0), Stubborn(math.inf)
    path.turning, turning.turning = turning, None
    walk = stepper(path)
    for wanted in (0.1, 0.2):
        assert walk.advance(LoadControl(wanted)).state.force == wanted
    assert [value for value, _ in path.tried] == [0.0, 0.1] and path.failed == 1
    assert [value for value, _ in turning.tried] == [0.1, 0.2]
    path.longest, turning.longest = math.inf, 0.0
    assert walk.advance(LoadControl(0.3)).state.force == 0.3
    assert path.tried[-1] == turning.tried[-1] == (0.3, 0.0)


@pytest.mark.parametrize("part", [2.0 * LoadSteps().smallest, 1.1 / 64.0, 0.1])  # halves of these are not too small
def test_a_path_on_which_only_steps_of_one_length_succeed_is_walked_to_its_end(part):
    path = Stubborn(0.1 * part)
    assert stepper(path).advance(LoadControl(0.1)).state.force == 0.1
    # steps double after each success, and halve: at most every other one fails
    assert path.failed <= 0.5 * len(path.tried) + math.log2(1.0 / part)


class ShortOnce(Stubborn):
    """Steps of any length succeed after the first one."""

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        point = super().solve(start, control)
        self.longest = math.inf if self.reached else self.longest
        return point


def test_steps_grow_where_all_of_them_take_as_many_iterations():
    part = 1.0 / 512.0
    path = ShortOnce(0.1 * part, iterations=2 * LoadSteps().iterations)
    assert stepper(path).advance(LoadControl(0.1)).state.force == 0.1
    # as many of each length, 1 + 2 + 4 + ... lengths of the first
    assert len(path.tried) - path.failed <= LoadSteps().steady * math.log2(1.0 / part / LoadSteps().steady + 1.0) + 2


class Inverting(Stubborn):
    """A straight path on which elements are inverted in all predictions but the last equilibrium."""

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        if start.u[0] not in (0.0, self.reached):
            raise InvertedGuess
        return super().solve(start, control)


def test_steps_whose_predictions_invert_elements_begin_at_the_last_equilibrium():
    path = Inverting(0.03)
    walk = stepper(path)
    for wanted in (0.02, 0.04, 0.06):
        assert walk.advance(LoadControl(wanted)).state.force == wanted
    assert path.failed == 0


class Folded(Stubborn):
    """A path y = p up to p = 0.1; from p = 0.2 on solves end far off, on another one, and in between nowhere."""

    def hides(self, state: State, control: LoadControl) -> bool:
        return False

    def solve(self, start: State, control: LoadControl) -> EquilibriumPoint:
        between = 0.1 < control.prescribed < 0.2
        self.reached, self.longest = control.prescribed, -1.0 if between else math.inf
        point = super().solve(start, control)
        far = 5.0 if control.prescribed >= 0.2 else 0.0
        return replace(point, state=replace(point.state, u=point.state.u + far))


def test_a_fold_beyond_which_an_equilibrium_is_known_is_approached_as_closely_as_others_and_no_closer():
    path = Folded(math.inf)
    walk = stepper(path)
    walk.advance(LoadControl(0.1))
    assert walk.advance(LoadControl(0.2)).state.force == 0.2
    assert walk.snaps == 1
    nearest = min(value - 0.1 for value, _ in path.tried if value > 0.1)
    assert nearest == pytest.approx(0.1 * 2.0 * LoadSteps().smallest_snap_step, rel=0.6)


@pytest.mark.parametrize("before", [1e-17, 1e-12, 1e-6, 1e-2])  # the first is one of rounding
def test_steps_that_only_fail_end_after_a_bounded_number_with_the_last_equilibrium(before):
    path = Stubborn(math.inf)
    walk = stepper(path)
    walk.advance(LoadControl(before))
    path.longest, solved = 0.0, len(path.tried)
    with pytest.raises(LoadStepsFailed, match="too far") as failure:
        walk.advance(LoadControl(1.0))
    steps = LoadSteps()
    covered = before if before > 0.5**steps.failures else steps.motion
    halvings = math.ceil(math.log2(steps.motion / (covered * steps.smallest)))  # motions limit the first step
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

    def counted(self, *args, **options):
        counts[-1] += 1
        return factor(self, *args, **options)

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


def test_an_arm_that_nothing_resists_gets_to_a_table_as_a_rigid_body_where_load_steps_fail(monkeypatch):
    mechanism = fm.Mechanism("arm above a table")
    base, shape = mechanism.rigid("base", fixed=True), fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=3.0)
    arm = mechanism.flexible("arm", shape, fm.Material("rubber", 5.0, 0.45))
    mechanism.revolute(base, arm, at=(0, 0), interface_radius=1.2)
    push = mechanism.force(on=arm, at=(38, 0), direction=(0, -1))
    scene = fm.Scene(mechanism, effects=[fm.Contact(arm, fm.HalfPlane((0, -10), (0, 1)))])
    simulation = fm.Simulation(scene, space="plane-stress", size=2.5, comm=MPI.COMM_SELF)
    (stepped,) = simulation.load_displacement(push, forces=[1e-5]).frames

    def advance(self, control, **options):
        raise LoadStepsFailed(None, 0.0, "refused", (control.prescribed,))

    monkeypatch.setattr(LoadStepper, "advance", advance)
    (moved,) = simulation.load_displacement(push, forces=[1e-5]).frames
    assert 8.0 < stepped.displacement < 8.5  # the arm begins 8.5 above, and its tip is farther out
    assert moved.displacement == pytest.approx(stepped.displacement, rel=1e-8)


def test_an_arm_turns_over_against_a_small_constant_load_where_load_steps_fail(monkeypatch):
    mechanism = fm.Mechanism("arm")
    base, shape = mechanism.rigid("base", fixed=True), fm.strip([(0, 0), (40, 0)], thickness=3.0, depth=3.0)
    arm = mechanism.flexible("arm", shape, fm.Material("rubber", 5.0, 0.45))
    mechanism.revolute(base, arm, at=(0, 0), interface_radius=1.2)
    push = mechanism.force(on=arm, at=(38, 0), direction=(0, 1))
    weight = mechanism.force(on=arm, at=(38, 0), direction=(0, -1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=2.5, comm=MPI.COMM_SELF)
    advance, refused = LoadStepper.advance, []

    def refuse(self, control, **options):
        if control.prescribed == 1e-4 and not refused:
            refused.append(control.prescribed)
            raise LoadStepsFailed(None, 0.0, "refused", (control.prescribed,))
        return advance(self, control, **options)

    monkeypatch.setattr(LoadStepper, "advance", refuse)
    up, higher = simulation.load_displacement(push, forces=[1e-4, 2e-4], others={weight: 1e-8}).frames
    # from lying, as drawn, to standing; without the push it hangs
    assert [up.displacement, higher.displacement] == pytest.approx([38.0, 38.0], rel=1e-5)
    assert up.stable and higher.stable
    assert higher.iterations < 12


def test_a_point_that_straight_links_keep_back_is_said_to_be_out_of_reach():
    mechanism = fm.Mechanism("two bars beside a leaf")
    base, near, far = mechanism.rigid("base", fixed=True), mechanism.rigid("near"), mechanism.rigid("far")
    hinges = [mechanism.revolute(base, near, at=(0, 0)), mechanism.revolute(near, far, at=(30, 10))]
    shape = fm.strip([(0, -20), (30, -20)], thickness=2.0, depth=2.0)
    leaf = mechanism.flexible("leaf", shape, fm.Material("rubber", 5.0, 0.45))
    mechanism.weld(base, leaf, at=(0, -20), interface_radius=0.8)
    pull = mechanism.force(on=far, at=(60, 0), direction=(1, 0))
    scene = fm.Scene(mechanism, effects=[JointSpring(hinge, 1.0) for hinge in hinges])
    simulation = fm.Simulation(scene, space="plane-stress", size=5.0, comm=MPI.COMM_SELF)
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(pull, displacements=[2.0, 4.0])
    assert "straight" in caught.value.remedy
    reach = 2.0 * math.hypot(30.0, 10.0) - 60.0
    assert reach - 2e-3 < caught.value.last.displacement < reach


@pytest.mark.parametrize("most", [4, fm.PrimalDualNewton().factorisations])
def test_a_solve_ends_after_the_factorisations_it_is_given(factorisations, most):
    scene, push = describe("truss")
    method = fm.PrimalDualNewton(factorisations=most)
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=8.0, solver=method)
    with pytest.raises(fm.EquilibriumError):
        simulation.load_displacement(push, displacements=[500.0])
    assert max(factorisations) <= most + method.shifts
    assert (max(factorisations) > 4 + method.shifts) == (most > 4)


def refuse(monkeypatch, reached: float = 0.0) -> list[float]:
    """Makes load steps past dead centres fail once they have ``reached`` a value; returns those that they were asked
    for."""
    asked = []

    def advance(self, control, **options):
        asked.append(control.prescribed)
        raise LoadStepsFailed(None, reached, "refused", (control.prescribed,))

    monkeypatch.setattr(DeadCentreStepper, "advance", advance)
    return asked


def pulled(angle: float) -> tuple[fm.Simulation, fm.Force, fm.Configuration]:
    """A crank whose motor stretches a band that is pinned to the ground."""
    mechanism = fm.Mechanism("crank and band")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")
    shape = fm.strip([(-2, 20), (62, 20)], thickness=4.0, depth=3.0)
    band = mechanism.flexible("band", shape, fm.Material("rubber", 5.0, 0.45))
    drive = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    mechanism.revolute(crank, band, at=(0, 20), interface_radius=1.5)
    mechanism.revolute(base, band, at=(60, 20), interface_radius=1.5)
    push = mechanism.force(on=band, at=(30, 20), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", order=1, size=4.0, comm=MPI.COMM_SELF)
    return simulation, push, simulation.scene.configuration("turned", {drive: angle})


def test_motors_whose_load_steps_fail_are_followed_by_arc_length_to_the_same_equilibrium(monkeypatch):
    simulation, push, turned = pulled(0.5)
    (stepped,) = simulation.load_displacement(push, forces=[0.1], configuration=turned).frames
    asked = refuse(monkeypatch)
    (followed,) = simulation.load_displacement(push, forces=[0.1], configuration=turned).frames
    assert asked and stepped.strain_energy > 1.0  # of a band that is a sixth longer
    assert followed.displacement == pytest.approx(stepped.displacement, rel=1e-8)
    assert followed.motors == pytest.approx(stepped.motors, rel=1e-8)


def test_constant_loads_whose_steps_fail_start_where_they_balance_with_springs(monkeypatch):
    # a stiff arm on a spring, and a link with a weight that hangs from its end: k φ = W L cos φ
    mechanism, stiffness, weight, length = fm.Mechanism("arm"), 30.0, 2.0, 40.0
    base, bob = mechanism.rigid("base", fixed=True), mechanism.rigid("bob")
    shape = fm.strip([(0, 0), (length + 1.0, 0)], thickness=4.0, depth=4.0)
    arm = mechanism.flexible("arm", shape, fm.Material("steel", 2e5, 0.3))
    hinge = mechanism.revolute(base, arm, at=(0, 0), interface_radius=1.5)
    mechanism.revolute(arm, bob, at=(length, 0), interface_radius=1.5)
    hung = mechanism.force(on=bob, at=(length + 10.0, 0), direction=(0, -1), name="weight")
    push = mechanism.force(on=bob, at=(length + 10.0, 0), direction=(1, 0), name="push")
    scene = fm.Scene(mechanism, effects=[JointSpring(hinge, stiffness)])
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=4.0, comm=MPI.COMM_SELF)
    asked = refuse(monkeypatch)
    (frame,) = simulation.load_displacement(push, forces=[0.0], others={hung: weight}).frames
    angle = brentq(lambda phi: stiffness * phi - weight * length * np.cos(phi), 0.0, 0.5 * np.pi)
    assert asked and frame.stable and frame.snapped_through
    assert frame.displacement == pytest.approx(length * np.cos(angle) - length - 10.0, abs=1e-2)


def test_constant_loads_whose_path_turns_back_start_at_its_first_stable_end(monkeypatch):
    # a dead weight beyond the limit load of a toggle, on a stilt so stiff that it does not turn back itself
    case = toggle.toggle(stilt_modulus=1e3)
    mechanism = case.simulation.scene.mechanism
    (head,) = (link for link in mechanism.links if link.name == "head")
    weight = mechanism.force(on=head, at=(0, toggle.RISE + toggle.STILT), direction=(0, -1), name="weight")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", order=1, size=6.0, comm=MPI.COMM_SELF)
    limit = max(toggle.force(np.linspace(0.0, toggle.RISE, 1000)))
    asked = refuse(monkeypatch, reached=0.8)
    (frame,) = simulation.load_displacement(case.push, forces=[0.0], others={weight: 1.1 * limit}).frames
    sunk = brentq(lambda s: toggle.force(np.array(s)) - 1.1 * limit, 2.0 * toggle.RISE, 3.0 * toggle.RISE)
    assert asked and frame.stable and frame.snapped_through
    assert frame.outputs[case.sunk] == pytest.approx(sunk, rel=1e-8)
