"""Mechanisms that nothing but loads holds: equilibria start from the rigid pose that the loads prefer."""

import logging
import math
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.continuation import ArcLengthStepper, LoadStepper
from fenicsmech.equilibrium import EquilibriumSolver
from fenicsmech.multibody import PosePotential, RestEnding, RestSearch

LENGTH = 60.0
WIDTH, DEPTH = 2.0, 5.0
NEAR, CORNER = 0.95 * LENGTH, math.hypot(LENGTH, 0.5 * WIDTH)  # distances from the hinge


def simulated(mechanism: fm.Mechanism, *effects: fm.Effect, comm: MPI.Comm = MPI.COMM_SELF) -> fm.Simulation:
    return fm.Simulation(fm.Scene(mechanism, effects=effects), space="plane-stress", size=2.0, comm=comm)


def pendulum(direction, *effects, comm: MPI.Comm = MPI.COMM_SELF):
    """A rod that hangs from a hinge, drawn straight down, with a force at its lower end.

    effects: or functions that make them for the rod.
    """
    mechanism = fm.Mechanism("pendulum")
    base = mechanism.rigid("base", fixed=True)
    material = fm.Material("nylon", 1770.0, 0.42, density=1e-6)
    rod = mechanism.flexible("rod", fm.strip([(0, 0), (0, -LENGTH)], thickness=WIDTH, depth=DEPTH), material)
    mechanism.revolute(base, rod, at=(0, 0), interface_radius=1.0)
    pull = mechanism.force(on=rod, at=(0, -LENGTH), direction=direction, name="pull")
    own = [effect if isinstance(effect, fm.Effect) else effect(rod) for effect in effects]
    return simulated(mechanism, *own, comm=comm), pull


def four_bar(direction=(1, 0)):
    """Four hinges, a flexible coupler and a force on the rocker: nothing holds the crank."""
    mechanism = fm.Mechanism("four-bar")
    base, crank, rocker = mechanism.rigid("base", fixed=True), mechanism.rigid("crank"), mechanism.rigid("rocker")
    shape = fm.strip([(10, 30), (70, 45)], thickness=WIDTH, depth=DEPTH)
    coupler = mechanism.flexible("coupler", shape, fm.ONYX)
    mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, coupler, at=(10, 30), interface_radius=1.0)
    mechanism.revolute(coupler, rocker, at=(70, 45), interface_radius=1.0)
    mechanism.revolute(rocker, base, at=(80, 0))
    pull = mechanism.force(on=rocker, at=(70, 45), direction=direction, name="pull")
    return simulated(mechanism), pull


def rssr(angle: float):
    """A four-bar in space whose crank is drawn at an angle to its coupler, and free to turn."""
    mechanism = fm.Mechanism("RSSR four-bar")
    ground, crank, rocker = (mechanism.rigid(name, fixed=name == "ground") for name in ("ground", "crank", "rocker"))
    end = (20.0 * math.cos(angle), 20.0 * math.sin(angle))
    coupler = mechanism.flexible("coupler", fm.strip([end, (80, 0)], thickness=3.0, depth=3.0), fm.ONYX)
    mechanism.revolute(ground, crank, at=(0, 0, 0))
    mechanism.spherical(crank, coupler, at=(*end, 0), interface_radius=1.5)
    mechanism.spherical(coupler, rocker, at=(80, 0, 0), interface_radius=1.5)
    mechanism.revolute(rocker, ground, at=(80, 0, 40), axis=(0, 1, 0))
    pull = mechanism.force(on=rocker, at=(80, 0, 10), direction=(1, 0, 0), name="pull")
    return fm.Simulation(fm.Scene(mechanism), space="3d", size=3.0, comm=MPI.COMM_SELF), pull


def test_pulled_rod_swings_into_the_line_of_the_force_and_stretches_there():
    simulation, pull = pendulum((1, 0))
    curve = simulation.load_displacement(pull, forces=[0.0, 1e-3, 1.0, 2.0])
    assert curve.displacements[0] == 0.0
    assert curve.displacements[1] == pytest.approx(LENGTH, rel=1e-6)
    # an end at y = 0, and of the tension all but what the hinge's disc takes
    stretched = curve.displacements[1:] - LENGTH
    assert stretched[2] / stretched[1] == pytest.approx(2.0, rel=1e-3)
    assert stretched[1] == pytest.approx(LENGTH / (1770.0 * WIDTH * DEPTH), rel=0.05)
    for frame in curve.frames[1:]:
        assert frame.stable and not frame.snapped_through and frame.iterations <= 5


