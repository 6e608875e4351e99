"""Designs of least mass: lighter than drawn, with every bound kept on corrected values and in the exported part."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fenicsmech as fm

from .mechanisms import truss
from .test_verification import flexure

KEPT = 2e-3  # SQP's violation, 0.1 %, and the last change of a correction, 0.1 % or a tenth of the estimate


def lightest(size: float, **bounds: float) -> tuple[fm.DesignProblem, fm.DesignResult]:
    """The lightest truss finger whose tip moves under 0.4 N as bounded."""
    case = truss((0.4, 1.0))
    (design,), (target,) = case.designs, case.targets
    targets = [fm.Target(target.quantity, target.sample, **{name: value}) for name, value in bounds.items()]
    targets.append(fm.Target(fm.LinkMass(design.link), least=True))
    problem = fm.DesignProblem(case.simulate(size=size), case.designs, targets=targets)
    return problem, problem.optimise()


@cache
def stiff() -> tuple[fm.DesignProblem, fm.DesignResult]:
    """At most 1 mm, where the drawn finger moves by 1.75 mm."""
    return lightest(3.0, at_most=1.0)


def test_lightest_finger_is_lighter_than_drawn_and_keeps_a_bound_that_the_drawn_one_breaks():
    _, result = stiff()
    bounded, mass = result.targets
    assert bounded.started > 1.5
    assert mass.reached < 0.9 * mass.started
    assert bounded.error <= KEPT and bounded.corrected <= 1.0 + KEPT
    assert bounded.corrected > 0.98  # the bound is what holds the mass up
    assert result.converged and result.verified


def test_no_thickness_is_left_to_take_away_where_the_bound_does_not_hold():
    _, result = lightest(3.0, at_most=100.0)
    assert result.targets[0].error == 0.0
    assert result.thickness[0] < 1.6 and "thickness" in " ".join(result.active)
    assert result.targets[1].reached < stiff()[1].targets[1].reached


@pytest.mark.thorough
def test_a_band_is_kept_on_both_sides():
    _, result = lightest(3.0, at_least=3.0, at_most=3.2)
    assert [target.relation for target in result.targets[:2]] == ["at least", "at most"]
    assert all(target.error <= KEPT for target in result.targets)
    assert result.targets[2].reached < 0.8 * result.targets[2].started
    assert result.converged


def test_bounds_that_contradict_each_other_end_by_name():
    _, result = lightest(3.0, at_least=3.0, at_most=2.0)
    assert not result.converged
    assert "violated" in result.reason
    assert sorted(target.met for target in result.targets) == [False, False, True]


@pytest.mark.thorough
def test_exported_part_keeps_the_bound():
    problem, result = stiff()
    verified = problem.verify(result)
    bounded = verified.targets[0].part
    assert bounded is not None and bounded.error <= 0.01
    assert bounded.value + bounded.finer_elements_add <= 1.01


def test_a_start_that_carries_loads_under_which_the_drawn_design_snaps_gives_the_scale():
    sim, leaf, push = flexure(1.0)
    mass, bounded = (
        fm.LinkMass(leaf, density=1e-9),
        fm.Target(fm.Displacement(push), fm.Sample({push: 20.0}), at_most=2),
    )
    numbers, least = [fm.Number(fm.Depth(leaf), 4.5, 9.5)], fm.Target(mass, least=True)
    problem = fm.DesignProblem(sim, numbers, targets=[least, bounded])
    with pytest.raises(fm.EquilibriumError, match="has no value"):
        problem.optimise()
    result = problem.optimise(start=np.array([0.8]), optimiser=fm.SQP(iterations=1))
    assert result.targets[0].started == pytest.approx(8.5 * 2.0 * 40.0 * 1e-9, rel=0.05)
    assert result.objective[0] == pytest.approx(1.0, abs=1e-6)
