"""Infinitesimal motions of all bodies of a scene, and those that its joints leave."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .closure import Place
from .potential import Potential
from .thresholds import THRESHOLDS

STEP = 1e-30  # along the imaginary axis


def moved(places: list[Place], velocities: np.ndarray) -> list[Place]:
    """All places after infinitesimal motions (bodies, 3 or 6)."""
    return [body.moved(velocity) for body, velocity in zip(places, velocities, strict=True)]


def body_modes(potential: Potential, places: list[Place]) -> np.ndarray:
    """Velocities of all bodies that keep joints closed, angles times length: (modes, bodies, 3 or 6)."""
    return null_motions(potential, places, potential.closure.residual)


def null_motions(
    potential: Potential,
    places: list[Place],
    residual: Callable[[list[Place]], np.ndarray],
    among: np.ndarray | None = None,
) -> np.ndarray:
    """Velocities of all bodies along which a dimensionless ``residual`` of their places stays, as ``body_modes``:
    ``among`` these, or all."""
    length, dim = potential.blueprint.length, potential.blueprint.dim
    if among is None:
        count, size = len(places), (3 if dim == 2 else 6)
        scale = np.array([1.0] * dim + [1.0 / length] * (size - dim))
        free = [body for body in range(count) if not potential.fixed[body]]
        among = np.zeros((len(free), size, count, size))
        for row, body in enumerate(free):
            among[row, :, body] = np.diag(scale)
        among = among.reshape(-1, count, size)
    rates = [residual(moved(places, 1j * STEP * velocity)).imag / STEP * length for velocity in among]
    jacobian = np.array(rates, dtype=float).reshape(len(among), -1).T
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    null = right[int(np.sum(values > THRESHOLDS.rank * max(values.max(initial=0.0), 1.0))) :]
    return np.tensordot(null, among, 1)
