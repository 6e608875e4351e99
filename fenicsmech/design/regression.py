"""Confidence intervals of parameters at a minimum of least squares.

With residuals r (n,), relative to the size of their errors, J = ∂r/∂θ (n, p) and their standard deviation
σ = |r| / √(n − p),

    covariance of θ = σ² (JᵀJ)⁻¹,     interval  θ ± t · standard error,     t Student's quantile for n − p.

Source: Seber & Wild, Nonlinear Regression (doi:10.1002/0471725315), chapters 2 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import t as student

from fenicsmech.errors import DescriptionError, real_array


@dataclass(frozen=True)
class Regression:
    """Standard deviation of the residuals, and of each parameter its standard error and interval, by name."""

    spread: float
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]


def regression(
    what: str, names: Sequence[str], x: NDArray, residuals: NDArray, J: NDArray, confidence: float
) -> Regression:
    """Of the parameters x (p,) by their ``names``.

    Raises:
        DescriptionError: ``what`` leaves a combination of parameters open.
    """
    freedom = len(residuals) - len(x)
    spread = float(np.sqrt(residuals @ residuals / freedom))
    lengths = np.linalg.norm(J, axis=0)
    # a singular value of columns of unit length below rounding: a combination of parameters changes nothing
    _, sizes, combinations = np.linalg.svd(J / np.where(lengths > 0.0, lengths, 1.0))
    if sizes[-1] <= len(residuals) * np.finfo(float).eps * sizes[0]:
        free = [name for name, part in zip(names, combinations[-1], strict=True) if abs(part) > 0.1]
        problem = f"the tests do not determine {', '.join(free)}"
        raise DescriptionError(what, problem, "Hold one at a known value, or give other tests")
    errors = spread * np.linalg.norm(combinations.T / sizes, axis=1) / lengths
    reach = float(student.ppf(0.5 + 0.5 * confidence, freedom)) * errors
    return Regression(
        spread=spread,
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
        intervals={n: (v - r, v + r) for n, v, r in zip(names, x.tolist(), reach.tolist(), strict=True)},
    )


def error_sizes(part: str, errors: ArrayLike | None, measured: NDArray) -> NDArray:
    """Sizes (n,) of the errors of ``measured`` values (n,): one or (n,); None: the largest of these.

    Raises:
        DescriptionError: there are not as many, or one is not positive.
    """
    given = np.abs(measured).max() if errors is None else errors
    sizes = real_array(f"errors of {part}", np.broadcast_to(given, np.shape(given) or measured.shape), len(measured))
    if np.any(sizes <= 0.0):
        raise DescriptionError(f"errors of {part}", f"one is {sizes.min():g}", "Give positive numbers")
    return sizes
