"""Fields of the elements at an equilibrium, those recovered from them, and the scalars that peaks are of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class CellFields:
    """Fields of all cells at an equilibrium.

    Attributes:
        nodes: at rest, linear or quadratic, (cells, nodes, dim).
        samples: σ and F at ``ElasticBody.sample_points``, and the elastic part of F if strains are wanted,
            (cells, q, 9 + dim² or 9 + 2 dim²).
        touched: vertices of facets that touch obstacles, (k, dim).
    """

    nodes: np.ndarray
    samples: np.ndarray
    touched: np.ndarray


@dataclass(frozen=True, eq=False)
class Recovered:
    """Recovered at p points of each of k cells or facets.

    Attributes:
        points: at rest, (k, p, dim).
        stress: σ*, (k, p, 3, 3).
        F: F*, (k, p, dim, dim).
        elastic: its elastic part, likewise; None if not asked for.
    """

    points: np.ndarray
    stress: np.ndarray
    F: np.ndarray
    elastic: np.ndarray | None

    def von_mises(self) -> np.ndarray:
        """Von Mises stress, (k, p)."""
        return von_mises(self.stress)

    def principal_strain(self) -> np.ndarray:
        """Largest principal nominal strain of the elastic part of F, (k, p)."""
        assert self.elastic is not None, "strains are recovered with it"
        return principal_strain(self.elastic)


def undeformed(size: int, dim: int) -> np.ndarray:
    """F and, if it counts, its elastic part where nothing deforms, as in samples of ``size`` 9 + dim² or 9 + 2 dim².

    Fits take the difference from it: their ridge is small beside the values fitted, not beside strains of 1e-7.
    """
    return np.tile(np.eye(dim).ravel(), (size - 9) // dim**2)


def turned_back(stress: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Rᵀ σ R of stresses (…, 3, 3), with the rotation R of F = R U, (…, d, d), (…, 3, 3)."""
    R, dim = np.broadcast_to(np.eye(3), stress.shape).copy(), F.shape[-1]
    left, _, right = np.linalg.svd(F)
    R[..., :dim, :dim] = left @ right
    return np.swapaxes(R, -1, -2) @ stress @ R


def von_mises(stress: np.ndarray) -> np.ndarray:
    """√(3/2 dev σ : dev σ) of stresses (…, 3, 3), (…,)."""
    deviator = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("...ij,...ij->...", deviator, deviator))


def principal_strain(F: np.ndarray) -> np.ndarray:
    """Largest principal nominal strain λ₁ − 1 of deformation gradients (…, d, d), (…,)."""
    return np.linalg.svd(F, compute_uv=False)[..., 0] - 1.0
