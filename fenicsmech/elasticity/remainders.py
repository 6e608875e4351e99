"""Nonlinear remainders of elementary functions near zero, without cancellation.

At strain ε a strain energy is of order ε², a difference of terms of order one would lose all its digits
below ε = 1e-8.
"""

from __future__ import annotations

import ufl

_TERMS = 9  # of the series below: truncation 0.05¹⁷ ≈ 1e-22 against the leading term
_SERIES = 0.1  # |j| below which the series is used


def log_remainder(j):
    """φ(j) = j − ln(1 + j) ≥ 0.

    With y = j / (2 + j):  ln(1 + j) = 2 (y + y³/3 + y⁵/5 + …)  and  j − 2 y = j y,  so

        φ = j y − 2 y³ (1/3 + y²/5 + y⁴/7 + …)     for small |j|.
    """
    y = j / (2 + j)
    square = y * y
    tail = 0.0
    for k in reversed(range(1, _TERMS)):
        tail = 1.0 / (2 * k + 1) + square * tail
    return ufl.conditional(ufl.lt(abs(j), _SERIES), j * y - 2 * y * square * tail, j - ufl.ln(1 + j))


def cube_root_remainder(j):
    """ψ(j) = (1 + j)^(2/3) − 1 − 2 j / 3 ≤ 0.

    With c = (1 + j)^(1/3):  c − 1 = j / (c² + c + 1)  and  ψ = −(2 c + 1) (c − 1)² / 3.
    """
    c = (1 + j) ** (1.0 / 3.0)
    k = j / (c * c + c + 1)
    return -(2 * c + 1) * k * k / 3
