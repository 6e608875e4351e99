"""An inextensible cantilever that a force at its tip wraps round a circle, by shooting; lengths over its own.

The circle touches the clamped end from below. Up to the arc a the beam lies on it, with its curvature 1/R; beyond it is
an elastica under the dead load P across the undeformed beam, θ the angle below that, p = P L² / EI:

    θ″ = −p cos θ,     θ(a) = a / R,     θ′(a) = 1 / R,     θ′(1) = 0,

where the shear force may jump at a and the moment may not. Where p < 1/R in small deflections, the force does not bend
the root as far as the circle: a = 0, and θ′(0) is what is found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


class Wrapped(NamedTuple):
    """Where the beam leaves the circle, a, and the deflection of its tip."""

    leaves: float
    deflection: float


def wrap(load: float, radius: float) -> Wrapped:
    """The beam under ``load`` p on a circle of ``radius`` R of its centreline; p up to about 5."""
    if _free(load, 0.0, 0.0, 1.0 / radius)[1] >= 0.0:
        root = brentq(lambda bent: _free(load, 0.0, 0.0, bent)[1], 0.0, 1.0 / radius, xtol=1e-15)
        return Wrapped(0.0, float(_free(load, 0.0, 0.0, root)[2]))

    def beyond(a: float) -> np.ndarray:
        return _free(load, a, a / radius, 1.0 / radius)

    leaves = brentq(lambda a: beyond(a)[1], 0.0, 1.0 - 1e-9, xtol=1e-14)
    return Wrapped(leaves, float(radius * (1.0 - np.cos(leaves / radius)) + beyond(leaves)[2]))


def _free(load: float, start: float, angle: float, curvature: float) -> np.ndarray:
    """θ, θ′ and the deflection since ``start`` at the tip."""

    def rates(_, y):
        return [y[1], -load * np.cos(y[0]), np.sin(y[0])]

    return solve_ivp(rates, (start, 1.0), [angle, curvature, 0.0], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
