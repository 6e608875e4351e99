"""Recovery of stresses in the coordinates of the drawn links, whose fits do not change with the design; its transpose.

With F̂ = ∂x/∂X₀ from the drawn to the loaded link, what is fitted to polynomials of X₀ is

    T = Ĵ σ F̂⁻ᵀ,     σ* = T* F̂*ᵀ / det F̂*,

with T N₀ = 0 on the free boundary of the drawn link, whatever the design and the deformation are. So values at the
surface are linear in T and F̂ at the samples, with one matrix for all designs, and smooth in the design. They differ
from those that are fitted at the links at rest by errors of the fits alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.stress.recovered import FittedFields, fitted_parts, square, symmetric
from fenicsmech.stress.recovery import PatchRecovery, with_image


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """Fits at points of facets of the surface.

    Attributes:
        recovery: around the vertices of the facets.
        rows: of each corner of each facet in ``recovery``, (facets, dim).
        shares: of the coefficients of each of them at the points, (facets, dim, p, m).
        facets: their numbers among all facets of the surface, (facets,).
        cells: those that can deform, with mirror images.
        half: whether one half is meshed, and the other its mirror image.
    """

    recovery: PatchRecovery
    rows: np.ndarray
    shares: np.ndarray
    facets: np.ndarray
    cells: np.ndarray
    half: bool

    def of(self, samples: np.ndarray) -> FittedStress:
        """The stress at the points.

        Args:
            samples: of all cells of the mesh, σ, F̂ and, if it counts, the elastic part of F,
                (cells, q, 9 + dim² or 9 + 2 dim²).
        """
        dim, whole = self.rows.shape[-1], with_image(samples) if self.half else samples
        own = whole[self.cells]
        T, others = fitted_parts(own, dim)
        fits = self.recovery.fit(T, others)
        found = np.concatenate([self._at(part.reshape(*part.shape[:2], -1)) for part in fits], axis=2)
        sampled = T, square(own[..., 9 : 9 + dim**2])
        return FittedStress(self, samples.shape, sampled, FittedFields.of(found, dim))

    def _at(self, coefficients: np.ndarray) -> np.ndarray:
        return np.einsum("fcpm,fcmr->fpr", self.shares, coefficients[self.rows], optimize=True)

    def transposed(self, values: np.ndarray) -> np.ndarray:
        """Derivatives by all coefficients, (n, m, r), from those by values at the points, (facets, p, r)."""
        found = np.zeros((int(self.rows.max(initial=-1)) + 1, self.shares.shape[-1], values.shape[-1]))
        concerned = np.flatnonzero(values.any(axis=(1, 2)))
        own = np.swapaxes(self.shares[concerned], -1, -2) @ values[concerned, None]
        np.add.at(found, self.rows[concerned], own)
        return found


class FittedStress:
    """The stress at the points of a ``SurfaceFit``.

    Attributes:
        stress: σ*, (facets, p, 3, 3).
        F: F̂*, (facets, p, dim, dim).
        elastic: the elastic part of F, (facets, p, dim, dim), if there were samples of it.
    """

    def __init__(
        self, fit: SurfaceFit, shape: tuple[int, ...], sampled: tuple[np.ndarray, np.ndarray], fields: FittedFields
    ) -> None:
        self._fit, self._shape, self._sampled, self._fitted = fit, shape, sampled, fields.T
        self.stress, self.F, self.elastic = fields.stress, fields.F, fields.elastic

    def transposed(self, stress: np.ndarray, through_F: np.ndarray | float, elastic: np.ndarray | None) -> np.ndarray:
        """Derivatives by the samples, in their shape, from those by ``stress``, ``F`` and ``elastic``."""
        T, F, dim = self._fitted, self.F, self._sampled[0].shape[-1]
        by_stress, J = symmetric(stress[..., :dim, :dim]), np.linalg.det(F)[..., None, None]
        by_T = by_stress @ F / J
        traces = np.einsum("...ij,...ij->...", by_stress, self.stress[..., :dim, :dim])[..., None, None]
        by_F = through_F + by_stress @ T / J - traces * _inverse_transposed(F)
        across = stress[..., 2, 2, None] if dim == 2 else np.zeros((*stress.shape[:2], 1))
        others = [across, _flat(by_F), *([] if elastic is None else [_flat(elastic)])]
        fits = self._fit.transposed(_flat(by_T)), self._fit.transposed(np.concatenate(others, axis=2))
        by_T, rest = self._fit.recovery.fit_transposed(square(fits[0]), fits[1])
        T, F = self._sampled
        J, back = np.linalg.det(F)[..., None, None], _inverse_transposed(F)
        sigma = np.zeros((*T.shape[:2], 3, 3))
        sigma[..., 2, 2] = rest[..., 0]
        sigma[..., :dim, :dim] += J * by_T @ np.swapaxes(back, -1, -2)
        traces = np.einsum("...ij,...ij->...", by_T, T)[..., None, None]
        by_F = traces * back - back @ np.swapaxes(by_T, -1, -2) @ T
        rest = rest[..., 1:]
        rest[..., : dim**2] += _flat(by_F)
        found = np.zeros(((2 if self._fit.half else 1) * self._shape[0], *self._shape[1:]))
        found[self._fit.cells] = np.concatenate([_flat(sigma), rest], axis=2)
        if self._fit.half:
            own, image = np.split(found, 2)
            return own + with_image(image)[len(image) :]
        return found


def _flat(values: np.ndarray) -> np.ndarray:
    """Entries of square matrices, (…, n²)."""
    return values.reshape(*values.shape[:-2], -1)


def _inverse_transposed(F: np.ndarray) -> np.ndarray:
    return np.swapaxes(np.linalg.inv(F), -1, -2)
