"""Every options record refuses numbers that its algorithm has no use for, by name, value and remedy."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields

import pytest

import fenicsmech as fm
from fenicsmech.continuation import LoadSteps
from fenicsmech.estimates import AccuracyOptions
from fenicsmech.multibody import RestSearch

RECORDS = (
    fm.ArcSteps,
    LoadSteps,
    fm.HermitePredictor,
    fm.PrimalDualNewton,
    fm.TwoLevel,
    fm.BySize,
    fm.MixedFormulation,
    fm.BFGS,
    fm.SQP,
    fm.LevenbergMarquardt,
    fm.Correction,
    fm.Scatter,
    fm.MeshQuality,
    fm.DoubtOptions,
    fm.StressOptions,
    fm.RecoveryOptions,
    fm.InterpolationOptions,
    fm.SingularityOptions,
    AccuracyOptions,
    RestSearch,
)
NUMBERS = [
    (record, field.name, field.default)
    for record in RECORDS
    for field in fields(record)
    if field.default is not MISSING and type(field.default) in (int, float)
]
# ratios of reductions: one below any that occurs accepts every step
FREE = {(fm.SQP, "poor"), (fm.LevenbergMarquardt, "poor")}


@pytest.mark.parametrize(("record", "name", "default"), NUMBERS, ids=lambda value: getattr(value, "__name__", None))
def test_numbers_of_options_are_finite_and_in_their_range(record, name, default):
    wrong = [math.nan, math.inf, -math.inf, "many", None]
    if (record, name) not in FREE:
        wrong.append(-1)
    if isinstance(default, int):
        wrong += [2.5, True]
    for value in wrong:
        with pytest.raises(fm.DescriptionError, match=r"Give ") as caught:
            record(**{name: value})
        said = str(caught.value)
        assert name in said or "limit" in said
        assert str(value) in said
    assert getattr(record(**{name: default}), name) == default


def test_numbers_of_options_become_plain_ones():
    assert type(fm.ArcSteps(first="0.01").first) is float
    assert fm.LevenbergMarquardt().tolerance is None
    with pytest.raises(fm.DescriptionError, match="tolerance of LevenbergMarquardt"):
        fm.LevenbergMarquardt(tolerance=0.0)


@pytest.mark.parametrize(
    ("record", "given", "said"),
    [
        (fm.ArcSteps, {"tolerance": 2.0}, "tolerance of arc-length steps: 2 is not below 1"),
        (LoadSteps, {"shift_factors": (1.0, -1e-3)}, "shift factor of load steps: -0.001 is negative"),
        (fm.TwoLevel, {"ratio": 1.5}, "ratio of two levels: 1.5 is not below 1"),
        (fm.BFGS, {"armijo": 0.95}, "armijo=0.95 is not below wolfe=0.9"),
        (fm.SQP, {"poor": 0.8}, "poor=0.8 is not below good=0.75"),
        (fm.LevenbergMarquardt, {"good": 0.05}, "poor=0.1 is not below good=0.05"),
        (fm.MixedFormulation, {"above": 0.5}, "0.5. Give one from 0 to below 0.5"),
    ],
)
def test_numbers_of_options_that_contradict_their_algorithm_are_refused(record, given, said):
    with pytest.raises(fm.DescriptionError) as caught:
        record(**given)
    assert said in str(caught.value)
