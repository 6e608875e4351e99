"""Paths that turn back in load and in displacement are followed whole, and their limit points found where they are."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import minimize_scalar

import fenicsmech as fm
from fenicsmech.continuation import ArcLengthStepper

from ..equilibrium import toggle
from ..equilibrium.arch import DISPLACEMENTS, RISE, arch, beam_forces
from ..equilibrium.deep_arch import LIMIT_LOAD, deep_arch

STIFF, SOFT = 200.0, 0.075  # MPa of the stilt: the force's point follows the toggle, or turns back while it snaps
SUNK = 12.0  # mm at the end


def extremum(function, low: float, high: float) -> float:
    """The maximum, to rounding, of a smooth function of the toggle's displacement."""
    return minimize_scalar(
        lambda sunk: -function(sunk), bounds=(low, high), method="bounded", options={"xatol": 1e-10}
    ).x


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d"])
@pytest.mark.parametrize("modulus", [STIFF, SOFT])
def test_toggle_goes_through_the_equilibria_of_the_closed_form_in_their_order(space, modulus):
    case = toggle.toggle(stilt_modulus=modulus, space=space)
    end = toggle.displacement(SUNK, modulus)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=end + 1.0))
    sunk = np.array([frame.outputs[case.sunk] for frame in curve.frames])
    assert np.all(np.diff(sunk) > 0.0) and sunk[-1] > SUNK
    assert curve.forces == pytest.approx(toggle.force(sunk), abs=1e-8)
    assert curve.displacements == pytest.approx(toggle.displacement(sunk, modulus), abs=1e-8)
    assert curve.displacements[-1] == pytest.approx(end + 1.0, rel=1e-9)
    slope = toggle.force(sunk + 1e-6) - toggle.force(sunk - 1e-6)
    clear = np.delete(np.arange(len(sunk)), [event.index for event in curve.events])
    assert np.array_equal(curve.stable[clear], slope[clear] > 0.0)


def test_limit_points_are_where_the_closed_form_has_its_extrema():
    case = toggle.toggle(stilt_modulus=STIFF)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=SUNK))
    highest, lowest = extremum(toggle.force, 0.0, 5.0), extremum(lambda sunk: -toggle.force(sunk), 5.0, 10.0)
    assert [event.kind for event in curve.events] == [fm.Critical.LIMIT] * 2
    assert [event.frame.outputs[case.sunk] for event in curve.events] == pytest.approx([highest, lowest], abs=1e-4)
    assert [event.frame.force for event in curve.events] == pytest.approx(toggle.force(np.array([highest, lowest])))
    assert [curve.frames[event.index] for event in curve.events] == [event.frame for event in curve.events]


def test_displacement_that_turns_back_is_followed_and_its_turning_points_found():
    case = toggle.toggle(stilt_modulus=SOFT)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=16.0))
    kinds = [event.kind for event in curve.events]
    assert kinds == [fm.Critical.LIMIT, fm.Critical.TURNING, fm.Critical.TURNING, fm.Critical.LIMIT]
    there = extremum(lambda sunk: toggle.displacement(sunk, SOFT), 0.0, 5.0)
    back = extremum(lambda sunk: -toggle.displacement(sunk, SOFT), 5.0, 10.0)
    found = [event.frame.outputs[case.sunk] for event in curve.turning_points]
    assert found == pytest.approx([there, back], abs=1e-3)
    travelled = [event.frame.displacement for event in curve.turning_points]
    assert travelled == pytest.approx(toggle.displacement(np.array([there, back]), SOFT), rel=1e-6)
    assert travelled[1] < travelled[0]
    sunk = np.array([frame.outputs[case.sunk] for frame in curve.frames])
    between = (sunk > there + 0.01) & (sunk < back - 0.01)
    held = np.array([frame.stable_under_control for frame in curve.frames])
    assert not held[between].any() and held[(sunk < there - 0.01) | (sunk > back + 0.01)].all()


def test_path_against_the_force_and_end_at_a_force():
    case = toggle.toggle(stilt_modulus=STIFF)
    pulled = case.simulation.follow(case.push, until=fm.Until(displacement=-1.0))
    assert np.all(np.diff(pulled.displacements) < 0.0) and pulled.displacements[-1] == pytest.approx(-1.0)
    sunk = np.array([frame.outputs[case.sunk] for frame in pulled.frames])
    assert pulled.forces == pytest.approx(toggle.force(sunk), abs=1e-8)
    pushed = case.simulation.follow(case.push, until=fm.Until(force=2.0))
    assert pushed.forces[-1] == pytest.approx(2.0, rel=1e-9) and len(pushed.limit_points) == 2
    back = case.simulation.follow(case.push, until=fm.Until(force=(0.0, 2.0)))
    assert back.forces[-1] == pytest.approx(0.0, abs=1e-9) and len(back.limit_points) == 1
    assert back.frames[-1].outputs[case.sunk] == pytest.approx(toggle.RISE, rel=1e-6)
    few = case.simulation.follow(case.push, until=fm.Until(force=2.0, frames=4))
    assert len(few.frames) == 4 and few.forces[-1] < 2.0 and not few.events


