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


def fitted_parts(samples: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """What polynomials are fitted to: T = J σ F⁻ᵀ, (…, dim, dim), and values that are free at boundaries, (…, r).

    Args:
        samples: σ, F and, if it counts, the elastic part of F, (…, 9 + dim² or 9 + 2 dim²).
        dim: of space.
    """
    stress, F = square(samples[..., :9]), square(samples[..., 9 : 9 + dim**2])
    T = np.linalg.det(F)[..., None, None] * np.swapaxes(np.linalg.solve(F, stress[..., :dim, :dim]), -1, -2)
    # F − I: the ridge of the fits is small beside values, not beside strains of 1e-7
    return T, np.concatenate(
        [stress[..., 2, 2, None], samples[..., 9:] - _identities(samples.shape[-1] - 9, dim)], axis=-1
    )


@dataclass(frozen=True, eq=False)
class FittedFields:
    """What fits have at points.

    Attributes:
        T: fitted, (…, dim, dim).
        F: fitted, (…, dim, dim).
        elastic: its elastic part, likewise; None if not asked for.
        stress: σ = T Fᵀ / det F, symmetric, (…, 3, 3).
    """

    T: np.ndarray
    F: np.ndarray
    elastic: np.ndarray | None
    stress: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, dim: int) -> FittedFields:
        """From fitted ``fitted_parts``, T before the others, (…, dim² + r)."""
        across = values[..., dim**2]
        parts = np.delete(values, dim**2, axis=-1)
        parts[..., dim**2 :] += _identities(parts.shape[-1] - dim**2, dim)
        T, F, *elastic = (square(own) for own in np.split(parts, parts.shape[-1] // dim**2, axis=-1))
        stress = np.zeros((*across.shape, 3, 3))
        stress[..., 2, 2] = across
        stress[..., :dim, :dim] = symmetric(T @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None])
        return cls(T, F, elastic[0] if elastic else None, stress)


def _identities(size: int, dim: int) -> np.ndarray:
    """Entries of as many identities as gradients have ``size`` entries."""
    return np.tile(np.eye(dim).ravel(), size // dim**2)


def square(values: np.ndarray) -> np.ndarray:
    """Square matrices from their entries, (…, n²)."""
    size = round(values.shape[-1] ** 0.5)
    return values.reshape(*values.shape[:-1], size, size)


def symmetric(values: np.ndarray) -> np.ndarray:
    """The symmetric part of square matrices."""
    return 0.5 * (values + np.swapaxes(values, -1, -2))


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
