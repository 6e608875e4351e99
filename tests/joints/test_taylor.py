"""The Taylor test accepts right derivatives and rejects wrong ones."""

import numpy as np
import pytest

from .taylor import assert_derivative

X = np.array([0.4, -0.9])


def cubic(x):
    return np.array([x[0] ** 3 * x[1], x[0] - 2.0 * x[1]])


JACOBIAN = np.array([[3.0 * X[0] ** 2 * X[1], X[0] ** 3], [1.0, -2.0]])


def test_right_derivative_passes():
    assert_derivative(cubic, X, JACOBIAN, np.random.default_rng(0))


@pytest.mark.parametrize("entry", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_one_wrong_entry_fails(entry):
    wrong = JACOBIAN.copy()
    wrong[entry] *= 1.01
    with pytest.raises(AssertionError):
        assert_derivative(cubic, X, wrong, np.random.default_rng(0))
