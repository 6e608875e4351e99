"""Strain energies as textbooks write them, in fifty digits: what cancels in them does not matter."""

from collections.abc import Sequence

import mpmath
from mpmath import mp, mpf

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticModel
from fenicsmech.mechanism import (
    EnergyLaw,
    IsochoricNeoHookean,
    IsochoricSimoNeoHookean,
    LogarithmicNeoHookean,
    NeoHookean,
)

mp.dps = 50


def _compressible(mu, trace, J):
    return mu / 2 * (trace - 3 - 2 * mpmath.log(J))


def _isochoric(mu, trace, J):
    return mu / 2 * (J ** (mpf(-2) / 3) * trace - 3)


def _simo(J):
    return (J**2 - 1 - 2 * mpmath.log(J)) / 4


# W(tr FᵀF, J) with μ, λ and κ
_ENERGIES = {
    NeoHookean(): lambda I1, J, mu, lam, kappa: _compressible(mu, I1, J) + lam * _simo(J),
    LogarithmicNeoHookean(): lambda I1, J, mu, lam, kappa: _compressible(mu, I1, J) + lam / 2 * mpmath.log(J) ** 2,
    IsochoricNeoHookean(): lambda I1, J, mu, lam, kappa: _isochoric(mu, I1, J) + kappa / 2 * (J - 1) ** 2,
    IsochoricSimoNeoHookean(): lambda I1, J, mu, lam, kappa: _isochoric(mu, I1, J) + kappa * _simo(J),
}


def energy(law: EnergyLaw, H: Sequence[Sequence[float]], young: float, poisson: float) -> mpf:
    """W of F = I + H, H (3, 3), exact in the given binary numbers."""
    F = mp.eye(3) + mp.matrix(H)
    mu = mpf(young) / (2 * (1 + mpf(poisson)))
    lam = mpf(young) * mpf(poisson) / ((1 + mpf(poisson)) * (1 - 2 * mpf(poisson)))
    trace = sum(entry**2 for entry in F)
    return _ENERGIES[law](trace, mpmath.det(F), mu, lam, lam + 2 * mu / 3)


def transverse_stretch(law: EnergyLaw, H: Sequence[Sequence[float]], young: float, poisson: float) -> mpf:
    """F₃₃ at which W of the in-plane H (2, 2) is stationary: no stress across the plane."""

    def slope(stretch):
        return mpmath.diff(lambda t: energy(law, _embed(H, t - 1), young, poisson), stretch)

    return mpmath.findroot(slope, mpf(1), tol=mpf("1e-40"))


def model_energy(model: ElasticModel, law: EnergyLaw, H, young: float, poisson: float) -> mpf:
    """W of H (dim, dim) under the model's assumption on the third dimension."""
    if model is SPATIAL:
        return energy(law, H, young, poisson)
    if model is PLANE_STRAIN:
        return energy(law, _embed(H, 0), young, poisson)
    assert model is PLANE_STRESS
    return energy(law, _embed(H, transverse_stretch(law, H, young, poisson) - 1), young, poisson)


def _embed(H, H33):
    return [[H[0][0], H[0][1], 0], [H[1][0], H[1][1], 0], [0, 0, H33]]
