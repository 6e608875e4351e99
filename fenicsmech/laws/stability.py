"""Drucker's stability of a law: whether every small further strain takes more stress.

With the Kirchhoff stress τ, its Zaremba–Jaumann rate τ° and the rate of deformation D,

    τ° : D = D : 𝕔 : D > 0     for all D,

the convexity of W in the logarithmic strain of isotropic laws (Hill's inequality). A path whose velocity gradient is D,
without spin, has dτ/dt = τ°, so

    D : 𝕔 : D = d²/dt² W(exp(t D) F)     at t = 0.

The stability is the least eigenvalue of 𝕔 over that of the undeformed material: 1 there, and positive where the
material is stable. Below zero equilibria are still found, but a real material would tear, neck or kink, and the law is
used beyond the tests that it was fitted to. Sources: Hill (doi:10.1098/rspa.1970.0018) for the inequality, Leblond for
its form with rates ("A constitutive inequality for hyperelastic materials in finite strain", European Journal of
Mechanics A/Solids 11, 1992).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from ufl import Identity, as_matrix, diff, dot

from fenicsmech.laws.evaluation import Formulas, LawForm, number
from fenicsmech.laws.law import Law
from fenicsmech.laws.strain import spatial_strain

_PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]


def drucker_stability(law: Law, F: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least eigenvalue of 𝕔 over that of the undeformed material, (n,), at gradients F (n, 3, 3).

    NaN where the law has no energy. *Local.*
    """
    at_rest = np.linalg.eigvalsh(_stiffness(law, np.eye(3)[None]))[0, 0]
    stiffness = _stiffness(law, F)
    known = np.all(np.isfinite(stiffness), axis=(1, 2))
    values = np.linalg.eigvalsh(np.where(known[:, None, None], stiffness, np.eye(6)))[:, 0]
    return np.where(known, values / at_rest, np.nan)


def _stiffness(law: Law, F: NDArray[np.float64]) -> NDArray[np.float64]:
    """𝕔 (n, 6, 6) in the basis of unit tensors eᵢ ⊗ eᵢ and (eᵢ ⊗ eⱼ + eⱼ ⊗ eᵢ) / √2, by polarisation."""
    H = (F - np.eye(3)).reshape(len(F), 9).T
    formulas, parameters = _formulas(LawForm(law)), tuple(law.parameters.values())

    def quadratic(D: NDArray) -> NDArray:
        return formulas(0.0, *D.ravel(), *H, *parameters)[0]

    basis = np.zeros((6, 3, 3))
    for k, (i, j) in enumerate(_PAIRS):
        basis[k, i, j] = basis[k, j, i] = 1.0 if i == j else 0.5**0.5
    own = [quadratic(D) for D in basis]
    found = np.empty((len(F), 6, 6))
    for a in range(6):
        found[:, a, a] = own[a]
        for b in range(a):
            found[:, a, b] = found[:, b, a] = (quadratic(basis[a] + basis[b]) - own[a] - own[b]) / 2.0
    return found


@lru_cache(maxsize=32)
def _formulas(form: LawForm) -> Formulas:
    """d²W/dt² of t, D, H and the law's parameters."""
    numbers, t = {name: number() for name in form.law.parameters}, number()
    D, H = ([number() for _ in range(9)] for _ in range(2))
    step, gradient = (as_matrix([own[3 * k : 3 * k + 3] for k in range(3)]) for own in (D, H))
    # exp(t D) − 1 up to second order
    moved = t * step + t**2 / 2 * dot(step, step)
    energy = form.law.with_parameters(numbers).energy(spatial_strain(gradient + dot(moved, Identity(3) + gradient)))
    return Formulas([diff(diff(energy, t), t)], [t, *D, *H, *numbers.values()])
