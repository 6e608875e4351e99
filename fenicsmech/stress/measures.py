"""Measures v ≥ 0 of recovered stresses or strains at the points of the surface, with their derivatives.

    stress    v = σ_vM
    strain    v = ε₁, the largest principal nominal strain of the elastic deformation
    safety    v = σ_vM / σ_allowable or ε₁ / ε_allowable,     S = 1 / max v
    life      v = (σ_ar / σ_f′)^(β/|b|),     log₁₀ N = −log₁₀(2 max v^(1/β))

with β the largest |b| of the links and σ_ar of the cycle between the sample and another one, of no stress by default,
both stresses turned back with the material, s = Rᵀ σ R:

    σ_a = σ_vM(s − s₀) / 2,     σ_m = tr (s + s₀) / 2.

With F = R U = W Σ Vᵀ and G the derivative by s, that by F through R is W C Vᵀ,

    C_ij = 2 B_ij / (Σ_i + Σ_j),     B = Vᵀ (s G − G s) V,

from dR = R Ω, Ω U + U Ω = Rᵀ dF − dFᵀ R.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import goodman
from fenicsmech.stress.drawn import FittedStress
from fenicsmech.stress.recovered import Recovered, principal_strain, turned_back, von_mises

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
    ) -> tuple[np.ndarray, np.ndarray | float, np.ndarray | None]:
        """Derivatives of Σ ``weights`` v by σ, by F, and, if ``strained``, by the elastic part of F."""

    def between(self, other: Recovered | FittedStress) -> Measure:
        """That of the cycle to another equilibrium, where a measure is one of cycles."""
        raise NotImplementedError

    def total(self, largest: float) -> tuple[float, float]:
        """The quantity of the largest value, and its derivative by it."""
        return largest, 1.0


class Stress(Measure):
    """σ_vM."""

    def values(self, fields, links):
        return von_mises(fields.stress)

    def slopes(self, fields, links, weights):
        return weights[..., None, None] * _von_mises_slopes(fields.stress), 0.0, None


class Strain(Measure):
    """ε₁."""

    strained = True

    def values(self, fields, links):
        return principal_strain(fields.elastic)

    def slopes(self, fields, links, weights):
        return np.zeros_like(fields.stress), 0.0, weights[..., None, None] * _principal_slopes(fields.elastic)


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
        return stresses * _von_mises_slopes(fields.stress), 0.0, by_elastic

    def total(self, largest):
        return 1.0 / _stressed(largest), -1.0 / largest**2


class Fatigue(Measure):
    """(σ_ar / σ_f′)^(β/|b|) of the cycle between no stress, or the other equilibrium of ``between``, and this one.

    Args:
        coefficients, exponents, ultimates: σ_f′, b and σ_u by number of the link; nan where it does not count.
    """

    def __init__(self, coefficients: np.ndarray, exponents: np.ndarray, ultimates: np.ndarray) -> None:
        self._coefficients, self._ultimates = coefficients, ultimates
        self._beta = float(np.nanmax(-exponents))
        self._powers = self._beta / -exponents
        self._other = np.zeros((3, 3))

    def between(self, other):
        found = copy(self)
        found._other = turned_back(other.stress, other.F)
        return found

    def values(self, fields, links):
        amplitude, factor, _ = self._cycle(turned_back(fields.stress, fields.F), links)
        return (amplitude * factor / self._coefficients[links, None]) ** self._powers[links, None]

    def slopes(self, fields, links, weights):
        stress = turned_back(fields.stress, fields.F)
        amplitude, factor, by_mean = self._cycle(stress, links)
        power = self._powers[links, None]
        reversed_ = amplitude * factor / self._coefficients[links, None]
        weights = weights * power * reversed_ ** (power - 1.0) / self._coefficients[links, None]
        by_stress = (0.5 * weights * factor)[..., None, None] * _von_mises_slopes(stress - self._other)
        by_stress += (0.5 * weights * amplitude * by_mean)[..., None, None] * np.eye(3)
        return *_turned_slopes(stress, fields.F, by_stress), None

    def total(self, largest):
        decades = -np.log10(2.0) - np.log10(_stressed(largest)) / self._beta
        return float(decades), -1.0 / (np.log(10.0) * self._beta * largest)

    def _cycle(self, stress: np.ndarray, links: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """σ_a, σ_ar / σ_a and its derivative by σ_m, (facets, p) each, of the stress turned back."""
        mean = 0.5 * np.trace(stress + self._other, axis1=-2, axis2=-1)
        return 0.5 * von_mises(stress - self._other), *goodman(mean, self._ultimates[links, None], least=_LEAST_REST)


def _stressed(largest: float) -> float:
    """The largest value, where it is not zero."""
    if largest > 1e-100:
        return largest
    raise DescriptionError("factor of safety or life", "no link is stressed", "Give a sample with a load")


def _turned_slopes(turned: np.ndarray, F: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by σ, (…, 3, 3), and F, (…, d, d), from those by the stress ``turned`` back, (…, 3, 3)."""
    dim, rotation = F.shape[-1], np.broadcast_to(np.eye(3), turned.shape).copy()
    W, stretches, Vt = np.linalg.svd(F)
    rotation[..., :dim, :dim] = W @ Vt
    spin = (turned @ slopes - slopes @ turned)[..., :dim, :dim]
    B = Vt @ spin @ np.swapaxes(Vt, -1, -2)
    by_F = W @ (2.0 * B / (stretches[..., :, None] + stretches[..., None, :])) @ Vt
    return rotation @ slopes @ np.swapaxes(rotation, -1, -2), by_F


def _von_mises_slopes(stress: np.ndarray) -> np.ndarray:
    """∂σ_vM/∂σ = 3/2 dev σ / σ_vM, (…, 3, 3)."""
    deviator = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)
    return 1.5 * deviator / np.maximum(von_mises(stress), 1e-300)[..., None, None]


def _principal_slopes(F: np.ndarray) -> np.ndarray:
    """∂λ₁/∂F = n ⊗ N, (…, d, d)."""
    left, _, right = np.linalg.svd(F)
    return left[..., :, :1] * right[..., :1, :]
