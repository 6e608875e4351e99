"""Strain energies as textbooks write them, in fifty digits: what cancels in them does not matter."""

from collections.abc import Sequence

import mpmath
from mpmath import mpf

from fenicsmech.elasticity import PLANE_STRAIN, PLANE_STRESS, SPATIAL, ElasticModel
from fenicsmech.laws import IsochoricNeoHookean, IsochoricSimoNeoHookean, Law, LogarithmicNeoHookean, NeoHookean

DIGITS = 50


def _compressible(mu, trace, J):
    return mu / 2 * (trace - 3 - 2 * mpmath.log(J))


def _isochoric(mu, trace, J):
    return mu / 2 * (J ** (mpf(-2) / 3) * trace - 3)


def _simo(J):
    return (J**2 - 1 - 2 * mpmath.log(J)) / 4


# W(tr FᵀF, J) with μ, λ and κ
_ENERGIES = {
    NeoHookean: lambda I1, J, mu, lam, kappa: _compressible(mu, I1, J) + lam * _simo(J),
    LogarithmicNeoHookean: lambda I1, J, mu, lam, kappa: _compressible(mu, I1, J) + lam / 2 * mpmath.log(J) ** 2,
    IsochoricNeoHookean: lambda I1, J, mu, lam, kappa: _isochoric(mu, I1, J) + kappa / 2 * (J - 1) ** 2,
    IsochoricSimoNeoHookean: lambda I1, J, mu, lam, kappa: _isochoric(mu, I1, J) + kappa * _simo(J),
}


@mpmath.workdps(DIGITS)
def energy(model: ElasticModel, law: type[Law], H: Sequence[Sequence[float]], young: float, poisson: float) -> mpf:
    """W of H (dim, dim) under the model's assumption on the third dimension, exact in the given binary numbers."""
    if model is SPATIAL:
        return _spatial_energy(law, H, young, poisson)
    if model is PLANE_STRAIN:
        return _spatial_energy(law, _embed(H, 0), young, poisson)
    assert model is PLANE_STRESS

    def stretched(H33):
        return _spatial_energy(law, _embed(H, H33), young, poisson)

    # no stress across the plane: W is stationary in H₃₃; the secant method starts from small strain
    strain = mpmath.det(mpmath.eye(2) + mpmath.matrix(H)) - 1
    start = (1 + strain) ** (-mpf(poisson) / (1 - mpf(poisson))) - 1
    return stretched(
        mpmath.findroot(lambda H33: mpmath.diff(stretched, H33), (start, start + abs(start) / 100), tol=1e-70)
    )


def _spatial_energy(law: type[Law], H, young: float, poisson: float) -> mpf:
    F = mpmath.eye(3) + mpmath.matrix(H)
    mu = mpf(young) / (2 * (1 + mpf(poisson)))
    lam = mpf(young) * mpf(poisson) / ((1 + mpf(poisson)) * (1 - 2 * mpf(poisson)))
    trace = sum(entry**2 for entry in F)
    return _ENERGIES[law](trace, mpmath.det(F), mu, lam, lam + 2 * mu / 3)


def _embed(H, H33):
    return [[H[0][0], H[0][1], 0], [H[1][0], H[1][1], 0], [0, 0, H33]]
