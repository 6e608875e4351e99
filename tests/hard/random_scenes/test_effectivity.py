"""Error estimates of random scenes are within a factor of two of the true differences, or doubted."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

import fenicsmech as fm

from .blueprint import Blueprint, Built
from .draw import bending_force
from .effectivity import Estimate, Judged, failed, faults, judge_scene, seeds
from .finer import coarse_curve, finer, refined
from .generator import random_scene
from .known_scenes import CLAMPED_ARCH
from .worker import side_by_side


def simple(scene: Blueprint) -> bool:
    """Whether one force on a rigid link strains flexible ones of few cells, in plane stress, and nothing else acts."""
    plain = scene.space == "plane-stress" and scene.order == 2 and not scene.effects and not scene.motors
    few = sum(link.thickness / link.size**2 * scene.length for link in scene.flexible) < 100
    return plain and few and len(scene.forces) == 1 and not scene.link(scene.forces[0].on).centreline


def first(topology: str, control: str) -> Blueprint:
    """The first random scene of a ``topology`` that is simple, under a ``control``."""
    found = (random_scene(seed) for seed in seeds(0, 2000) if seed % 40 != 39)
    return next(s for s in found if (s.topology, s.control) == (topology, control) and simple(s))


@pytest.mark.parametrize(
    ("topology", "control"),
    [
        ("two-link arch", "forces"),
        ("two-link arch", "displacements"),
        pytest.param("slider-crank", "forces", marks=pytest.mark.thorough),
    ],
)
def test_estimates_of_simple_scenes_are_within_a_factor_of_two(topology, control):
    found = judge_scene(0, first(topology, control))
    assert {own.outcome for own in found.kinds.values()} <= {"within", "below resolution"}
    own, checked = found.elements, found.checked_elements
    assert own.outcome == checked.outcome == "within"
    assert not own.doubts or abs(own.estimate) < own.resolution  # what hardly strains may be in doubt


def test_errors_beyond_first_order_are_doubted():
    # a clamped link that bends, in elements of order 1 that are as long as it is thick
    load = 0.01 * bending_force(CLAMPED_ARCH.link("left"))
    found = judge_scene(0, replace(CLAMPED_ARCH, control="forces", samples=(load,)))
    assert "estimate above a tenth of the largest value" in found.elements.doubts
    assert found.elements.outcome != "outside"
    assert found.checked_elements.outcome == "within"


def test_equilibria_in_finer_elements_are_those_of_a_curve_from_zero_load(monkeypatch):
    scene = first("two-link arch", "forces").coarsened()
    curve, _ = coarse_curve(scene)
    with refined(1):
        whole, _ = coarse_curve(scene)
    monkeypatch.setattr(Built, "curve", None)  # of what follows, nothing is loaded from zero
    found = finer(scene, curve, 1)
    assert found.value == pytest.approx(whole.values[-1], rel=1e-8)
    assert found.error == pytest.approx(whole.error_estimates()[-1], rel=1e-2)


def test_estimators_that_fail_are_outside(monkeypatch):
    def fails(curve, *arguments, **options):
        raise fm.EquilibriumError("estimate", "it is not defined", "Choose another frame")

    monkeypatch.setattr(fm.Curve, "checked_errors", fails)
    found = judge_scene(0, first("two-link arch", "forces"))
    assert not found.left_out
    assert [own.outcome for own in found.checked] == ["outside", "outside"]
    assert faults([found]) == ["2 estimates are off without a doubt"]


def crash(seed: int) -> Judged:
    """Ends the process."""
    os._exit(seed)


def hang(seed: int) -> Judged:
    """Uses a processor for too long."""
    while time.process_time() < 600.0:
        pass
    return Judged(seed, "")


@pytest.mark.parametrize(("judge", "limit", "left_out"), [(crash, 120.0, ""), (hang, 1.0, "too slow")])
def test_scenes_that_crash_are_outside_and_those_that_hang_are_left_out(judge: Callable, limit, left_out):
    (found,) = side_by_side(judge, [3], failed, limit=limit, processes=1)
    assert found.left_out == left_out
    assert [own.outcome for own in found.checked] == ([] if left_out else ["outside"])


WITHIN, NEEDLESS = Estimate(1.0, 1.0), Estimate(1.0, 1.0, doubts=("limit point near",))
SAID, OUTSIDE = Estimate(9.0, 1.0, doubts=("limit point near",)), Estimate(9.0, 1.0)


@pytest.mark.parametrize(
    ("odd", "allowed"),
    [
        (Judged(0, "", checked_elements=SAID), 5),
        (Judged(0, "", checked_elements=NEEDLESS), 10),
        (Judged(0, "", left_out="too slow"), 20),
        (Judged(0, "", checked_elements=OUTSIDE), 0),
    ],
    ids=["said", "needless", "left out", "outside"],
)
def test_shares_of_doubts_and_of_scenes_left_out_are_bounded(odd, allowed):
    plain = Judged(0, "", checked_elements=WITHIN)
    for count, wrong in ((allowed, False), (allowed + 1, True)):
        assert bool(faults([odd] * count + [plain] * (100 - count))) == wrong
