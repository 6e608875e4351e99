"""Design problems that contradict themselves or their scene: refused at once, naming part and remedy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech import model

from .mechanisms import Case, bow, pinned_links, strained, truss
from .refusal import refused

pytestmark = pytest.mark.usefixtures("nothing_is_meshed")

REACHABLE = ((0.1, 2.0), (0.4, 3.2))


@pytest.fixture
def nothing_is_meshed(monkeypatch):
    """Fails the test if something is meshed."""

    def meshed(*arguments, **options):
        raise AssertionError("a link was meshed")

    monkeypatch.setattr(model, "mesh_link", meshed)


def test_no_link_may_change():
    case = truss(*REACHABLE)
    refused(
        lambda: Case(case.scene, [], case.targets).problem(),
        part="design problem",
        problem="no link or number may change",
        remedy="SplineDesign",
    )


def test_a_link_is_given_twice():
    case = truss(*REACHABLE)
    refused(
        lambda: Case(case.scene, [*case.designs, *case.designs], case.targets).problem(),
        part="'diagonal'",
        problem="twice",
        remedy="once",
    )


def test_an_accuracy_that_has_chosen_nothing_yet():
    case = truss(*REACHABLE)
    simulation = fm.Simulation(case.scene, accuracy=0.01, comm=MPI.COMM_SELF)
    refused(
        lambda: fm.DesignProblem(simulation, case.designs, targets=case.targets),
        part="design problem",
        problem="no fidelity has been chosen",
        remedy="load_displacement",
    )


def test_a_force_added_later_that_leaves_the_plane():
    case = truss(*REACHABLE)
    simulation, push = case.simulate(), case.targets[0].quantity.part
    late = case.scene.mechanism.force(on=push.on, at=push.at, direction=(1, 0, 1), name="late")
    refused(
        lambda: fm.DesignProblem(simulation, case.designs, targets=[fm.Target(late, force=0.1, displacement=2.0)]),
        part="'late'",
        problem="leaves the plane",
        remedy="space",
    )


def test_a_link_of_another_mechanism():
    case, other = truss(*REACHABLE), bow()
    refused(
        lambda: Case(case.scene, other.designs, case.targets).problem(),
        part="'arch'",
        problem="not a flexible link of 'truss finger'",
        remedy="one of its links",
    )


def test_a_link_that_looks_the_same_but_is_another():
    case = truss(*REACHABLE)
    thinner = fm.strip([(0, 0), (18, 34), (40, 60)], thickness=2.0, depth=20.0)
    twin = fm.Mechanism("twin").flexible("diagonal", thinner, fm.SMOOTH_SIL_950)
    refused(
        lambda: Case(case.scene, [fm.SplineDesign(twin, 3)], case.targets).problem(),
        part="'diagonal'",
        problem="not a flexible link",
        remedy="one of its links",
    )


def test_a_rigid_link():
    tip = truss().scene.mechanism.rigid_links[-1]
    refused(
        lambda: fm.SplineDesign(tip, 3), part="spline design", problem="not a flexible link", remedy="of the mechanism"
    )


def test_nothing_is_wanted():
    case = truss()
    refused(lambda: case.problem(), part="design problem", problem="there are no targets", remedy="targets=")


def test_objects_that_are_not_targets_or_designs():
    case = truss(*REACHABLE)
    refused(
        lambda: Case(case.scene, case.designs, [(0.1, 2.0)]).problem(),
        part="design problem",
        problem="not a target",
        remedy="Target",
    )
    refused(
        lambda: Case(case.scene, [case.designs[0].link], case.targets).problem(),
        part="design problem",
        problem="not a design",
        remedy="SplineDesign",
    )


def test_a_force_of_another_mechanism():
    case, other = truss(*REACHABLE), bow(10.0)
    refused(
        lambda: Case(case.scene, case.designs, other.targets).problem(),
        part=other.targets[0].quantity.part.name,
        problem="not a force of 'truss finger'",
        remedy="force",
    )


def test_motors_of_another_mechanism():
    case, other = truss(*REACHABLE), strained(1.0)
    target = fm.Target(
        case.targets[0].quantity.part, force=0.1, displacement=2.0, configuration=other.targets[0].sample.configuration
    )
    refused(
        lambda: Case(case.scene, case.designs, [target]).problem(),
        part="'turned'",
        problem="not a motor of 'truss finger'",
        remedy="configuration",
    )


@pytest.mark.parametrize("number", [math.nan, math.inf, "two", None])
@pytest.mark.parametrize("name", ["force", "displacement", "weight"])
def test_targets_that_are_not_numbers(name, number):
    push = truss(*REACHABLE).targets[0].quantity.part
    numbers = {"force": 0.1, "displacement": 2.0, "weight": 1.0, name: number}
    refused(lambda: fm.Target(push, **numbers), part=f"{name} of a target for", problem="", remedy="finite")


@pytest.mark.parametrize("weight", [0.0, -1.0])
def test_targets_that_count_for_nothing(weight):
    push = truss(*REACHABLE).targets[0].quantity.part
    refused(
        lambda: fm.Target(push, force=0.1, displacement=2.0, weight=weight),
        part="weight",
        problem="not positive",
        remedy="greater",
    )


def test_a_target_without_a_force():
    refused(
        lambda: fm.Target("push", force=0.1, displacement=2.0),
        part="target",
        problem="neither a quantity nor a force",
        remedy="mechanism",
    )


def test_fewer_segments_than_gaps_between_joints():
    case = pinned_links()
    push = case.scene.mechanism.force(on=case.designs[0].link, at=(20, 9), direction=(0, -1))
    few = fm.SplineDesign(case.designs[1].link, 1)
    refused(
        lambda: Case(case.scene, [few], [fm.Target(push, force=1.0, displacement=0.1)]).problem(),
        part="'rod'",
        problem="1 segment.* for 2 gaps",
        remedy="at least 2",
    )


@pytest.mark.parametrize("segments", [0, -1, 2.5, None])
def test_invalid_numbers_of_segments(segments):
    link = truss().designs[0].link
    refused(lambda: fm.SplineDesign(link, segments), part="'diagonal'", problem="segments", remedy="whole number")


@pytest.mark.parametrize(
    ("bounds", "problem"),
    [
        ({"thickness": (3.0, 2.0)}, "from 3 to 2"),
        ({"thickness": (-1.0, 2.0)}, "not positive"),
        ({"thickness": (1.0, math.nan)}, "nan"),
        ({"thickness": 3.0}, "3.0"),
        ({"thickness": (1.0, 2.0, 3.0)}, "1.0, 2.0, 3.0"),
        ({"bend": 0.0}, "not positive"),
        ({"bend": math.inf}, "inf"),
    ],
)
def test_invalid_bounds(bounds, problem):
    link = truss().designs[0].link
    with pytest.raises(fm.DescriptionError, match=problem) as caught:
        fm.SplineDesign(link, 3, **bounds)
    assert "'diagonal'" in caught.value.part


def test_bounds_of_thickness_are_any_pair():
    link = truss().designs[0].link
    assert fm.SplineDesign(link, 3, thickness=np.array([1, 6])) == fm.SplineDesign(link, 3, thickness=(1.0, 6.0))


def test_a_configuration_that_does_not_assemble():
    case = strained(1.0)
    mechanism = case.scene.mechanism
    (motor,) = mechanism.motors
    stop = mechanism.rigid("stop")
    base, crank = mechanism.rigid_links[:2]
    mechanism.revolute(crank, stop, at=(0, 30))
    mechanism.revolute(stop, base, at=(5, 30))
    far = case.scene.configuration("far", {motor: 2.0})
    target = fm.Target(case.targets[0].quantity.part, force=1.0, displacement=0.1, configuration=far)
    with pytest.raises(fm.AssemblyError, match="does not close") as caught:
        Case(case.scene, case.designs, [target]).problem()
    assert "'far'" in caught.value.part


def test_a_link_without_a_centreline():
    mechanism = fm.Mechanism("plate")
    base = mechanism.rigid("base", fixed=True)
    plate = mechanism.flexible("plate", fm.polygon([(0, 0), (40, 0), (40, 40), (0, 40)], depth=5.0), fm.ONYX)
    for x in (5, 35):
        mechanism.revolute(base, plate, at=(x, 20), interface_radius=2.0)
    push = mechanism.force(on=plate, at=(20, 0), direction=(0, 1))
    case = Case(fm.Scene(mechanism), [fm.SplineDesign(plate, 2)], [fm.Target(push, force=1.0, displacement=0.1)])
    refused(lambda: case.problem(), part="'plate'", problem="no longer than it is wide", remedy="centreline=")


@pytest.mark.parametrize("given", ["plane_stress", "3d", 1.0])
def test_surrogates_that_are_none(given):
    problem = truss(*REACHABLE).problem(space="3d")
    refused(lambda: problem.optimise(surrogate=given), part="surrogate", problem=str(given), remedy="plane-stress")