@pytest.mark.parametrize(
    "describe",
    [pytest.param(four_bar, id="plane"), pytest.param(lambda: rssr(0.6), id="space", marks=pytest.mark.thorough)],
)
def test_load_steps_agree_with_the_path_that_is_followed(describe):
    simulation, pull = describe()
    curve = simulation.load_displacement(pull, forces=[1e-3, 5.0, 20.0])
    followed = simulation.follow(pull, until=fm.Until(force=20.0))
    assert curve.displacements[-1] == pytest.approx(followed.displacements[-1], rel=1e-8)
    assert followed.events == () and followed.frames[-1].stable
    assert curve.stable.all() and not curve.snapped_through.any()
    assert max(frame.iterations for frame in curve.frames) <= 5


def test_displacements_within_free_reach_need_no_force_and_those_beyond_it_that_of_load_steps():
    simulation, pull = four_bar()
    pulled = simulation.load_displacement(pull, forces=[1e-3, 10.0])
    reach, end = pulled.displacements
    curve = simulation.load_displacement(pull, displacements=[0.2 * reach, 0.9 * reach, end])
    assert np.abs(curve.forces[:2]).max() < 1e-9
    assert curve.forces[2] == pytest.approx(10.0, rel=1e-6)
    assert curve.stable.all() and not curve.snapped_through.any()
    followed = simulation.follow(pull, until=fm.Until(displacement=0.5 * reach))
    assert followed.displacements == pytest.approx([0.0, 0.5 * reach])
    assert abs(followed.forces[-1]) < 1e-9


def test_rod_drawn_against_its_push_is_unstable_under_any_force_and_reports_no_bifurcation():
    simulation, push = pendulum((0, 1))
    curve = simulation.load_displacement(push, forces=[1e-3, 0.1])
    assert [frame.unstable_modes for frame in curve.frames] == [1, 1]
    followed = simulation.follow(push, until=fm.Until(force=1.0))
    assert followed.events == ()
    assert {frame.unstable_modes for frame in followed.frames[1:]} == {1}


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_weight_holds_a_rod_before_the_force_begins(sense):
    gravity = 9810.0
    simulation, pull = pendulum((1, 0), fm.Gravity((gravity, 0.0)))
    weight = 1e-6 * gravity * LENGTH * WIDTH * DEPTH
    curve = simulation.load_displacement(pull, forces=[0.0, sense * 0.01 * weight])
    # along x in both cases: half the weight is more than the force
    assert curve.displacements == pytest.approx([LENGTH, LENGTH], rel=1e-3)
    assert not curve.snapped_through.any() and curve.frames[0].stable
    assert max(frame.iterations for frame in curve.frames) <= 5


@pytest.mark.parametrize(
    "comm", [MPI.COMM_SELF, pytest.param(MPI.COMM_WORLD, marks=pytest.mark.parallel)], ids=["alone", "ranks"]
)
def test_force_that_returns_to_zero_and_changes_sign_pulls_the_rod_to_the_other_side(comm):
    simulation, pull = pendulum((1, 0), comm=comm)
    curve = simulation.load_displacement(pull, forces=[1.0, 0.0, -1.0])
    there, back, opposite = curve.displacements
    assert there > LENGTH
    assert back == pytest.approx(LENGTH, rel=1e-9)
    assert opposite == pytest.approx(-there, rel=1e-9)
    assert curve.stable.all() and not curve.snapped_through.any()
    assert max(frame.iterations for frame in curve.frames) <= 5


def test_displacements_beyond_reach_pull_from_one_pose_that_is_found_once(monkeypatch):
    sought, search = [], RestSearch.pose

    def counted(self, *given):
        sought.append(search(self, *given))
        return sought[-1]

    monkeypatch.setattr(RestSearch, "pose", counted)
    simulation, pull = pendulum((1, 0))
    displacements = [1.001 * LENGTH, 1.002 * LENGTH, -1.001 * LENGTH, -1.002 * LENGTH]
    curve = simulation.load_displacement(pull, displacements=displacements)
    assert len(sought) == 2
    assert curve.forces[2:] == pytest.approx(-curve.forces[:2], rel=1e-6)
    assert curve.stable.all()


