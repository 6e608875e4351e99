"""Excuses of the judge, and where each of them ends: a scene or a constructed state on either side."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fenicsmech as fm

from . import designs, reach, reasons
from .blueprint import (
    Blueprint,
    CompliancePlan,
    ContactPlan,
    ForcePlan,
    JointPlan,
    LinkPlan,
    MotorPlan,
    PlanePlan,
    SpringPlan,
    build,
)
from .designs import UNMET
from .potential import Potential
from .reach import beyond_chains, least_stretch
from .reasons import (
    _constant_forces,
    adrift,
    inverted,
    out_of_reach,
    outweighed,
    overstrained,
    turned_back,
    turned_back_by_motors,
    unheard,
)
from .residual_check import check, fault
from .scene_result import ROUNDED, SceneResult
from .stability_check import stiffness_left
from .summary import excessive
from .test_checks import arch
from .thresholds import THRESHOLDS


def slider(*effects, angle: float = 0.0, control: str = "forces") -> Blueprint:
    """A slider with a strip welded to it, on which a force pulls at an ``angle`` to the slide."""
    return Blueprint(
        topology="slider",
        links=(
            LinkPlan("base", fixed=True),
            LinkPlan("slider"),
            LinkPlan("strip", False, ((0.0, 0.0), (30.0, 0.0)), 2.0, 3.0, 1770.0, 0.4, size=2.5),
        ),
        joints=(
            JointPlan("S", "prismatic", "base", "slider", (-5.0, 0.0), axis=(1.0, 0.0)),
            JointPlan("A", "weld", "slider", "strip", (0.0, 0.0), interface=1.4),
        ),
        motors=(),
        forces=(ForcePlan("load", "strip", (30.0, 0.0), (np.cos(angle), np.sin(angle))),),
        effects=effects,
        space="plane-stress",
        order=2,
        control=control,
        samples=(0.01,),
    )


def pendulum(control: str = "forces") -> Blueprint:
    """A strip that hangs on a pin, a force at its end across it."""
    return replace(
        slider(angle=np.pi / 2, control=control),
        topology="pendulum",
        links=(LinkPlan("base", fixed=True), LinkPlan("bob"), slider().links[2]),
        joints=(
            JointPlan("A", "revolute", "base", "strip", (0.0, 0.0), interface=1.4),
            JointPlan("B", "weld", "strip", "bob", (30.0, 0.0), interface=1.4),
        ),
    )


def failed(last: object = None, frames: tuple = ()) -> fm.EquilibriumError:
    return fm.EquilibriumError("load", "not found", "Give up", last=last, frames=frames)


def balanced(load_factor: float, force: float) -> SimpleNamespace:
    return SimpleNamespace(state=SimpleNamespace(load_factor=load_factor), force=force)


@pytest.mark.parametrize(
    "scene, last, excused",
    [
        pytest.param(slider(), None, True, id="nothing ends the translation"),
        pytest.param(slider(), balanced(1.0, 0.0), True, id="an equilibrium without the force says nothing"),
        pytest.param(slider(), balanced(1.0, 0.004), False, id="an equilibrium with the force refutes it"),
        pytest.param(slider(angle=np.pi / 2), None, False, id="no work along the slide"),
        pytest.param(slider(SpringPlan("S", 1e-3, 0.0)), None, False, id="a spring ends the translation"),
        pytest.param(
            slider(ContactPlan("strip", PlanePlan((40.0, 0.0), (-1.0, 0.0)))), None, False, id="so does an obstacle"
        ),
        pytest.param(slider(control="displacements"), None, False, id="the displacement is prescribed"),
        pytest.param(pendulum(), None, False, id="a turn has an end"),
    ],
)
def test_loads_drive_a_mechanism_on_without_end_along_free_translations_only(scene, last, excused):
    assert (adrift(scene, build(scene), failed(last)) is not None) == excused


@pytest.fixture(scope="module")
def raised():
    """An arch whose top is raised, bent by its load: its scene, simulation, potential and frame."""
    scene = arch("plane-stress", 2)
    scene = replace(scene, forces=(ForcePlan("load", "left", (30.0, 10.0), (0.0, 1.0)),), ratios=(1.0,))
    built = build(scene)
    (frame,) = built.curve(scene).frames
    return scene, built, Potential.of(scene, built.simulation), frame


# the top, at a height of 10 over supports 60 apart, by strips that may be 1.2 times their length without a force
@pytest.mark.parametrize("displacement, excused", [(-20.0, False), (62.0, False), (80.0, True)])
def test_a_displacement_is_out_of_reach_where_links_must_be_twice_as_long(raised, displacement, excused, monkeypatch):
    scene, built, _, frame = raised
    found = []
    monkeypatch.setattr(reasons, "least_stretch", lambda *given: found.append(least_stretch(*given)) or found[-1])
    led = replace(scene, control="displacements", samples=(displacement,))
    assert (out_of_reach(led, built, failed(frame)) is not None) == excused
    (stretch,) = found
    assert abs(stretch - THRESHOLDS.unreached) < 0.4 or displacement < 0.0 and stretch < 1.0 + 1e-6


def test_of_two_displacements_the_first_that_failed_is_in_reach(raised):
    scene, built, _, frame = raised
    led = replace(scene, control="displacements", samples=(0.0, 80.0))
    assert out_of_reach(led, built, failed(frame)) is None


def hung() -> Blueprint:
    """A rigid crank from the origin to (0, 10), and a strip from there to the ground at (0, 30)."""
    return replace(
        slider(control="displacements"),
        topology="hung",
        links=(
            LinkPlan("base", fixed=True),
            LinkPlan("crank"),
            LinkPlan("strip", False, ((0.0, 10.0), (0.0, 30.0)), 2.0, 3.0, 1770.0, 0.4, size=2.5),
        ),
        joints=(
            JointPlan("A", "revolute", "base", "crank", (0.0, 0.0)),
            JointPlan("B", "revolute", "crank", "strip", (0.0, 10.0), interface=1.4),
            JointPlan("C", "revolute", "strip", "base", (0.0, 30.0), interface=1.4),
        ),
        forces=(ForcePlan("load", "crank", (0.0, 10.0), (1.0, 0.0)),),
    )


def test_reach_is_that_of_the_best_of_several_starts_and_of_none_that_did_not_converge(monkeypatch):
    # the crank's end is 6 to the right in two poses: 8 above its pivot, and as far below, where it draws the strip
    built = build(hung())
    potential = Potential.of(hung(), built.simulation)
    below, still = np.array(built.simulation.linkage.joints.drawn), np.zeros(potential.mesh.nodes.size)
    crank, end = potential.closure.ends["B"]
    below[crank] = [*(2.0 * (np.zeros(2) - potential.centres[crank][:2])), np.pi]
    below[end] = [0.0, -20.0, 0.0]
    assert least_stretch(potential, still, below, 6.0) == pytest.approx(1.0, abs=1e-3)
    monkeypatch.setattr(reach, "_STARTS", 0)
    assert least_stretch(potential, still, below, 6.0) > 1.3
    monkeypatch.setattr(reach, "_EVALUATIONS", 1)
    assert np.isnan(least_stretch(potential, still, below, 6.0))


def test_rigid_links_reach_no_farther_than_they_are_long_and_flexible_ones_and_slides_set_no_bound():
    scene, built = hung(), build(hung())
    (frame,) = built.curve(scene).frames
    # the crank is 10 long, and drawn across the force
    assert [beyond_chains(scene, travel) > 0.0 for travel in (-10.1, -9.9, 9.9, 10.1)] == [True, False, False, True]
    for travel, excused in ((9.99, False), (10.01, True)):
        there = replace(scene, samples=(travel,))
        assert (out_of_reach(there, built, failed(frame)) is not None) == excused
    # a rigid rod of length 20 from the crank's end to the ground at a height of 30, and a force halfway up
    rigid = (*scene.links[:2], LinkPlan("strip"))
    up = replace(scene, links=rigid, forces=(ForcePlan("load", "strip", (0.0, 20.0), (0.0, 1.0)),))
    assert beyond_chains(up, 0.3) == pytest.approx(0.3 / 30.0)
    loose = (replace(up, links=scene.links), replace(up, effects=tuple(CompliancePlan(name, 1e-3) for name in "AC")))
    slides = tuple(replace(joint, kind="prismatic") if joint.name in "AC" else joint for joint in up.joints)
    for other in (*loose, replace(up, joints=slides)):
        assert beyond_chains(other, 1e3) == -np.inf


def test_a_point_on_a_hinged_link_in_space_stays_on_a_circle():
    # the hinge's axis is 30 degrees off the force: the crank's end is 6 from its axis, and 5 above its pin
    axis, arm = np.array((np.sqrt(3.0), 0.0, 1.0)) / 2.0, np.array((0.0, 6.0, 0.0))
    hinge = JointPlan("A", "revolute", "base", "crank", (0.0, 0.0, 0.0), axis=tuple(axis))
    push = ForcePlan("load", "crank", tuple(arm + 5.0 * axis), (1.0, 0.0, 0.0))
    scene = replace(hung(), joints=(hinge, *hung().joints[1:]), forces=(push,), space="3d")
    assert [beyond_chains(scene, travel) > 0.0 for travel in (-3.01, -2.99, 2.99, 3.01)] == [True, False, False, True]


def test_a_motor_moves_the_pin_that_a_point_turns_about():
    # a slide takes the pin 2 to the right, the point is 3 off it, drawn above
    slide = JointPlan("S", "prismatic", "base", "crank", (9.0, 0.0), axis=(1.0, 0.0))
    pin = JointPlan("A", "revolute", "crank", "arm", (0.0, 0.0))
    scene = replace(
        hung(),
        links=(*hung().links[:2], LinkPlan("arm")),
        joints=(slide, pin),
        motors=(MotorPlan("S", 2.0),),
        forces=(ForcePlan("load", "arm", (0.0, 3.0), (1.0, 0.0)),),
    )
    assert [beyond_chains(scene, travel) > 0.0 for travel in (-1.1, -0.9, 4.9, 5.1)] == [True, False, False, True]
    # the other way round
    held = replace(scene, joints=(replace(slide, a="crank", b="base"), pin))
    assert [beyond_chains(held, travel) > 0.0 for travel in (-5.1, -4.9, 0.9, 1.1)] == [True, False, False, True]


def test_points_of_one_crank_do_not_get_as_far_together_as_each_alone():
    # pushed to the right at the end and up in the middle: 10 sin θ + 5 (cos θ − 1) is √125 − 5 at most
    pushes = (ForcePlan("load", "crank", (0.0, 10.0), (1.0, 0.0)), ForcePlan("up", "crank", (0.0, 5.0), (0.0, 1.0)))
    scene, most = replace(hung(), forces=pushes, ratios=(1.0, 1.0)), np.sqrt(125.0)
    reached = [beyond_chains(scene, travel) > 0.0 for travel in (-5.1 - most, -4.9 - most, most - 5.1, most - 4.9)]
    assert reached == [True, False, False, True]


def test_a_point_in_an_interface_turns_about_the_pin_of_a_crank_that_its_motor_holds():
    # 1 to the right of the pin at (0, 10), pushed up
    off = replace(hung(), forces=(ForcePlan("load", "strip", (1.0, 10.0), (0.0, 1.0)),))
    held = replace(off, motors=(MotorPlan("A", 0.0),))
    assert [beyond_chains(held, travel) > 0.0 for travel in (-1.1, -0.9, 0.9, 1.1)] == [True, False, False, True]
    # turned by half a radian, it holds its pin 1.22 lower
    turned = replace(off, motors=(MotorPlan("A", 0.5),))
    assert [beyond_chains(turned, travel) > 0.0 for travel in (-2.3, -2.2, -0.3, -0.2)] == [True, False, False, True]
    # without a motor its pin may get to (0, -10)
    assert [beyond_chains(off, travel) > 0.0 for travel in (-21.1, -20.9, 0.9, 1.1)] == [True, False, False, True]
    welded = tuple(replace(joint, kind="weld") if joint.name == "A" else joint for joint in off.joints)
    assert beyond_chains(replace(off, joints=welded), 1.1) == pytest.approx(0.1 / off.length)


def test_stiffness_is_compared_at_stable_equilibria_that_second_differences_confirm(raised):
    _, built, potential, frame = raised
    unloaded, drawn = replace(potential, load_factor=0.0), built.simulation.linkage.joints.drawn
    left = stiffness_left(potential, frame, unloaded, drawn, led=False)
    assert 0.5 < left < 2.0
    rest = replace(frame, force=0.0, state=replace(frame.state, u=0.0 * frame.state.u, poses=drawn))
    assert stiffness_left(potential, rest, unloaded, drawn, led=False) == pytest.approx(1.0, rel=1e-6)
    for other in (replace(frame, stable_under_control=False), replace(frame, unstable_modes=1)):
        assert stiffness_left(potential, other, unloaded, drawn, led=False) is None


def test_links_are_strained_out_of_shape_by_volume_not_by_a_point(raised):
    scene, built, potential, frame = raised
    nodes = potential.mesh.nodes

    def at(gradient) -> fm.EquilibriumError:
        return failed(replace(frame, state=replace(frame.state, u=(nodes @ np.array(gradient).T).ravel())))

    for factor, excused in ((0.9, False), (1.1, True)):
        assert (overstrained(scene, built, at(factor * np.eye(2))) is not None) == excused
    for squeeze, excused in ((-0.85, False), (-0.95, True)):  # det F = 0.15 and 0.05
        assert (inverted(scene, built, at([[squeeze, 0.0], [0.0, 0.0]])) is not None) == excused
    alone = np.zeros(nodes.shape)
    corner = potential.mesh.cells[np.flatnonzero(potential.mesh.body < 0)[0], 0]
    alone[corner] = 3.0 * scene.links[1].size
    torn = failed(replace(frame, state=replace(frame.state, u=alone.ravel())))
    share, _ = potential.strained(alone.ravel(), THRESHOLDS.strained)
    assert 0.0 < share < THRESHOLDS.strained_share
    assert overstrained(scene, built, torn) is None


def test_a_path_turns_back_between_equilibria_and_before_the_load(raised, monkeypatch):
    scene, built, _, frame = raised
    loads = replace(scene, samples=(0.1, 0.15, 0.2))
    low, middle, high = built.curve(loads).frames
    torn = replace(middle, state=replace(middle.state, u=1.01 * middle.state.u))
    asked = replace(scene, samples=(0.3,))

    def turned(frames: list[fm.Frame], scene: Blueprint = asked, last: fm.Frame = frame) -> bool:
        monkeypatch.setattr(built, "follow", lambda *_: SimpleNamespace(frames=frames))
        return turned_back(scene, built, failed(last)) is not None

    assert turned([low, high, middle])
    assert turned([low, high, middle, high])  # whatever comes after a snap
    assert not turned([low, middle, high])
    assert not turned([low, high, torn])
    assert not turned([low, high, middle], last=low)  # the curve did not get there
    assert not turned([low, high, middle], replace(scene, samples=(0.2,)))
    assert not turned([low, high, middle], replace(asked, control="path"))


def test_the_way_of_a_motor_turns_back_between_equilibria(monkeypatch):
    scene = replace(hung(), motors=(MotorPlan("A", 0.5),))
    built = build(scene)
    motor = built.motors["A"]
    low, middle, high = (
        built.simulation.follow(motor, until=fm.Until(position=position)).frames[-1] for position in (0.1, 0.15, 0.2)
    )
    torn = replace(high, state=replace(high.state, u=1.01 * high.state.u))

    def turned(frames: list[fm.Frame], last: fm.Frame = high, scene: Blueprint = scene) -> bool:
        monkeypatch.setattr(built.simulation, "follow", lambda *_, **options: SimpleNamespace(frames=frames))
        failure = fm.EquilibriumError("motors", "no equilibrium beyond 40% of their way", "Give up", last=last)
        return turned_back_by_motors(scene, built, failure) is not None

    assert turned([low, high, middle])
    assert turned([low, high, high, middle])  # a critical point
    assert not turned([low, middle, high])
    assert not turned([low, torn, middle])
    assert not turned([low, high, middle], last=torn)
    assert not turned([low, high, middle], last=low)  # the motors did not get there
    assert not turned([low, high, middle], scene=replace(scene, effects=(SpringPlan("A", 5.0, 0.2),)))


def test_constant_forces_alone_are_followed():
    scene = replace(arch("plane-stress", 2), ratios=(1.0,))
    first, second = scene.forces
    scene = replace(scene, control="displacements", forces=(first, replace(second, magnitude=0.7)))
    path = _constant_forces(scene)
    assert (path.control, path.samples, [force.name for force in path.forces]) == ("forces", (0.7,), ["other"])
    assert _constant_forces(replace(scene, effects=(SpringPlan("A", 5.0, 0.0),))) is not None
    assert _constant_forces(replace(scene, effects=(SpringPlan("A", 5.0, 0.2),))) is None
    assert _constant_forces(replace(scene, forces=(first,))) is None


@pytest.mark.parametrize(
    "reason, first, second, outcome",
    [
        ("", (False, 1.0, 1.0), (False, 1.0, 1.0), UNMET),
        ("", (False, 1.0, 1.0), (True, 1.0, 1.0), "wrong: a second start meets the targets"),
        ("", (False, 1.0, 1.0), (True, 1.0, 1.1), "wrong: displacement of a design"),
        ("", (False, 1.0, 1.0), (False, 1.0, 1.1), "wrong: displacement of a design"),
        ("", (True, 1.0, 1.1), (True, 1.0, 1.0), "wrong: displacement of a design"),
        ("", (True, 1.0, 1.0), (True, 1.0, 1.1), "designed: targets met"),
        ("allow more", (False, 1.0, 1.0), (True, 1.0, 1.0), "designed: targets met by more iterations"),
        ("allow more", (False, 1.0, 1.0), (True, 1.0, 1.1), "wrong: displacement of a design"),
        ("refine them", (False, 1.0, 1.0), (True, 1.0, 1.0), "designed: targets met on smaller elements"),
        ("refine them", (False, 1.0, 1.0), (True, 1.0, 1.1), "wrong: displacement of a design"),
    ],
)
def test_results_of_either_start_are_wrong_where_a_curve_differs(reason, first, second, outcome, monkeypatch):
    def result(met: bool, reported: float, found: float) -> SimpleNamespace:
        target = SimpleNamespace(met=met, wanted=1.0, reached=reported)
        return SimpleNamespace(targets=[target], reason=reason, active=(), verified=True, found=found)

    starts = iter([result(*first), result(*second)])
    problem = SimpleNamespace(initial=np.zeros(3), optimise=lambda **_: next(starts))
    monkeypatch.setattr(designs, "design_problem", lambda *_: problem)
    monkeypatch.setattr(designs, "build", lambda _: built)

    def curve(displacement: float) -> SimpleNamespace:
        return SimpleNamespace(frames=[SimpleNamespace(displacement=displacement)])

    simulation = SimpleNamespace(
        with_design=lambda design: SimpleNamespace(load_displacement=lambda *_, **__: curve(design.found))
    )
    built = SimpleNamespace(
        curve=lambda _: curve(1.0), simulation=simulation, forces={"load": None}, configuration=None
    )
    scene = designs.DesignScene(slider(), ("strip",), 1.0, False, (0.5, 1.5), 0)
    assert designs.run(scene)[0] == outcome


def results(outcomes: dict[str, int], total: int, unchecked: str = "") -> list[SceneResult]:
    """Results of ``total`` scenes that make sense; those not listed are equilibria."""
    seeds = iter(seed for seed in range(10 * total) if seed % 10 >= 3 and seed % 40 != 39)
    listed = [outcome for outcome, count in outcomes.items() for _ in range(count)]
    listed += ["equilibrium"] * (total - len(listed))
    return [SceneResult(next(seeds), "four-bar", outcome, "", 1.0, unchecked=unchecked) for outcome in listed]


@pytest.mark.parametrize(
    "outcomes, bounds",
    [
        ({"true: EquilibriumError, at a limit point": 35}, 0),
        ({"true: EquilibriumError, at a limit point": 36}, 1),
        ({"true: a": 22, "true: b": 21, "true: c": 22}, 0),
        ({"true: a": 22, "true: b": 22, "true: c": 22}, 1),
        ({"true: EquilibriumError, the point cannot move that way": 125}, 0),
        ({"true: EquilibriumError, the point cannot move that way": 126}, 1),
        ({ROUNDED: 215}, 0),
        ({ROUNDED: 216}, 1),
    ],
)
def test_excuses_are_bounded_alone_and_together(outcomes, bounds):
    assert len(excessive(results(outcomes, 1000))) == bounds


def test_checks_left_out_and_designs_without_an_end_are_bounded():
    some = results({}, 100)
    some[:30] = results({}, 30, unchecked="stability")
    assert not excessive(some)
    some[:31] = results({}, 31, unchecked="displacement and stability")
    assert len(excessive(some)) == 1
    ends = [
        SceneResult(40 * k + 39, "design", UNMET if k < 12 else "designed: targets met", "", 1.0) for k in range(20)
    ]
    assert not excessive(ends)
    assert len(excessive([replace(end, outcome=UNMET) for end in ends])) == 1


def test_motions_without_a_force_balance_to_rounding_and_nothing_more():
    scene = replace(pendulum("path"), samples=(3.0,), most=6)
    built = build(scene)
    frame = built.curve(scene).frames[-1]
    potential = Potential.of(scene, built.simulation)
    assert abs(frame.force) < 1e-9
    assert not fault(scene, frame, None, check(potential, frame, 0.0))
    pulled = check(potential, replace(frame, force=frame.force + 1e-6), 0.0)
    assert pulled.unstrained_work > THRESHOLDS.balanced


def test_rounding_of_nodal_forces_grows_with_the_order_of_elements():
    gains = []
    for order in (1, 2):
        scene = arch("plane-stress", order)
        potential = Potential.of(scene, build(scene).simulation)
        gains.append(potential.rounding(scene.links[1])[0] / np.sqrt(potential.mesh.nodes.size))
    assert 1.2 * gains[0] < gains[1] < 2.0 * gains[0]


@pytest.mark.parametrize(("share", "hidden"), [(0.3, True), (3.0, False)])
def test_a_force_is_hidden_only_below_the_rounding_of_one_nodal_force_and_where_motors_turn_links(share, hidden):
    scene = slider()
    (strip,) = scene.flexible
    force = share * THRESHOLDS.unheard * strip.young * strip.depth * scene.length
    scene = replace(scene, samples=(force,))
    failure = SimpleNamespace(last=None, frames=(), problem="no equilibrium at force 1")
    assert unheard(scene, build(scene), failure) is None
    turned = replace(scene, motors=(SimpleNamespace(joint="S", position=0.0),))
    assert (unheard(turned, build(scene), failure) is not None) == hidden
    loads = SimpleNamespace(last=SimpleNamespace(state=SimpleNamespace(load_factor=0.5)), frames=())
    motors = SimpleNamespace(last=None, frames=())
    for before in (loads, motors):
        before.problem = "the motors strain the links, and no equilibrium was found beyond 46.8% of their way"
        assert unheard(turned, build(scene), before) is None


@pytest.mark.parametrize(
    "modulus, remedy, excused",
    [
        pytest.param(1e-5, "make 'right' rigid", True, id="the stiff link is named"),
        pytest.param(1e-1, "make 'right' rigid", False, id="the other one is felt"),
        pytest.param(1e-5, "make 'left' rigid", False, id="the soft link is named"),
        pytest.param(1e-5, "give up", False, id="none is named"),
    ],
)
def test_a_soft_link_is_outweighed_by_a_stiff_one_that_the_error_names_and_that_can_be_rigid(modulus, remedy, excused):
    scene = arch("plane-stress", 2)
    links = [replace(link, young=young) for link, young in zip(scene.links, (0.0, modulus, 1770.0), strict=True)]
    scene = replace(scene, links=tuple(links), samples=(1e-4 * modulus,))
    failure = fm.EquilibriumError("load", "not found", f"Less than the rounding of the stiffest links: {remedy}")
    excuse = outweighed(scene, build(scene), failure)
    assert (excuse is not None) == excused