@pytest.mark.parametrize("largest", [pytest.param(0.02, marks=pytest.mark.thorough), 0.2])
def test_path_does_not_depend_on_its_steps(largest):
    case = toggle.toggle(stilt_modulus=SOFT)
    steps = fm.ArcSteps(largest=largest, first=0.5 * largest)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=16.0), steps=steps)
    sunk = np.array([frame.outputs[case.sunk] for frame in curve.frames])
    assert curve.forces == pytest.approx(toggle.force(sunk), abs=1e-8)
    assert len(curve.events) == 4


@pytest.mark.thorough
def test_shallow_arch_follows_the_beam_through_both_limit_points():
    simulation, push = arch()
    curve = simulation.follow(push, until=fm.Until(displacement=DISPLACEMENTS[-1]))
    expected = beam_forces(curve.displacements)
    assert curve.forces == pytest.approx(expected, rel=1e-2, abs=1e-12)
    upper, lower = curve.limit_points
    fine = beam_forces(np.linspace(0.5 * RISE, 1.6 * RISE, 201))
    assert upper.frame.force == pytest.approx(fine.max(), rel=3e-3)
    assert lower.frame.force == pytest.approx(fine.min(), rel=1e-2)


@pytest.mark.thorough
def test_deep_arch_reaches_the_limit_load_of_the_literature():
    simulation, push, drop = deep_arch()
    curve = simulation.follow(push, until=fm.Until(displacement=drop))
    (limit,) = curve.limit_points
    assert limit.frame.force == pytest.approx(LIMIT_LOAD, rel=1e-2)
    assert curve.stable[: limit.index].all() and not curve.stable[limit.index + 1 :].any()


@pytest.mark.parallel
def test_path_is_the_same_on_any_number_of_ranks():
    case = toggle.toggle(stilt_modulus=STIFF, comm=MPI.COMM_WORLD)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=3.0))
    sunk = np.array([frame.outputs[case.sunk] for frame in curve.frames])
    assert curve.forces == pytest.approx(toggle.force(sunk), abs=1e-8)
    assert [event.kind for event in curve.events] == [fm.Critical.LIMIT]


@pytest.mark.parametrize("until", [fm.Until(displacement=3.0), fm.Until(force=0.5 * toggle.force(2.0))])
def test_paths_end_at_the_prescribed_value_however_rounding_scatters_their_points(until, monkeypatch):
    between, rng = ArcLengthStepper.between, np.random.default_rng(0)

    def scattered(self, start, end, distance):
        return between(self, start, end, distance * (1.0 + 1e-3 * rng.standard_normal()))

    monkeypatch.setattr(ArcLengthStepper, "between", scattered)
    case = toggle.toggle(stilt_modulus=STIFF)
    last = case.simulation.follow(case.push, until=until).frames[-1]
    reached, wanted = (last.force, until.force) if until.force else (last.displacement, until.displacement)
    assert (reached,) == pytest.approx(wanted, rel=1e-12)
    assert last.force == pytest.approx(toggle.force(last.outputs[case.sunk]), abs=1e-8)


def test_path_of_a_mechanism_that_stiffens_a_hundredfold_takes_steps_by_the_size_of_its_force():
    # a crank with a spring turns towards a force at 45 degrees, F L sin(45° − θ) = k θ
    length, stiffness, reach = 20.0, 3.0, 1.0 - np.sqrt(0.5)
    mechanism = fm.Mechanism("crank")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")
    ribbon = mechanism.flexible(
        "ribbon", fm.strip([(0, 0), (0, 10)], thickness=1.0, depth=1.0), fm.Material("steel", 2e5, 0.3)
    )
    pivot = mechanism.revolute(base, crank, at=(0, 0))
    mechanism.weld(crank, ribbon, at=(0, 0.5), interface_radius=0.45)
    pull = mechanism.force(on=crank, at=(length, 0), direction=(1, 1))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(pivot, stiffness)])
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=1.0, comm=MPI.COMM_SELF)
    curve = simulation.follow(pull, until=fm.Until(displacement=0.999 * reach * length))
    assert len(curve.frames) < 200
    left = np.arccos(1.0 - 0.001 * reach)
    assert curve.frames[-1].force == pytest.approx(stiffness * (np.pi / 4 - left) / (length * np.sin(left)), rel=1e-6)
