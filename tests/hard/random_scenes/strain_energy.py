"""Strain energy densities as textbooks write them, in F: no invariants of ∇u, no symbolic derivatives.

Textbook forms lose digits at small strain, so they are evaluated in extended precision (``REAL``: 64 bits of mantissa
or more). Arguments may be complex: a step along the imaginary axis, W(F + i h D), gives ∂W/∂F : D as Im W / h without
the difference of two close numbers (Squire & Trapp, doi:10.1137/S003614459631241X).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

REAL, COMPLEX = np.longdouble, np.clongdouble
Density = Callable[..., np.ndarray]


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


def _mixed_simo(trace, jacobian, p, mu, lam):
    q = -p / lam
    best = q + np.sqrt(1 + q**2)
    complement = q * (best - 1) - (best**2 - 1 - 2 * np.log(best)) / 4
    return mu / 2 * (trace - 3 - 2 * np.log(jacobian)) - p * (jacobian - 1) - lam * complement


def _mixed_logarithmic(trace, jacobian, p, mu, lam):
    return mu / 2 * (trace - 3 - 2 * np.log(jacobian)) - p * np.log(jacobian) - p**2 / (2 * lam)


def _mixed_isochoric(trace, jacobian, p, mu, lam):
    bulk = lam + 2 * mu / 3
    return mu / 2 * (jacobian ** (-2 / REAL(3)) * trace - 3) - p * (jacobian - 1) - p**2 / (2 * bulk)


def _mixed_isochoric_simo(trace, jacobian, p, mu, lam):
    q = -p / (lam + 2 * mu / 3)
    best = q + np.sqrt(1 + q**2)
    complement = q * (best - 1) - (best**2 - 1 - 2 * np.log(best)) / 4
    return mu / 2 * (jacobian ** (-2 / REAL(3)) * trace - 3) - p * (jacobian - 1) - (lam + 2 * mu / 3) * complement


_MIXED: dict[str, Density] = {
    "NeoHookean": _mixed_simo,
    "LogarithmicNeoHookean": _mixed_logarithmic,
    "IsochoricNeoHookean": _mixed_isochoric,
    "IsochoricSimoNeoHookean": _mixed_isochoric_simo,
}


def energy_density(
    F: np.ndarray, law: str, young: float, poisson: float, space: str, p: np.ndarray | None = None
) -> np.ndarray:
    """W at deformation gradients F (…, dim, dim), per volume at rest, shape (…); NaN where J ≤ 0.

    With a pressure p (…) the function Π(F, p) = W̃ − p θ − M U*(−p / M) instead, least in F and greatest in p; U* is
    the Legendre transform of the volumetric energy U(θ), M its modulus.

    In plane stress F₃₃ is where W is least, found by Newton's method: there ∂W/∂F₃₃ = 0, so that it need not follow
    an imaginary step of F.
    """
    young, poisson = REAL(young), REAL(poisson)
    mu, lam = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    trace, jacobian = np.sum(F * F, axis=(-2, -1)), determinant(F)
    if F.shape[-1] == 2:
        across = _free_stretch(jacobian.real, mu, lam) if space == "plane-stress" else 1.0
        trace, jacobian = trace + across**2, jacobian * across
    jacobian = np.where(jacobian.real > 0.0, jacobian, np.nan)
    if p is None:
        return _LAWS[law](trace, jacobian, mu, lam)
    p = p.astype(np.result_type(p.dtype, REAL))  # extended scalars do not promote arrays
    return _MIXED[law](trace, jacobian, p, mu, lam)


def determinant(F: np.ndarray) -> np.ndarray:
    """det F of matrices (…, dim, dim), real or complex, in extended precision."""
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
