"""Derivatives of scalar forms by a field, by a Taylor test along a random direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.compat import compile_form

from ..oracles.dense import TaylorRates, taylor_rates

STEPS = 10.0 ** -np.arange(1.5, 3.6, 0.5)


@dataclass(frozen=True)
class FormDerivative:
    """Error of a form's derivative, its value, and its slope along the direction."""

    rates: TaylorRates
    value: float
    slope: float


def form_derivative(form: ufl.Form, field: fem.Function, *, size: float, seed: int) -> FormDerivative:
    """At the present values of ``field``, which stay; entries of the direction are up to ``size``."""
    compiled, start = compile_form(form), field.x.array.copy()
    gradient = fem.assemble_vector(compile_form(ufl.derivative(form, field))).array
    direction = np.random.default_rng(seed).uniform(-size, size, len(start))

    def value(values: np.ndarray) -> float:
        field.x.array[:] = values
        return fem.assemble_scalar(compiled)

    rates = taylor_rates(value, start, direction, gradient, STEPS)
    here = value(start)  # puts the values back
    assert rates.without[-1] > 0.95
    return FormDerivative(rates, here, float(gradient @ direction))
