"""Measures v ≥ 0 of recovered stresses or strains at the points of the surface, with their derivatives.

    stress    v = σ_vM
    strain    v = ε₁, the largest principal nominal strain of the elastic deformation
    safety    v = σ_vM / σ_allowable or ε₁ / ε_allowable,     S = 1 / max v
    life      v = (σ_ar / σ_f′)^(β/|b|),     log₁₀ N = −log₁₀(2 max v^(1/β))

with σ_ar of the cycle between no stress and the sample, σ_a = σ_vM/2 about σ_m = tr σ/2, and β the largest |b| of the
links.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import goodman
from fenicsmech.stress.drawn import FittedStress
from fenicsmech.stress.recovered import Recovered, principal_strain, von_mises

_LEAST_REST = 0.1  # of 1 − σ_m / σ_u, below which Goodman's line goes on along its tangent


class Measure(ABC):
    """A measure v ≥ 0 of stresses or strains, and the quantity of its largest value.

    Attributes:
        strained: whether it needs the elastic part of F.
    """

    strained: bool = False

    @abstractmethod
    def values(self, fields: Recovered | FittedStress, links: np.ndarray) -> np.ndarray:
        """v, (facets, p), of facets on ``links`` (facets,)."""

    @abstractmethod
    def slopes(
        self, fields: FittedStress, links: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Derivatives of Σ ``weights`` v by σ and, if ``strained``, by the elastic part of F."""

    def total(self, largest: float) -> tuple[float, float]:
        """The quantity of the largest value, and its derivative by it."""
        return largest, 1.0


class Stress(Measure):
    """σ_vM."""

    def values(self, fields, links):
        return von_mises(fields.stress)

    def slopes(self, fields, links, weights):
        return weights[..., None, None] * _von_mises_slopes(fields.stress), None


class Strain(Measure):
    """ε₁."""

    strained = True

    def values(self, fields, links):
        return principal_strain(fields.elastic)

    def slopes(self, fields, links, weights):
        return np.zeros_like(fields.stress), weights[..., None, None] * _principal_slopes(fields.elastic)


class Utilisation(Measure):
    """σ_vM or ε₁ over the allowable one of each link.

    Args:
        stresses, strains: reciprocals of the allowable ones by number of the link, 0 where there is none.
    """

    def __init__(self, stresses: np.ndarray, strains: np.ndarray) -> None:
        self._stresses, self._strains = stresses, strains
        self.strained = bool(strains.any())

    def values(self, fields, links):
        found = self._stresses[links, None] * von_mises(fields.stress)
        return found + self._strains[links, None] * principal_strain(fields.elastic) if self.strained else found

    def slopes(self, fields, links, weights):
        stresses, strains = ((weights * own[links, None])[..., None, None] for own in (self._stresses, self._strains))
        by_elastic = strains * _principal_slopes(fields.elastic) if self.strained else None
        return stresses * _von_mises_slopes(fields.stress), by_elastic

    def total(self, largest):
        return 1.0 / _stressed(largest), -1.0 / largest**2


class Fatigue(Measure):
    """(σ_ar / σ_f′)^(β/|b|) of the cycle between no stress and this one.

    Args:
        coefficients, exponents, ultimates: σ_f′, b and σ_u by number of the link; nan where it does not count.
    """

    def __init__(self, coefficients: np.ndarray, exponents: np.ndarray, ultimates: np.ndarray) -> None:
        self._coefficients, self._ultimates = coefficients, ultimates
        self._beta = float(np.nanmax(-exponents))
        self._powers = self._beta / -exponents

    def values(self, fields, links):
        amplitude, factor, _ = self._cycle(fields, links)
        return (amplitude * factor / self._coefficients[links, None]) ** self._powers[links, None]

    def slopes(self, fields, links, weights):
        amplitude, factor, by_mean = self._cycle(fields, links)
        power = self._powers[links, None]
        reversed_ = amplitude * factor / self._coefficients[links, None]
        weights = weights * power * reversed_ ** (power - 1.0) / self._coefficients[links, None]
        by_stress = (0.5 * weights * factor)[..., None, None] * _von_mises_slopes(fields.stress)
        return by_stress + (0.5 * weights * amplitude * by_mean)[..., None, None] * np.eye(3), None

    def total(self, largest):
        decades = -np.log10(2.0) - np.log10(_stressed(largest)) / self._beta
        return float(decades), -1.0 / (np.log(10.0) * self._beta * largest)

    def _cycle(self, fields, links) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """σ_a, σ_ar / σ_a and its derivative by σ_m, (facets, p) each."""
        mean = 0.5 * np.trace(fields.stress, axis1=-2, axis2=-1)
        return 0.5 * von_mises(fields.stress), *goodman(mean, self._ultimates[links, None], least=_LEAST_REST)


def _stressed(largest: float) -> float:
    """The largest value, where it is not zero."""
    if largest > 1e-100:
        return largest
    raise DescriptionError("factor of safety or life", "no link is stressed", "Give a sample with a load")


def _von_mises_slopes(stress: np.ndarray) -> np.ndarray:
    """∂σ_vM/∂σ = 3/2 dev σ / σ_vM, (…, 3, 3)."""
    deviator = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)
    return 1.5 * deviator / np.maximum(von_mises(stress), 1e-300)[..., None, None]


def _principal_slopes(F: np.ndarray) -> np.ndarray:
    """∂λ₁/∂F = n ⊗ N, (…, d, d)."""
    left, _, right = np.linalg.svd(F)
    return left[..., :, :1] * right[..., :1, :]
