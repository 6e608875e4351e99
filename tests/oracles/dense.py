"""Dense derivatives by finite differences, and Taylor tests: oracles for hand-made and derived gradients.

A central difference D(h) has an error in even powers of h only, so Richardson's extrapolation over h, h/2, h/4, …
removes them one by one; Ridders' rule picks, entry by entry, the member of the tableau that agrees best with its
neighbours. That reaches about 1e-10 relative when the largest step stays within the distance over which f is smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

ScalarFunction = Callable[[np.ndarray], float]
VectorFunction = Callable[[np.ndarray], np.ndarray]

LEVELS = 5


def jacobian(f: VectorFunction, x: Sequence[float], *, step: float | Sequence[float] = 0.05) -> np.ndarray:
    """∂f_i/∂x_j, shape (*f.shape, n), of a function of x (n,).

    step: the largest step, one or per variable, in the units of x; the smallest is step / 16.
    Costs 10 n evaluations.
    """
    x = np.asarray(x, dtype=float)
    steps = np.broadcast_to(np.asarray(step, dtype=float), x.shape)

    def column(j: int) -> np.ndarray:
        def difference(fraction: float) -> np.ndarray:
            h = np.zeros_like(x)
            h[j] = fraction * steps[j]
            return (np.asarray(f(x + h), dtype=float) - np.asarray(f(x - h), dtype=float)) / (2.0 * h[j])

        return _extrapolate(difference)

    return np.stack([column(j) for j in range(x.size)], axis=-1)


def gradient(f: ScalarFunction, x: Sequence[float], *, step: float | Sequence[float] = 0.05) -> np.ndarray:
    """∂f/∂x (n,) of a scalar function of x (n,); see ``jacobian``."""
    return jacobian(lambda y: np.asarray(float(f(y))), x, step=step)


def hessian(f: ScalarFunction, x: Sequence[float], *, step: float | Sequence[float] = 0.05) -> np.ndarray:
    """∂²f/∂x∂x (n, n), exactly symmetric, from values of f alone.

    step: as in ``jacobian``; rounding grows with 1/step², so take it as large as f allows. Costs 10 n² evaluations.
    """
    x = np.asarray(x, dtype=float)
    steps = np.diag(np.broadcast_to(np.asarray(step, dtype=float), x.shape))
    result = np.empty((x.size, x.size))
    for i in range(x.size):
        for j in range(i + 1):

            def difference(fraction: float, a: np.ndarray = steps[i], b: np.ndarray = steps[j]) -> np.ndarray:
                # [f(+a+b) − f(+a−b) − f(−a+b) + f(−a−b)] / 4ab, also right for a = b
                a, b = fraction * a, fraction * b
                bend = f(x + a + b) - f(x + a - b) - f(x - a + b) + f(x - a - b)
                return np.asarray(bend / (4.0 * a.sum() * b.sum()))

            result[i, j] = result[j, i] = _extrapolate(difference)
    return result


@dataclass(frozen=True)
class TaylorRates:
    """Orders at which the remainders of a Taylor expansion fall, one per pair of successive steps.

    without: of |f(x + h d) − f(x)|, 1 for a smooth f; with_gradient: of |f(x + h d) − f(x) − h ∇f·d|, 2 when the
    gradient is right; remainder: the latter's values, to see that they are not yet rounding.
    """

    without: np.ndarray
    with_gradient: np.ndarray
    remainder: np.ndarray


def taylor_rates(
    f: Callable[[np.ndarray], float | np.ndarray],
    x: Sequence[float],
    direction: Sequence[float],
    gradient: Sequence[float] | np.ndarray,
    steps: Sequence[float],
) -> TaylorRates:
    """Taylor test of ``gradient`` (n,) of a scalar f, or Jacobian (m, n) of a vector f, along ``direction`` (n,).

    steps: decreasing step lengths h.
    """
    x, direction, steps = (np.asarray(v, dtype=float) for v in (x, direction, steps))
    base, slope = np.asarray(f(x)), np.asarray(gradient) @ direction
    change = [np.asarray(f(x + h * direction)) - base for h in steps]
    first = np.array([np.linalg.norm(c) for c in change])
    second = np.array([np.linalg.norm(c - h * slope) for c, h in zip(change, steps, strict=True)])
    return TaylorRates(_rates(first, steps), _rates(second, steps), second)


def linear_term(remainders: Sequence[float]) -> float:
    """|b| h from remainders r = b h + c h² + d h³ of a Taylor test at h, h/2 and h/4.

    b is the error of the derivative. A remainder b h + c h² has the rate 2 − log₂(1 + b h / r) from h to h/2: a rate of
    1.95 says that b h / r = 0.035. Terms of third order that nearly cancel c h² spoil the rate, but not b h.
    """
    return abs(float(np.dot((1.0, -12.0, 32.0), remainders))) / 3.0


def _rates(values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    values = np.maximum(values, np.finfo(float).tiny)
    return np.log(values[:-1] / values[1:]) / np.log(steps[:-1] / steps[1:])


def _extrapolate(difference: Callable[[float], np.ndarray]) -> np.ndarray:
    """The limit of difference(h) at h = 0 from h = 1, 1/2, …, entry by entry the best of Richardson's tableau."""
    best = np.asarray(difference(1.0), dtype=float)
    error = np.full(best.shape, np.inf)
    row = [best]
    for level in range(1, LEVELS):
        new = [np.asarray(difference(0.5**level), dtype=float)]
        for order, coarse in enumerate(row, start=1):
            new.append(new[-1] + (new[-1] - coarse) / (4.0**order - 1.0))
            doubt = np.maximum(np.abs(new[-1] - new[-2]), np.abs(new[-1] - coarse))
            best = np.where(doubt < error, new[-1], best)
            error = np.minimum(doubt, error)
        row = new
    return best
