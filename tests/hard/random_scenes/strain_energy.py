"""Strain energy densities as textbooks write them, in F: no invariants of ∇u, no symbolic derivatives.

Textbook forms lose digits at small strain, so they are evaluated in extended precision (``REAL``: 64 bits of mantissa
or more). Arguments may be complex: a step along the imaginary axis, W(F + i h D), gives ∂W/∂F : D as Im W / h without
the difference of two close numbers (Squire & Trapp, doi:10.1137/S003614459631241X).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

REAL, COMPLEX = np.longdouble, np.clongdouble
Density = Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]


def _simo(trace, jacobian, mu, lam):
    return mu / 2 * (trace - 3 - 2 * np.log(jacobian)) + lam / 4 * (jacobian**2 - 1 - 2 * np.log(jacobian))


def _logarithmic(trace, jacobian, mu, lam):
    return mu / 2 * (trace - 3 - 2 * np.log(jacobian)) + lam / 2 * np.log(jacobian) ** 2


def _isochoric(trace, jacobian, mu, lam):
    return mu / 2 * (jacobian ** (-2 / REAL(3)) * trace - 3) + (lam + 2 * mu / 3) / 2 * (jacobian - 1) ** 2


def _isochoric_simo(trace, jacobian, mu, lam):
    volume = (lam + 2 * mu / 3) / 4 * (jacobian**2 - 1 - 2 * np.log(jacobian))
    return mu / 2 * (jacobian ** (-2 / REAL(3)) * trace - 3) + volume


_LAWS: dict[str, Density] = {
    "NeoHookean": _simo,
    "LogarithmicNeoHookean": _logarithmic,
    "IsochoricNeoHookean": _isochoric,
    "IsochoricSimoNeoHookean": _isochoric_simo,
}


def energy_density(F: np.ndarray, law: str, young: float, poisson: float, space: str) -> np.ndarray:
    """W at deformation gradients F (…, dim, dim), per volume at rest, shape (…); NaN where J ≤ 0.

    In plane stress F₃₃ is where W is least, found by Newton's method: there ∂W/∂F₃₃ = 0, so that it need not follow
    an imaginary step of F.
    """
    young, poisson = REAL(young), REAL(poisson)
    mu, lam = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    trace, jacobian = np.sum(F * F, axis=(-2, -1)), _determinant(F)
    if space != "3d":
        across = _free_stretch(jacobian.real, mu, lam) if space == "plane-stress" else 1.0
        trace, jacobian = trace + across**2, jacobian * across
    jacobian = np.where(jacobian.real > 0.0, jacobian, np.nan)
    return _LAWS[law](trace, jacobian, mu, lam)


def _determinant(F: np.ndarray) -> np.ndarray:
    if F.shape[-1] == 2:
        return F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    first, second, third = (F[..., i, :] for i in range(3))
    return np.sum(first * np.cross(second, third), axis=-1)


def _free_stretch(area: np.ndarray, mu: float, lam: float) -> np.ndarray:
    """F₃₃ of the law of Simo where μ (F₃₃ − 1 / F₃₃) + λ/2 (J₂² F₃₃ − 1 / F₃₃) = 0, J₂ = ``area``."""
    stretch = np.ones_like(area)
    for _ in range(60):
        slope = mu * (stretch - 1 / stretch) + lam / 2 * (area**2 * stretch - 1 / stretch)
        bend = mu * (1 + stretch**-2) + lam / 2 * (area**2 + stretch**-2)
        change = np.clip(-slope / bend, -0.5 * stretch, stretch)
        stretch = stretch + change
        if np.max(np.abs(change / stretch), initial=0.0) < 1e-18:
            break
    return stretch