def test_search_that_finds_no_pose_keeps_the_last_start_and_says_what_to_do(monkeypatch, caplog):
    simulation, pull = pendulum((1, 0))
    search, started, set_up = RestSearch.pose, [], LoadStepper.__init__

    def failing(self, *given):
        turn = search(self, *given)
        return replace(turn, ending=RestEnding.NOT_CONVERGED) if started else turn

    def counted(self, *given, **options):
        started.append(self)
        set_up(self, *given, **options)

    monkeypatch.setattr(RestSearch, "pose", failing)
    monkeypatch.setattr(LoadStepper, "__init__", counted)
    curve = simulation.load_displacement(pull, displacements=[1.001 * LENGTH, 1.0005 * LENGTH])
    assert len(started) == 1
    assert curve.forces[0] == pytest.approx(2.0 * curve.forces[1], rel=1e-2)
    assert curve.stable.all()
    (message,) = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert "'pull' in configuration 'as drawn', displacement 60.03" in message and "200 steps" in message
    assert "Draw it nearer to rest, or add a spring" in message


def test_displacements_that_return_into_free_reach_need_no_force_again():
    simulation, pull = pendulum((1, 0))
    curve = simulation.load_displacement(pull, displacements=[1.001 * LENGTH, 0.5 * LENGTH])
    assert curve.forces[0] > 1.0
    assert abs(curve.forces[1]) < 1e-9 and curve.frames[1].stable


@pytest.fixture
def solved(monkeypatch):
    """Equilibria as they are solved."""
    points, solve = [], EquilibriumSolver.solve

    def counted(self, start, control):
        points.append(solve(self, start, control))
        return points[-1]

    monkeypatch.setattr(EquilibriumSolver, "solve", counted)
    return points


def test_iterations_of_constant_loads_are_those_of_the_frame_that_they_lead_to(solved):
    simulation, pull = pendulum((1, 0), fm.Gravity((9810.0, 0.0)))
    frames = simulation.load_displacement(pull, forces=[0.0, 0.01]).frames
    assert sum(frame.iterations for frame in frames) == sum(point.iterations for point in solved)
    assert len(solved) > 3  # load steps of the weight, the settled start, and one of each force


def test_iterations_of_motors_that_wind_up_springs_are_those_of_the_first_frame(solved):
    mechanism = fm.Mechanism("wound rod")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")
    rod = mechanism.flexible("rod", fm.strip([(20, 0), (60, 0)], thickness=WIDTH, depth=DEPTH), fm.ONYX)
    motor = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    elbow = mechanism.revolute(crank, rod, at=(20, 0), interface_radius=1.0)
    pull = mechanism.force(on=rod, at=(60, 0), direction=(0, 1), name="pull")
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(elbow, 1e3)])
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    turned = scene.configuration("turned", {motor: 0.5})
    frames = simulation.load_displacement(pull, forces=[0.0, 0.1], configuration=turned).frames
    assert sum(frame.iterations for frame in frames) == sum(point.iterations for point in solved)
    assert len(solved) > 3  # steps of the motor as well


def test_time_of_the_search_for_a_pose_is_that_of_the_frame_that_it_leads_to(monkeypatch):
    search = RestSearch.pose

    def slow(self, *given):
        time.sleep(1.0)
        return search(self, *given)

    simulation, pull = pendulum((1, 0))
    began = time.perf_counter()
    monkeypatch.setattr(RestSearch, "pose", slow)
    frames = simulation.load_displacement(pull, forces=[1e-3, -1e-3]).frames
    whole = time.perf_counter() - began
    assert all(frame.seconds > 1.0 for frame in frames)
    assert sum(frame.seconds for frame in frames) < whole


class Tripwire(PosePotential):
    """No potential, but one that does not hold once its body has turned."""

    def __init__(self, body: int) -> None:
        self.bodies = (body,)

    def value(self, poses):
        return 0.0

    def gradient(self, poses):
        return np.zeros(poses.shape[1])

    def hessian(self, poses):
        return np.zeros(2 * poses.shape[1:])

    def check_step(self, before, after):
        if abs(after[self.bodies[0], 2]) > 1.0:
            raise fm.EquilibriumError("tripwire", "the rod has turned", "Turn it less")


@dataclass(frozen=True)
class Wired(fm.Effect):
    """A tripwire on a link."""

    link: object

    def explain(self):
        return "a tripwire"

    def pose_potentials(self, linkage):
        return [Tripwire(linkage.interfaces[self.link][0])]


def test_frames_so_far_are_kept_where_constant_loads_cannot_be_applied_in_the_pose_of_the_next():
    simulation, pull = pendulum((1, 0), Wired)
    with pytest.raises(fm.EquilibriumError, match="tripwire") as caught:
        simulation.load_displacement(pull, forces=[0.0, 1.0])
    assert [frame.force for frame in caught.value.frames] == [0.0]


@dataclass(frozen=True)
class Couple(fm.Effect):
    """Body forces along x that grow from the rod's middle towards both ends, in opposite senses: they have no sum."""

    link: object

    def explain(self):
        return "a couple"

    def link_energy(self, fields):
        along = -fields.body.rest[1] - 0.5 * LENGTH  # from the middle towards the lower end
        return fields.integral(-1e-3 * along * fields.u[0], degree=1 + fields.order)


