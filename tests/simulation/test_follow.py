"""Followed curves as users ask for them, draw them and go on from them."""

import math

import numpy as np
import pytest

import fenicsmech as fm

from ..equilibrium import toggle

STIFF = 200.0


@pytest.mark.parametrize(
    "given, message",
    [
        ({}, "no displacement, position or force"),
        ({"displacement": float("nan")}, "nan"),
        ({"force": (1.0, "much")}, "not a number"),
        ({"displacement": 1.0, "position": 2.0}, "a displacement and a position"),
        ({"force": 1.0, "frames": 1}, "the value is 1"),
        ({"force": 1.0, "frames": 2.5}, "the value is 2.5"),
    ],
)
def test_invalid_ends_are_refused(given, message):
    with pytest.raises(fm.DescriptionError, match=message):
        fm.Until(**given)


@pytest.mark.parametrize(
    "given", [{"first": 0.0}, {"largest": -1.0}, {"smallest": float("nan")}, {"motion": 0.0}, {"tolerance": 2.0}]
)
def test_invalid_steps_are_refused(given):
    with pytest.raises(fm.DescriptionError):
        fm.ArcSteps(**given)


@pytest.mark.parametrize("angle", ["largest_turn", "largest_corner"])
def test_steps_that_turn_by_more_than_a_right_angle_are_refused(angle):
    fm.ArcSteps(**{angle: 0.5 * math.pi})
    with pytest.raises(fm.DescriptionError, match=f"{angle} of arc-length steps: 1.6 rad is above π/2"):
        fm.ArcSteps(**{angle: 1.6})


def test_an_until_without_an_end_is_refused():
    case = toggle.toggle(stilt_modulus=STIFF)
    with pytest.raises(fm.DescriptionError, match="does not say where"):
        case.simulation.follow(case.push, until=12.0)


@pytest.mark.parametrize("off", [-1e-11, 0.0, 1e-11])
def test_a_path_ends_at_a_frame_that_is_its_end_but_for_rounding(off):
    case = toggle.toggle(stilt_modulus=STIFF)
    whole = case.simulation.follow(case.push, until=fm.Until(displacement=12.0)).displacements
    end = whole[len(whole) // 2]
    ended = case.simulation.follow(case.push, until=fm.Until(displacement=(end + 12.0 * off, 12.0)))
    assert ended.displacements == pytest.approx(whole[: len(whole) // 2 + 1], rel=1e-9)


def test_error_of_a_curve_that_ends_early_has_the_last_equilibrium():
    case = toggle.toggle(stilt_modulus=STIFF)
    steps = fm.ArcSteps(first=0.5, largest=0.5, smallest=0.4)
    with pytest.raises(fm.EquilibriumError, match="cannot be followed beyond displacement") as caught:
        case.simulation.follow(case.push, until=fm.Until(displacement=20.0), steps=steps)
    assert caught.value.frames and caught.value.last is caught.value.frames[-1]


def test_branches_of_a_curve_of_another_fidelity_are_refused():
    here, there = (toggle.toggle(stilt_modulus=STIFF).simulation for _ in range(2))
    (push,) = here.scene.mechanism.forces
    curve = here.follow(push, until=fm.Until(displacement=0.5))
    with pytest.raises(fm.DescriptionError, match="another fidelity"):
        there.branches(curve, None, until=fm.Until(displacement=1.0))


def test_curve_and_frames_print_their_figures():
    case = toggle.toggle(stilt_modulus=STIFF)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=0.5))
    assert repr(curve).startswith(f"<FollowedCurve of {case.push.name!r}, as drawn: {len(curve.frames)} frames, ")
    assert "displacement 0 mm to 0.5 mm" in repr(curve)
    with pytest.raises(fm.DescriptionError, match="another curve"):
        curve.soft_modes(frame=case.simulation.load_displacement(case.push, forces=[0.0]).frames[0])


def test_followed_curve_is_drawn_and_written_like_others(tmp_path):
    case = toggle.toggle(stilt_modulus=STIFF)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=12.0))
    marks = curve.series().marks
    assert [mark.kind for mark in marks] == ["limit point"] * 2
    assert [mark.force for mark in marks] == pytest.approx([event.frame.force for event in curve.events])
    curve.plot(tmp_path / "curve.png")
    curve.write_csv(tmp_path / "curve.csv")
    curve.picture(tmp_path / "toggle.png")
    assert all((tmp_path / name).stat().st_size > 0 for name in ("curve.png", "curve.csv", "toggle.png"))
    assert curve.frames[3].iterations >= 2 and curve.frames[3].seconds > 0.0


def test_limit_points_are_where_dead_loads_snap():
    case = toggle.toggle(stilt_modulus=STIFF)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=4.0))
    assert {event.mode.link for event in curve.limit_points} == {"stilt"}  # it sinks, the spring hardly moves


def test_constant_forces_act_along_the_whole_path():
    case = toggle.toggle(stilt_modulus=STIFF)
    mechanism = case.simulation.scene.mechanism
    weight = mechanism.force(on=case.push.on, at=case.push.at, direction=(0, -1), name="weight")
    alone = case.simulation.follow(case.push, until=fm.Until(displacement=4.0))
    both = case.simulation.follow(case.push, until=fm.Until(displacement=4.0), others={weight: 0.25})
    assert both.limit_points[0].frame.force + 0.25 == pytest.approx(alone.limit_points[0].frame.force, rel=1e-8)
    sunk = np.array([frame.outputs[case.sunk] for frame in both.frames])
    assert both.forces + 0.25 == pytest.approx(toggle.force(sunk), abs=1e-8)
    # the tangent is that of both forces together
    near = both.frames[both.limit_points[0].index - 1]
    ahead = min(abs(load.value - both.limit_points[0].frame.force) for load in both.buckling_points(frame=near))
    assert ahead < 0.05 * toggle.force(2.1)
