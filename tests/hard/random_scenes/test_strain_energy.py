"""Textbook strain energies of the residual check, at strains so small that double precision would lose their digits."""

import numpy as np
import pytest

from .strain_energy import REAL, energy_density

YOUNG, POISSON, STRAIN = 0.4, 0.497, 1e-6
MU = YOUNG / (2 * (1 + POISSON))
LAM = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize(
    "law, isochoric",
    [
        ("NeoHookean", False),
        ("LogarithmicNeoHookean", False),
        ("IsochoricNeoHookean", True),
        ("IsochoricSimoNeoHookean", True),
    ],
)
def test_the_energy_of_small_strain_is_that_of_linear_elasticity(law, isochoric, mixed):
    """W = μ ε : ε + λ/2 (tr ε)²;  Π = μ ε : ε − p tr ε − p² / 2λ, with dev ε and κ for ε and λ if isochoric."""
    rng = np.random.default_rng(0)
    H = STRAIN * rng.standard_normal((50, 3, 3))
    p = MU * STRAIN * rng.standard_normal(50) if mixed else None  # doubles, as pressures of a state are
    strain = 0.5 * (H + np.swapaxes(H, 1, 2))
    volume, modulus = np.trace(strain, axis1=1, axis2=2), LAM
    if isochoric:
        strain, modulus = strain - volume[:, None, None] * np.eye(3) / 3, LAM + 2 * MU / 3
    shear = MU * np.sum(strain**2, axis=(1, 2))
    expected = shear + (modulus / 2 * volume**2 if p is None else -p * volume - p**2 / (2 * modulus))
    found = energy_density(np.eye(3) + H.astype(REAL), law, YOUNG, POISSON, "3d", p)
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