def test_body_forces_without_a_sum_turn_a_rod_by_their_moments():
    simulation, pull = pendulum((1, 0), Couple)
    (frame,) = simulation.load_displacement(pull, forces=[0.0]).frames
    # opposite dead forces along x, at both halves, are in equilibrium with the rod along x
    assert frame.displacement == pytest.approx(LENGTH, rel=1e-3)
    assert frame.stable and not frame.snapped_through


@pytest.mark.parametrize("gap", [1e-9, 1e-3])
def test_rod_drawn_close_to_a_wall_is_pulled_away_from_it(gap):
    wall = fm.HalfPlane((-0.5 * WIDTH - gap, 0), (1, 0))
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, wall))
    (frame,) = simulation.load_displacement(pull, forces=[1e-3]).frames
    assert frame.displacement == pytest.approx(LENGTH, rel=1e-6)
    assert frame.stable and not frame.snapped_through


def test_loads_that_balance_on_a_link_leave_its_rest_to_rounding():
    # the rod starts as drawn, since a wall is in its way, and nothing but rounding resists the pressure's steps
    wall = fm.HalfPlane((0.5 * LENGTH, 0), (-1, 0))
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, wall), lambda rod: fm.Pressure(rod, -17.6))
    frames = simulation.load_displacement(pull, displacements=[0.4 * LENGTH, 0.6 * LENGTH]).frames
    assert frames[0].displacement == pytest.approx(0.4 * LENGTH)
    assert frames[1].force > 0.0


def beside(angle: float, radius: float, distance: float = NEAR) -> fm.Cylinder:
    """A pin at a distance from the hinge, ``angle`` ahead of a rod that hangs straight down."""
    return fm.Cylinder((distance * math.sin(angle), -distance * math.cos(angle)), radius)


@pytest.mark.parametrize(
    "effect",
    [
        pytest.param(lambda rod: fm.Pressure(rod, 1e-3), id="pressure all round"),
        pytest.param(lambda rod: fm.Prestrain(rod, 1.001), id="prestrain"),
        pytest.param(lambda rod: fm.Contact(rod, fm.HalfPlane((0, 10), (0, -1))), id="obstacle out of reach"),
        pytest.param(lambda rod: fm.Contact(rod, beside(0.7, 3.0, CORNER + 3.5)), id="pin that the rod just passes"),
    ],
)
def test_loads_that_prefer_no_pose_leave_that_to_the_force(effect):
    simulation, pull = pendulum((1, 0), effect)
    (frame,) = simulation.load_displacement(pull, forces=[1e-3]).frames
    assert frame.displacement == pytest.approx(LENGTH, rel=2e-3)
    assert frame.stable and not frame.snapped_through


@pytest.mark.parametrize(
    ("obstacle", "touching"),
    [
        # the angle at which the rod's side, or for the wall its end's corner, touches
        pytest.param(beside(0.7, 3.0), 0.7 - math.asin((3.0 + 0.5 * WIDTH) / NEAR), id="pin"),
        pytest.param(
            beside(0.8, 1.0), 0.8 - math.asin((1.0 + 0.5 * WIDTH) / NEAR), id="thin pin", marks=pytest.mark.thorough
        ),
        pytest.param(
            fm.HalfPlane((20, 0), (-1, 0)), math.asin(20.0 / CORNER) - math.atan(0.5 * WIDTH / LENGTH), id="wall"
        ),
    ],
)
def test_rod_stops_at_an_obstacle_on_its_way_and_the_log_says_why_it_starts_as_drawn(obstacle, touching, caplog):
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, obstacle))
    with caplog.at_level(logging.INFO, logger="fenicsmech"):
        (frame,) = simulation.load_displacement(pull, forces=[1e-2]).frames
    assert "start from the pose as drawn" in caplog.text and "'rod' meets" in caplog.text
    assert frame.displacement == pytest.approx(LENGTH * math.sin(touching), rel=5e-3)


def test_path_until_a_force_begins_at_a_part_of_it_and_is_the_only_one_that_is_set_up(monkeypatch):
    made, set_up = [], ArcLengthStepper.__init__

    def counted(self, *given, **options):
        made.append(self)
        set_up(self, *given, **options)

    monkeypatch.setattr(ArcLengthStepper, "__init__", counted)
    simulation, pull = pendulum((1, 0))
    curve = simulation.follow(pull, until=fm.Until(force=2.0), steps=fm.ArcSteps(first_load=0.05))
    assert curve.forces[:2] == pytest.approx([0.0, 0.1]) and curve.forces[-1] == pytest.approx(2.0)
    assert len(made) == 1


