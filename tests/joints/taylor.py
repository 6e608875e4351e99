"""The Taylor test that every derivative of the package's equations has to pass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..oracles import dense

STEPS = 2e-2 * 0.5 ** np.arange(5)


def assert_derivative(
    f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, derivative: np.ndarray, rng: np.random.Generator
) -> None:
    """Rates of ``f`` (of shape (m,) at x (n,)) along a random direction, for its ``derivative`` (m, n)."""
    direction = rng.standard_normal(x.size)
    rates = dense.taylor_rates(f, x, direction, derivative, STEPS)
    rounding = 1e-13 * (1.0 + np.max(np.abs(f(x)), initial=0.0))
    if rates.remainder[0] > rounding:  # f is not linear, or the derivative is wrong
        assert np.min(rates.with_gradient) >= 1.95
        assert rates.without[-1] >= 0.95
