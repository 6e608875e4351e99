"""Rivlin's flexure: an incompressible neo-Hookean block in plane strain, bent to a piece of a ring by its ends alone.

Across it, Y ∈ [−t/2, t/2], lines X = const turn by ω X and stay straight, lines Y = const become circles of

    r² = 2 Y / ω + B,     B² = 1/ω⁴ + t²/ω²  (no traction on either face).

Stretches along the circles are λ = ω r, across them 1/λ; radial stress σ = μ/2 (λ² + λ⁻²) + K vanishes on the faces.
R. S. Rivlin, Large elastic deformations of isotropic materials VI, Phil. Trans. R. Soc. A 242, 1949,
doi:10.1098/rsta.1949.0009
"""

from __future__ import annotations

from math import hypot

import numpy as np


def _radii(turn: float, thickness: float, across: np.ndarray) -> np.ndarray:
    """r of the lines Y = ``across`` (n,), where X = const turn by ω = ``turn`` per length."""
    return np.sqrt(2.0 * across / turn + hypot(1.0 / turn**2, thickness / turn))


def pressure(turn: float, thickness: float, across: np.ndarray, *, shear_modulus: float) -> np.ndarray:
    """p of σ = μ (b − 1) − p 1 on the lines Y = ``across`` (n,), of which the outermost has the largest Y.

    p = μ λ⁻² − μ − σ
    """
    square = (turn * _radii(turn, thickness, across)) ** 2
    face = (turn * _radii(turn, thickness, np.array(0.5 * thickness))) ** 2
    radial = 0.5 * (square + 1.0 / square - face - 1.0 / face)
    return shear_modulus * (1.0 / square - 1.0 - radial)


def moment(turn: float, thickness: float, *, shear_modulus: float) -> float:
    """Moment per depth, ∫ (σ + μ λ² − μ λ⁻²) r dr over the thickness, where r dr = dY / ω."""
    points, weights = np.polynomial.legendre.leggauss(20)
    across = 0.5 * thickness * points
    square = (turn * _radii(turn, thickness, across)) ** 2
    face = (turn * _radii(turn, thickness, np.array(0.5 * thickness))) ** 2
    radial = 0.5 * (square + 1.0 / square - face - 1.0 / face)
    return float(np.sum(weights * shear_modulus * (radial + square - 1.0 / square)) * 0.5 * thickness / turn)