@pytest.mark.parametrize("scale", [1e-3, 1.0, 20.0])
def test_path_beyond_the_travel_of_a_rigid_pendulum_says_that_it_ends(scale):
    mechanism, length = fm.Mechanism("rigid pendulum"), scale * LENGTH
    base, rod = mechanism.rigid("base", fixed=True), mechanism.rigid("rod")
    strip = fm.strip([(0, -length), (10 * scale, -length)], thickness=scale * WIDTH, depth=scale * DEPTH)
    flag = mechanism.flexible("flag", strip, fm.ONYX)
    mechanism.revolute(base, rod, at=(0, 0))
    mechanism.weld(rod, flag, at=(0, -length), interface_radius=scale)
    pull = mechanism.force(on=rod, at=(0, -length), direction=(1, 0), name="pull")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=2.0 * scale, comm=MPI.COMM_SELF)
    for end in (fm.Until(displacement=2.0 * length), fm.Until(displacement=2.0 * length, force=1e3 * scale**2)):
        with pytest.raises(fm.EquilibriumError, match=f"moves nothing beyond displacement {length:g}, where travel"):
            simulation.follow(pull, until=end)
    reached = simulation.follow(pull, until=fm.Until(displacement=length))
    assert reached.displacements[-1] == pytest.approx(length)  # a dead centre: any force is in equilibrium there


@pytest.mark.parallel
def test_rod_stops_at_a_wall_that_the_points_of_some_ranks_meet():
    wall = fm.HalfPlane((20, 0), (-1, 0))
    shared, alone = (
        pendulum((1, 0), lambda rod: fm.Contact(rod, wall), comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    (frame,), (same,) = (
        simulation.load_displacement(pull, forces=[1e-2]).frames for simulation, pull in (shared, alone)
    )
    assert frame.displacement == pytest.approx(same.displacement, rel=1e-8)


def test_path_of_a_rod_that_gravity_has_swung_aside_begins_there_and_works_against_it():
    simulation, pull = pendulum((1, 0), fm.Gravity((98.1, 98.1)))
    end = 0.5 * LENGTH
    followed = simulation.follow(pull, until=fm.Until(displacement=end))
    assert followed.displacements[0] == pytest.approx(LENGTH * math.sqrt(0.5), rel=1e-3)
    assert followed.displacements[-1] == pytest.approx(end)
    # weight along x and y, half of it at the end, with the force there: the rod is in line with their sum
    half = 0.5 * 1e-6 * 98.1 * LENGTH * WIDTH * DEPTH
    assert followed.forces[-1] == pytest.approx(half * (end / math.sqrt(LENGTH**2 - end**2) - 1.0), rel=5e-3)


@pytest.mark.parametrize("end", [fm.Until(force=1e-2), fm.Until(displacement=19.15)], ids=["force", "displacement"])
def test_path_of_a_rod_that_meets_a_wall_on_its_way_starts_there(end):
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, fm.HalfPlane((20, 0), (-1, 0))))
    followed = simulation.follow(pull, until=end)
    touching = math.asin(20.0 / CORNER) - math.atan(0.5 * WIDTH / LENGTH)
    assert followed.displacements[1] == pytest.approx(LENGTH * math.sin(touching), rel=5e-3)
    assert (followed.forces[-1] == pytest.approx(1e-2)) if end.force else (followed.displacements[-1] > 19.149)
    assert followed.stable.all() and followed.events == ()


def test_path_to_a_place_before_the_wall_that_the_rod_meets_needs_no_force():
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, fm.HalfPlane((20, 0), (-1, 0))))
    followed = simulation.follow(pull, until=fm.Until(displacement=5.0))
    assert followed.displacements == pytest.approx([0.0, 5.0], abs=1e-9)
    assert followed.forces == pytest.approx(0.0, abs=1e-12)
    assert followed.events == ()


def test_rod_falls_to_a_wall_as_a_rigid_body_after_a_frame_without_a_force_as_well():
    simulation, pull = pendulum((1, 0), lambda rod: fm.Contact(rod, fm.HalfPlane((20, 0), (-1, 0))))
    (alone,) = simulation.load_displacement(pull, forces=[1e-2]).frames
    rest, after = simulation.load_displacement(pull, forces=[0.0, 1e-2]).frames
    assert rest.displacement == pytest.approx(0.0, abs=1e-9)
    assert after.displacement == pytest.approx(alone.displacement, rel=1e-8)
    assert rest.iterations + after.iterations <= alone.iterations + 2
