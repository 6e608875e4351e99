"""Random scenes end in equilibria that an independent check accepts, or in one clear, correct error."""

import math
from dataclasses import replace

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

import fenicsmech as fm

from .__main__ import main
from .blueprint import Blueprint, SpringPlan, build
from .draw import bending_force
from .generator import random_scene
from .known_scenes import (
    CLAMPED_ARCH,
    LIMIT_OF_A_CONSTANT_FORCE,
    LIMIT_OF_A_LED_FORCE,
    SOFT_SPRING,
    STRETCHED_COUPLER,
    STRETCHED_FOUR_BAR,
)
from .motions import STEP
from .potential import Potential
from .reasons import HELD, overstrained, true_reason
from .record import OtherCode, append, read
from .residual_check import check
from .scene_result import ROUNDED, SceneResult, judge, judge_frames, judge_sound
from .stability_check import unstable_directions
from .thresholds import THRESHOLDS
from .unstrained_check import unstrained_motions
from .worker import Worker, side_by_side

SOUND = st.integers(0, 10**6).map(lambda n: 10 * n + 5)
SPOILED = st.integers(0, 10**6).map(lambda n: 10 * n + 1)


def small(seed: int) -> bool:
    """Whether a scene is quick: in the plane, under loads, with forms that other tests compile too."""
    scene = random_scene(seed)
    cells = sum(link.thickness / link.size**2 * scene.length for link in scene.flexible)
    plain = scene.space == "plane-stress" and scene.order == 2 and not scene.effects and len(scene.forces) == 1
    return plain and scene.control == "forces" and cells < 300


@hypothesis.given(SPOILED)
@hypothesis.settings(max_examples=12)
def test_invalid_scenes_are_refused_by_name(seed):
    result = judge(seed)
    assert not result.wrong, result


@hypothesis.given(SOUND.filter(small))
@hypothesis.settings(max_examples=4, suppress_health_check=list(hypothesis.HealthCheck))
def test_scenes_that_make_sense_end_well(seed):
    result = judge(seed)
    assert not result.wrong, result


@pytest.mark.parametrize("seed", [39, 639, 799, 22079, 26279, 42639])
def test_designs_end_well(seed):
    # a target that is met, links that do not carry the force, a force that moves nothing, a bound that the first
    # correction tightens, a mechanism that snaps on the way to its load, a gain that is small beside bounds
    result = judge(seed)
    assert not result.wrong, result
    assert result.scene.startswith("design")


EXACT, ROUNDED_TOO = ("equilibrium",), ("equilibrium", ROUNDED)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "outcomes", "frames"),
    [
        pytest.param(23269, EXACT, 6, id="path keeps spins of links while their moments may be rounding"),
        pytest.param(8747, EXACT, 2, id="curve that snapped under a push returns to the path from rest under a pull"),
        pytest.param(8634, EXACT, None, id="weight brings a spinning link to rest beside reactions of 50,000 times it"),
        pytest.param(19308, EXACT, 2, id="weights and a spring that buckle a linkage find where it snaps to"),
        pytest.param(19089, ROUNDED_TOO, 2, id="rubber moves steel whose rounding leaves four digits of the force"),
        pytest.param(19806, EXACT, None, id="path that turns back where a link comes off a cylinder goes on"),
        pytest.param(30267, EXACT, 1, id="predictions that invert elements give way to the last equilibrium"),
        pytest.param(18468, EXACT, 2, id="a force balances beside reactions of a prestrained rod 1e5 times as large"),
        pytest.param(45513, EXACT, 6, id="path of a prestrained link against a spring below rounding goes on"),
        pytest.param(47336, ROUNDED_TOO, 2, id="a force balances beside reactions of 1e5 times it, to the last digit"),
        pytest.param(47667, ROUNDED_TOO, 2, id="weights bring rubber to rest on a cylinder, beyond where steps end"),
    ],
)
def test_scenes_that_ended_wrongly_once_end_in_equilibrium(seed, outcomes, frames):
    result = judge(seed)
    assert result.outcome in outcomes, result
    assert frames in (None, result.frames), result


@pytest.mark.thorough
def test_a_snap_that_rounding_of_a_stiff_link_hides_ends_as_beside_a_softer_one():
    """A coupler between two pins carries next to nothing: its stiffness moves nothing."""
    scene = replace(random_scene(58994), space="plane-stress")

    def snapped(young: float) -> fm.Frame:
        links = tuple(replace(link, young=young) if link.name == "second coupler" else link for link in scene.links)
        return build(replace(scene, links=links)).curve(scene).frames[-1]

    # rounding disturbs, and hides, more and more of what resists
    soft, *stiff = map(snapped, (2e3, 2e4, 2e5))
    assert soft.snapped_through and all(own.snapped_through for own in stiff)
    assert [own.displacement for own in stiff] == pytest.approx(2 * [soft.displacement], rel=1e-9)


def test_every_seed_gives_the_same_scene_again():
    assert [random_scene(seed) for seed in range(50)] == [random_scene(seed) for seed in range(50)]
    assert len({repr(random_scene(seed)) for seed in range(50)}) == 50


