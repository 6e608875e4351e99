"""Remainders of logarithms and roots, which keep all digits at small strain.

φ(j) = j − ln(1 + j),     ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3,     χ(j) = (1 + j)^(4/3) − 1 − 4 j / 3.
"""

from __future__ import annotations

from ufl import conditional, ln, lt
from ufl.core.expr import Expr


def log_remainder(j: Expr) -> Expr:
    """φ(j) = j − ln(1 + j) ≥ 0 without cancellation.

    Energies at strain ε are of order ε²: as differences of terms of order one they would lose all digits below 1e-8.
    With y = j / (2 + j):  ln(1 + j) = 2 (y + y³/3 + y⁵/5 + …)  and  j − 2 y = j y,  so

        φ = j y − 2 y³ (1/3 + y²/5 + y⁴/7 + …)     for |j| < 0.1.

    Eight terms truncate at 0.05¹⁷ ≈ 1e-22 of the leading one.
    """
    y = j / (2 + j)
    square = y * y
    tail = 0.0
    for k in reversed(range(1, 9)):
        tail = 1.0 / (2 * k + 1) + square * tail
    return conditional(lt(abs(j), 0.1), j * y - 2 * y * square * tail, j - ln(1 + j))


def cube_root_remainder(j: Expr) -> Expr:
    """ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3 ≤ 0 without cancellation.

    With c = (1 + j)^(1/3):  c − 1 = j / (c² + c + 1)  and  ψ = −(2 c + 1) (c − 1)² / 3.
    """
    c = (1 + j) ** (1.0 / 3.0)
    k = j / (c * c + c + 1)
    return -(2 * c + 1) * k * k / 3


def four_thirds_remainder(j: Expr) -> Expr:
    """χ(j) = (1 + j)^(4/3) − 1 − 4 j / 3 ≥ 0 without cancellation.

    With k = (1 + j)^(1/3) − 1, as for ψ:  χ = k² (2 + 8 k / 3 + k²).
    """
    c = (1 + j) ** (1.0 / 3.0)
    k = j / (c * c + c + 1)
    return k * k * (2 + k * (8.0 / 3.0 + k))
