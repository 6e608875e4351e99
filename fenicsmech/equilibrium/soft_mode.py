"""The softest mode of a tangent, by inverse iteration with the factor at hand.

    y = K⁻¹ M φ,    μ = (y · M φ) / (y · M y),    φ ← y / √(y · M y)

M is the identity of the coordinates s and 0 for multipliers and force; μ is an eigenvalue of K under the constraints,
with an error of second order in that of φ. Near a bifurcation μ is by far the smallest of all, and one iteration does.
"""

from __future__ import annotations

import math

import numpy as np

from fenicsmech.equilibrium.solver import Linearisation
from fenicsmech.equilibrium.system import EquilibriumSystem

_SETTLED = 1e-3  # relative change of μ
_MOST = 12  # iterations: where two modes are as soft as each other, any of them will do


class SoftMode:
    """Keeps the mode from one state of a path to the next.

    Args:
        system: whose scaled unknowns are used.
    """

    def __init__(self, system: EquilibriumSystem) -> None:
        self._mask = system.unknowns.coordinates_mask()
        self._mode = self._mask.duplicate()
        # of no symmetry, lest it has nothing of the mode in it
        rank = system.comm.rank
        self._mode.array_w[:] = np.random.default_rng(rank).standard_normal(self._mode.local_size)

    def stiffness(self, at: Linearisation) -> float:
        """μ of a tangent."""
        mask, mode, before = self._mask, self._mode, math.inf
        right = mask.duplicate()
        for _ in range(_MOST):
            right.pointwiseMult(mask, mode)
            right.normalize()
            mode = at.solve(right)
            product = mode.dot(right)
            masked = mask.duplicate()
            masked.pointwiseMult(mask, mode)
            value = product / masked.norm() ** 2
            if abs(value - before) <= _SETTLED * abs(value):
                break
            before = value
        self._mode = mode
        return value
