"""Rivlin's flexure agrees with thin plates, with its own energy, and with its free faces."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from . import flexure

MU, THICKNESS = 0.7, 3.0


def energy(turn: float) -> float:
    """μ/2 ∫ (λ² + λ⁻² − 2) dY by the definition of r², per length and depth."""
    Y = np.linspace(-0.5, 0.5, 20001) * THICKNESS
    square = turn**2 * (2.0 * Y / turn + np.sqrt(1.0 / turn**4 + THICKNESS**2 / turn**2))
    return 0.5 * MU * float(trapezoid(square + 1.0 / square - 2.0, Y))


def test_moment_of_a_small_turn_is_that_of_a_plate():
    # E/(1 − ν²) = 4 μ
    assert flexure.moment(1e-4, THICKNESS, shear_modulus=MU) == pytest.approx(4e-4 * MU * THICKNESS**3 / 12.0, rel=1e-6)


@pytest.mark.parametrize("turn", [0.02, 0.2, 0.5])
def test_moment_is_the_derivative_of_the_energy(turn):
    slope = (energy(turn + 1e-4) - energy(turn - 1e-4)) / 2e-4
    assert flexure.moment(turn, THICKNESS, shear_modulus=MU) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("turn", [1e-4, 0.2])
def test_pressure_on_the_faces_is_that_without_traction(turn):
    faces = np.array([-0.5, 0.5]) * THICKNESS
    # there σ = 0 = μ (λ⁻² − 1) − p, and the stretches of both faces are reciprocal
    inner, outer = flexure.pressure(turn, THICKNESS, faces, shear_modulus=MU) / MU + 1.0
    assert inner * outer == pytest.approx(1.0, rel=1e-10)
    assert inner > 1.0
    middle = flexure.pressure(1e-4, THICKNESS, 0.5 * faces, shear_modulus=MU)
    assert middle == pytest.approx(-2.0 * MU * 1e-4 * 0.5 * faces, rel=1e-3)
