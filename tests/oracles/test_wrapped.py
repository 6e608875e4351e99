"""The cantilever round a circle against closed forms and the beam oracle."""

import numpy as np
import pytest

from . import beam, centreline, wrapped

INEXTENSIBLE = beam.Section(axial=np.inf, shear=np.inf, bending=1.0)


def test_a_beam_that_leaves_the_circle_at_once_is_the_published_elastica():
    assert wrapped.wrap(10.0 / 9.0, 0.05) == pytest.approx((0.0, 0.32860), abs=6e-6)


@pytest.mark.parametrize("load", [1e-4, 3e-4, 1e-3])
def test_small_deflections_are_those_of_linear_beams(load):
    # it lies on the circle up to a, where its moment is EI / R, and is a cantilever of length 1 − a from there
    radius = 5e3
    free = min(1.0, 1.0 / (load * radius))
    lying = 1.0 - free
    expected = (0.5 * lying**2 + lying * free) / radius + load * free**3 / 3.0
    assert wrapped.wrap(load, radius) == pytest.approx((lying, expected), rel=1e-5)


@pytest.mark.parametrize("load, radius", [(1.0, 2.0), (3.0, 1.0), (4.0, 0.8)])
def test_the_free_part_is_a_cantilever_whose_clamp_has_the_moment_of_the_circle(load, radius):
    leaves, deflection = wrapped.wrap(load, radius)
    angle, free = leaves / radius, 1.0 - leaves
    line = centreline.straight((0.0, 0.0), (free * np.cos(angle), -free * np.sin(angle)))
    x, y = beam.solve(beam.Beam(line, INEXTENSIBLE), beam.CLAMPED, beam.End(force_y=-load)).position[-1]
    assert leaves > 0.1
    assert load * x == pytest.approx(1.0 / radius, rel=1e-8)
    assert deflection == pytest.approx(radius * (1.0 - np.cos(angle)) - y, rel=1e-8)
