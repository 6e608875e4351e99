"""Finite-difference oracles against functions whose derivatives are known."""

import numpy as np
import pytest

from . import dense


def energy(x):
    """A smooth function without symmetry: exponential, product, trigonometric and rational terms."""
    return np.exp(0.3 * x[0] * x[1]) + x[2] ** 3 * np.sin(x[1]) + 1.0 / (1.0 + x[0] ** 2 + x[2] ** 2)


def energy_gradient(x):
    e, r = np.exp(0.3 * x[0] * x[1]), 1.0 + x[0] ** 2 + x[2] ** 2
    return np.array(
        [
            0.3 * x[1] * e - 2.0 * x[0] / r**2,
            0.3 * x[0] * e + x[2] ** 3 * np.cos(x[1]),
            3.0 * x[2] ** 2 * np.sin(x[1]) - 2.0 * x[2] / r**2,
        ]
    )


def energy_hessian(x):
    e, r = np.exp(0.3 * x[0] * x[1]), 1.0 + x[0] ** 2 + x[2] ** 2
    h = np.zeros((3, 3))
    h[0, 0] = 0.09 * x[1] ** 2 * e - 2.0 / r**2 + 8.0 * x[0] ** 2 / r**3
    h[1, 1] = 0.09 * x[0] ** 2 * e - x[2] ** 3 * np.sin(x[1])
    h[2, 2] = 6.0 * x[2] * np.sin(x[1]) - 2.0 / r**2 + 8.0 * x[2] ** 2 / r**3
    h[0, 1] = h[1, 0] = 0.3 * e + 0.09 * x[0] * x[1] * e
    h[0, 2] = h[2, 0] = 8.0 * x[0] * x[2] / r**3
    h[1, 2] = h[2, 1] = 3.0 * x[2] ** 2 * np.cos(x[1])
    return h


X = np.array([0.7, -1.2, 0.9])


def test_gradient_of_a_known_function():
    assert dense.gradient(energy, X) == pytest.approx(energy_gradient(X), rel=1e-10)


def test_hessian_of_a_known_function():
    hessian = dense.hessian(energy, X)
    assert hessian == pytest.approx(energy_hessian(X), rel=1e-9)
    assert np.array_equal(hessian, hessian.T)


def test_jacobian_of_the_gradient_is_the_hessian():
    assert dense.jacobian(energy_gradient, X) == pytest.approx(energy_hessian(X), rel=1e-10)


def test_jacobian_keeps_the_shape_of_the_function():
    columns = dense.jacobian(lambda x: np.outer(x, x[:2]), X)
    assert columns.shape == (3, 2, 3)
    assert columns[2, 1] == pytest.approx([0.0, X[2], X[1]], abs=1e-12)


def test_step_per_variable_suits_unknowns_of_unlike_size():
    scale = np.array([1e-4, 1.0, 1e3])
    scaled = dense.gradient(lambda y: energy(y / scale), X * scale, step=0.05 * scale)
    assert scaled * scale == pytest.approx(energy_gradient(X), rel=1e-10)


def test_too_large_a_step_costs_few_digits():
    assert dense.gradient(energy, X, step=0.4) == pytest.approx(energy_gradient(X), rel=1e-6)


def test_taylor_rates_are_one_and_two_with_the_right_gradient():
    steps = 0.1 * 0.5 ** np.arange(6)
    direction = np.array([0.3, -0.5, 0.8])
    rates = dense.taylor_rates(energy, X, direction, energy_gradient(X), steps)
    assert rates.without[-1] == pytest.approx(1.0, abs=0.05)
    assert rates.with_gradient[-1] == pytest.approx(2.0, abs=0.05)
    assert rates.remainder[-1] > 1e-12
    wrong = dense.taylor_rates(energy, X, direction, 1.01 * energy_gradient(X), steps)
    assert wrong.with_gradient[-1] < 1.5


def test_taylor_rates_of_a_vector_function():
    steps = 0.1 * 0.5 ** np.arange(6)
    rates = dense.taylor_rates(energy_gradient, X, np.array([1.0, 0.2, -0.4]), energy_hessian(X), steps)
    assert rates.without == pytest.approx(1.0, abs=0.1)
    assert rates.with_gradient == pytest.approx(2.0, abs=0.1)
