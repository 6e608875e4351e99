"""The remainders of logarithms and roots keep all their digits."""

import mpmath
import numpy as np
import pytest
import ufl
from mpmath import mpf

from fenicsmech.laws import cube_root_remainder, log_remainder

from .pointwise import pointwise

SMALL = np.logspace(-12, -1, 40)
VALUES = np.concatenate([SMALL, -SMALL, np.linspace(0.1, 1.0, 10), -np.linspace(0.1, 0.9, 9), [2.0, 5.0, 10.0]])
SWITCH = 0.1  # |j| at which log_remainder changes from a series to the logarithm

REFERENCES = {
    log_remainder: lambda j: j - mpmath.log(1 + j),
    cube_root_remainder: lambda j: (1 + j) ** (mpf(2) / 3) - 1 - 2 * j / 3,
}


def derivatives(remainder):
    """UFL of a remainder's value, slope and curvature."""

    def build(argument):
        j = ufl.variable(argument)
        value = remainder(j)
        slope = ufl.diff(value, j)
        return ufl.as_vector([value, slope, ufl.diff(slope, j)])

    return build


@pytest.mark.parametrize("remainder", REFERENCES)
def test_remainders_and_their_derivatives_are_exact_to_rounding_at_any_size(remainder):
    computed = pointwise(derivatives(remainder), VALUES[:, None])
    with mpmath.workdps(60):
        exact = np.array(
            [[float(mpmath.diff(REFERENCES[remainder], mpf(j), order)) for order in range(3)] for j in VALUES]
        )
    assert computed == pytest.approx(exact, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("switch", [SWITCH, -SWITCH])
def test_series_and_logarithm_meet_smoothly(switch):
    j = np.array([switch, np.nextafter(switch, 0.0), np.nextafter(switch, 2.0 * switch)])
    at, inside, outside = pointwise(derivatives(log_remainder), j[:, None])
    assert inside == pytest.approx(outside, rel=1e-13, abs=0.0)
    assert inside == pytest.approx(at, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("remainder", REFERENCES)
def test_remainders_vanish_with_their_slope_at_zero(remainder):
    value, slope, curvature = pointwise(derivatives(remainder), np.zeros((1, 1)))[0]
    assert value == slope == 0.0
    assert curvature == pytest.approx({log_remainder: 1.0, cube_root_remainder: -2.0 / 9.0}[remainder], rel=1e-15)
