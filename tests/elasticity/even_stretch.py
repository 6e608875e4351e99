"""Blocks of the default law stretched evenly in some directions and free in the others: closed form and simulation."""

import numpy as np
from scipy.optimize import brentq

from fenicsmech.elasticity import ElasticBody

from .mixed_newton import solve
from .single_link import nodes


def free_stretch(others: tuple[float, ...], count: int, *, young: float, poisson: float) -> tuple[float, float]:
    """The equal stretches b of ``count`` free directions beside ``others``, and the pressure, of the default law.

    b ∂W/∂b = μ (b² − 1) + λ (J² − 1)/2 = 0,     p = −λ (J − 1/J)/2
    """
    mu = young / (2.0 * (1.0 + poisson))
    lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))

    def stress(b: float) -> float:
        J = np.prod(others) * b**count
        return mu * (b**2 - 1.0) + lame / 2.0 * (J**2 - 1.0)

    b = brentq(stress, 0.2, 10.0, xtol=1e-15, rtol=1e-14)
    J = np.prod(others) * b**count
    return b, -lame * (J - 1.0 / J) / 2.0


def stretch(body: ElasticBody, ratio: float, *, pulled: int) -> None:
    """Pulls a unit square or cube to ``ratio`` along its first ``pulled`` axes; its sides slide on walls."""
    owned = body.u.function_space.dofmap.index_map.size_local
    dim, X = body.model.dim, nodes(body.u)[:owned]
    fixed, values = [], []
    for axis in range(dim):
        for side, change in ((0.0, 0.0), (1.0, ratio - 1.0)):
            if side == 1.0 and axis >= pulled:
                continue
            there = np.flatnonzero(np.abs(X[:, axis] - side) < 1e-9)
            fixed.append(dim * there + axis)
            values.append(np.full(len(there), change))
    solve(body, np.concatenate(fixed), np.concatenate(values), steps=10)