@pytest.fixture(scope="module")
def solved():
    """A scene in equilibrium, bent: its potential and its last frame."""
    scenes = (random_scene(seed) for seed in range(5, 20000, 10) if small(seed))
    scene = next(scene for scene in scenes if not scene.motors and _bent(scene) and scene.topology == "two-link arch")
    scene = replace(scene, samples=(scene.samples[-1],))
    built = build(scene)
    return Potential.of(scene, built.simulation), built.curve(scene).frames[-1], built


def _bent(scene: Blueprint) -> bool:
    return 1e-3 < abs(scene.samples[-1]) / min(map(bending_force, scene.flexible)) < 1.0


def test_the_check_accepts_an_equilibrium_and_nothing_near_it(solved):
    potential, frame, _ = solved
    assert check(potential, frame, 0.0).relative < THRESHOLDS.residual
    doubled = replace(frame, force=1.001 * frame.force)
    assert check(potential, doubled, 0.0).relative > 1e-4
    moved = replace(frame, state=replace(frame.state, u=1.001 * frame.state.u))
    assert check(potential, moved, 0.0).relative > THRESHOLDS.residual


def test_curves_that_leave_loads_out_are_wrong(solved):
    potential, frame, _ = solved
    more = replace(potential.blueprint, samples=(frame.force, 1.1 * frame.force))
    assert judge_frames(more, None, [frame], ended=True).outcome == "wrong: frames missing"
    assert judge_frames(replace(more, control="path"), None, [], ended=True).outcome == "wrong: frames missing"


def test_points_are_not_found_in_curved_cells_far_off():
    scene = random_scene(23308)
    mesh, at = Potential.of(scene, build(scene).simulation).mesh, np.array(scene.forces[0].at)
    cell, inside = mesh.locate(np.arange(len(mesh.cells)), at)
    there = mesh.elements.values(inside[None])[0] @ mesh.nodes[mesh.cells[cell]]
    assert there == pytest.approx(at, abs=1e-9 * scene.length)


def test_imaginary_differences_of_the_potential_are_real_ones(solved):
    potential, frame, _ = solved
    mesh, places = potential.mesh, potential.places(frame.state.poses)
    rng, size = np.random.default_rng(1), 1e-2 * min(link.size for link in potential.blueprint.flexible)
    strained = frame.state.u.reshape(mesh.nodes.shape) + size * rng.standard_normal(mesh.nodes.shape) * potential.free
    direction = rng.standard_normal(strained.shape) * potential.free

    def value(step: complex) -> complex:
        return potential.value(strained + step * direction, places, frame.force, None)

    exact = value(1e-30j).imag / 1e-30
    coarse, fine = ((value(h) - value(-h)) / (2 * h) for h in (4e-2 * size, 2e-2 * size))
    assert float((4 * fine - coarse) / 3) == pytest.approx(float(exact), rel=1e-7)


def test_order_of_links_and_joints_does_not_matter(solved):
    potential, frame, _ = solved
    scene = potential.blueprint
    other = scene.shuffled(3)
    again = build(other).curve(other).frames[-1]
    assert again.displacement == pytest.approx(frame.displacement, rel=1e-6, abs=1e-12 * scene.length)
    assert again.strain_energy == pytest.approx(frame.strain_energy, rel=1e-6)
    assert again.unstable_modes == frame.unstable_modes


def test_stability_agrees_with_second_differences(solved):
    potential, frame, _ = solved
    assert unstable_directions(potential, frame) == frame.unstable_modes


def test_errors_at_a_sound_equilibrium_are_not_excused_however_large_the_load(solved):
    potential, frame, built = solved
    scene = replace(potential.blueprint, samples=(1e3 * frame.force,))
    for control in ("forces", "displacements", "path"):
        failure = fm.EquilibriumError("load", "not found", "Give up", last=frame)
        assert true_reason(replace(scene, control=control), built, failure) is None


def test_errors_are_not_excused_by_what_is_no_equilibrium(solved):
    potential, frame, built = solved
    torn = replace(frame, state=replace(frame.state, u=1e6 * frame.state.u))
    failure = fm.EquilibriumError("load", "not found", "Give up", last=torn)
    assert overstrained(potential.blueprint, built, failure) is not None
    assert true_reason(potential.blueprint, built, failure) is None


def test_verdicts_are_kept_of_one_commit_and_lines_that_are_cut_are_judged_again(tmp_path):
    path, verdicts = tmp_path / "seed-0.jsonl", [SceneResult(k, "arch", "refused", "µ", 1.0) for k in range(4)]

    def kept(commit):
        return read(path, commit, lambda entries: SceneResult(**entries))

    assert kept("abc") == {}
    for verdict in verdicts[:2]:
        append(path, verdict.record(), "abc")
    path.write_bytes(path.read_bytes()[:-20])
    append(path, {"seed": 7, "topology": "of older code"}, "abc")
    for verdict in verdicts[2:]:
        append(path, verdict.record(), "abc")
    assert kept("abc") == {k: verdicts[k] for k in (0, 2, 3)}
    for other in ("abc, changed since", "def"):
        with pytest.raises(OtherCode, match="verdicts of abc"):
            kept(other)
    path.write_text("".join(path.read_text().splitlines(keepends=True)[1:]))
    with pytest.raises(OtherCode, match="an unknown commit"):
        kept("abc")


