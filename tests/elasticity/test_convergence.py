"""Displacement errors fall with the orders the theory of finite elements expects, at large strain."""

from dataclasses import astuple

import numpy as np
import pytest

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL

from .cases import name
from .manufactured import errors

# order of the displacement: expected orders of its error in L² and of its gradient's
EXPECTED = {1: (2.0, 1.0), 2: (3.0, 2.0)}

# cells along each side, per dimension and order of the displacement
COUNTS = {(2, 1): (8, 16), (2, 2): (4, 8), (3, 1): (5, 10), (3, 2): (3, 6)}


@pytest.mark.thorough
@pytest.mark.parametrize("order", EXPECTED)
@pytest.mark.parametrize("model", [SPATIAL, PLANE_STRAIN, PLANE_STRESS], ids=name)
def test_errors_fall_as_expected(model, order):
    counts = COUNTS[model.dim, order]
    coarse, fine = (np.array(astuple(errors(model, order=order, count=count))) for count in counts)
    rates = np.log(coarse / fine) / np.log(counts[1] / counts[0])
    assert np.all(rates > np.array(EXPECTED[order]) - 0.15)
