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
    potential: Potential, places: list[Place], residual: Callable[[list[Place]], np.ndarray]
) -> np.ndarray:
    """Velocities of all bodies along which a dimensionless ``residual`` of their places stays, as ``body_modes``."""
    count, size, length = len(places), (3 if potential.blueprint.dim == 2 else 6), potential.blueprint.length
    dim = potential.blueprint.dim
    scale = np.array([1.0] * dim + [1.0 / length] * (size - dim))
    columns, names = [], [i for i in range(count) if not potential.fixed[i]]
    for body in names:
        for k in range(size):
            velocity = np.zeros((count, size), dtype=complex)
            velocity[body, k] = 1j * STEP * scale[k]
            rates = residual(moved(places, velocity)).imag / STEP * length
            columns.append(rates.astype(float))
    jacobian = np.array(columns).T.reshape(-1, len(columns))
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    null = right[int(np.sum(values > THRESHOLDS.rank * max(values.max(initial=0.0), 1.0))) :]
    modes = np.zeros((len(null), count, size))
    modes[:, names] = null.reshape(len(null), len(names), size) * scale
    return modes