def test_a_judge_that_died_between_two_scenes_is_replaced():
    worker = Worker(str, 60.0)
    assert worker(3) == "3"
    worker._process.kill()
    worker._process.join()
    assert worker(4) == "4"
    worker.close()


def test_scenes_are_judged_side_by_side_and_each_once():
    seeds = list(range(5))
    found = list(side_by_side(str, seeds, lambda seed, failure: "failed", limit=60.0, processes=2))
    assert sorted(found) == [str(seed) for seed in seeds]


def test_quick_tables_are_not_published(monkeypatch):
    monkeypatch.setattr("sys.argv", ["random_scenes", "--quick", "--write"])
    with pytest.raises(SystemExit):
        main()


@pytest.fixture(scope="module")
def sprung():
    """A six-bar whose freedom a spring holds under a load a millionth of what rounding is worth to its links."""
    scenes = (random_scene(seed) for seed in range(5, 20000, 10))
    scene = next(scene for scene in scenes if "six-bar" in scene.topology and _hangs_on_a_soft_spring(scene))
    built = build(scene)
    return Potential.of(scene, built.simulation), built.curve(scene).frames[-1]


def _hangs_on_a_soft_spring(scene: Blueprint) -> bool:
    held = [type(effect) for effect in scene.effects] == [SpringPlan] and not scene.motors and len(scene.forces) == 1
    plain = scene.space == "plane-stress" and scene.order == 2 and scene.control == "forces"
    stiff = max(link.young * link.depth for link in scene.flexible) * scene.length
    away = min(math.dist(scene.forces[0].at, joint.at) for joint in scene.joints if "base" in (joint.a, joint.b))
    return (
        held
        and plain
        and away > 0.2 * scene.length
        and abs(scene.samples[-1]) < 1e-10 * stiff
        and not scene.effects[0].rest
    )


def test_motions_that_deform_no_link_leave_the_strain_energy_as_it_is(sprung):
    potential, frame = sprung
    places = potential.places(frame.state.poses)
    u = potential.nodal(np.array(frame.state.u).reshape(potential.mesh.nodes.shape), places)
    motions = list(unstrained_motions(potential, u, places))
    assert len(motions) == 1
    for motion in motions:
        slope = potential.strain_energy(u + motion.du, None).imag / STEP
        speed = np.abs(motion.du).max() / STEP
        assert abs(slope) < 1e-12 * abs(frame.force) * speed


def test_loads_and_springs_balance_however_stiff_the_links(sprung):
    potential, frame = sprung
    assert check(potential, frame, 0.0).unstrained_work < 1e-6
    assert check(potential, replace(frame, force=1.01 * frame.force), 0.0).unstrained_work > 10.0 * THRESHOLDS.balanced


@pytest.mark.thorough
@pytest.mark.parametrize(
    "scene, reason", [(STRETCHED_FOUR_BAR, HELD), (STRETCHED_COUPLER, HELD), (CLAMPED_ARCH, "out of reach")]
)
def test_joints_are_not_opened_for_a_displacement_out_of_reach(scene, reason):
    # reactions grow out of all bounds there, and with them what a residual of a billionth of them may hide
    assert judge_sound(scene).outcome == f"true: EquilibriumError, {reason}"


@pytest.mark.thorough
def test_a_force_a_hundred_times_beyond_its_limit_snaps_to_an_equilibrium():
    scene, built = LIMIT_OF_A_LED_FORCE, build(LIMIT_OF_A_LED_FORCE)
    curve = built.curve(scene)
    assert judge_frames(scene, built, curve.frames, ended=True).outcome == "equilibrium"
    assert curve.snapped_through.all()


@pytest.mark.slow
def test_constant_loads_far_beyond_a_limit_point_end_in_the_stable_equilibrium_past_the_turns_of_their_path():
    scene, built = LIMIT_OF_A_CONSTANT_FORCE, build(LIMIT_OF_A_CONSTANT_FORCE)
    (frame,) = built.curve(scene).frames
    assert judge_frames(scene, built, [frame], ended=True).outcome.startswith("equilibrium")
    assert frame.snapped_through and frame.stable


@pytest.mark.slow
def test_springs_hardly_stiffer_than_the_rounding_of_links_hold_whatever_the_last_digits_of_loads():
    # where rounding makes the inertia doubtful, shifted steps creep, which is no sign of convergence
    (spring,), rng = SOFT_SPRING.effects, np.random.default_rng(0)
    reached = []
    for load, stiffness in 1.0 + 1e-3 * rng.standard_normal((3, 2)):
        samples = tuple(load * sample for sample in SOFT_SPRING.samples)
        effects = (replace(spring, stiffness=stiffness * spring.stiffness),)
        scene = replace(SOFT_SPRING, samples=samples, effects=effects)
        reached.append(build(scene).curve(scene).displacements)
    assert np.all(np.ptp(reached, axis=0) < 1e-3 * np.abs(reached[0]))
