"""Derivatives by changes of temperature pass Taylor tests, of links that are prestrained as well."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from mpi4py import MPI

import fenicsmech as fm

from .test_numbers import assert_derivatives
from .test_sensitivity import Bench


def effects(mechanism: fm.Mechanism) -> Sequence[fm.Effect]:
    left, right = mechanism.flexible_links
    return [fm.Temperature(120.0, left), fm.Temperature(120.0, right), fm.Prestrain(right, 1.02, (0, 1))]


@pytest.fixture(
    scope="module",
    params=[
        pytest.param("plane-stress", marks=pytest.mark.parallel),
        pytest.param("plane-strain", marks=pytest.mark.thorough),
    ],
)
def bench(request) -> Bench:
    pressure = fm.MixedFormulation(above=0.3) if request.param == "plane-strain" else None
    return Bench(request.param, MPI.COMM_WORLD, pressure, effects=effects)


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.thorough)])
def test_derivatives_by_a_change_of_temperature(bench, count):
    warmings = bench.simulation.scene.effects[1 - count // 2 : 2]
    assert_derivatives(bench, fm.TemperatureChange(*warmings), (80.0, 40.0, 20.0, 10.0))


def test_a_change_of_temperature_is_known_by_the_names_of_its_links(bench):
    scene = bench.simulation.scene
    kind = fm.TemperatureChange(*scene.effects[:2])
    assert kind.name == "change of temperature of 'left' and 'right'"
    assert fm.TemperatureChange.read(scene, kind.words) == kind
    uneven = fm.Temperature(dict(zip(scene.mechanism.flexible_links, (5.0, 6.0), strict=True)))
    with pytest.raises(fm.DescriptionError, match=r"'left, right': they are drawn with 5, 6\. Draw parts alike"):
        fm.TemperatureChange(uneven).check(fm.Scene(scene.mechanism, [uneven]), 2)


def test_changes_that_leave_no_length_are_refused(bench):
    warm = bench.simulation.scene.effects[0]
    coldest = -1.0 / warm.links[0].material.expansion
    fm.TemperatureChange(warm).check_value(0.99 * coldest)
    with pytest.raises(fm.DescriptionError, match="'left'.*leave no length.*smaller change"):
        fm.TemperatureChange(warm).check_value(coldest)
