"""Steps of every optimiser here, to the minimum of a model of the objective under linearised inequalities.

    min over d   m(p + d) + Σ ν_k β(c_k + C_k d),     β(x) = x + ½ x² where x > 0, else 0

The model m holds the regulariser's own, barriers included (``regularisers``). Newton's method with a line search: with
m's gradient g and Hessian H = L Lᵀ, and slacks t ≥ 0 of the inequalities, each step solves the convex quadratic program

    min ½ dᵀ H d + gᵀ d + Σ ν_k (t_k + ½ t_k²)   subject to   c + C d ≤ t,  0 ≤ t,

which always has a solution. In x = (Lᵀ d + L⁻¹ g, √ν (t + 1)) this means finding the x of least length with G x ≥ h,
which scipy's non-negative least squares do (Lawson & Hanson, Solving Least Squares Problems,
doi:10.1137/1.9781611971217, section 23.4). Its multipliers are those of the inequalities.

Models estimate second derivatives from earlier steps: of a sum by BFGS, of each residual r_k by the update that
changes H_k least (Powell's symmetric Broyden update, in parameters over their lengths), with

    H s = J(p + s) − J(p)  after a step,     sᵀ H s = 2 (r(p + s) − r − J s)  where only values are known.

H estimated along earlier steps may be too large here; before the update it is scaled down to fit along s. Dennis, Gay &
Welsch found this sizing indispensable (An adaptive nonlinear least-squares algorithm, doi:10.1145/355958.355965).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from fenicsmech.design.optimisers.problem import Inequalities, Quadratic, merit


@dataclass(frozen=True, eq=False)
class Step:
    """The minimum of a model.

    Attributes:
        parameters: p + d, (n,).
        multipliers: λ, (k,).
    """

    parameters: np.ndarray
    multipliers: np.ndarray


def minimum(
    model: Callable[[np.ndarray], Quadratic], start: np.ndarray, inequalities: Inequalities, penalties: np.ndarray
) -> Step:
    """The minimum of ``model`` and of penalised inequalities, which are linear from ``start`` on."""
    p, c, multipliers = start, inequalities.values, np.zeros(len(penalties))
    rows, here = inequalities.jacobian.reshape(-1, len(start)), model(p)
    value = scale = merit(here.value, c, penalties)
    for _ in range(50):
        if len(rows):
            newton, multipliers = _program(here, c, rows, penalties)
        else:
            newton = np.linalg.solve(here.curvature, -here.gradient)
        change = merit(float(here.gradient @ newton), c + rows @ newton, penalties) - merit(0.0, c, penalties)
        if -change <= 1e-10 * abs(scale):
            break
        length = 1.0
        while length > 1e-8:
            trial, there = p + length * newton, c + length * (rows @ newton)
            ahead = model(trial)
            lower = merit(ahead.value, there, penalties)
            if lower <= value + 0.1 * length * change:
                p, c, here, value = trial, there, ahead, lower
                break
            length *= 0.5
        else:
            break
    return Step(p, multipliers)


def _program(here: Quadratic, c: np.ndarray, rows: np.ndarray, penalties: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d and λ of the quadratic program, whose objective is taken in units of the largest penalty."""
    unit, n, k = float(penalties.max()), len(here.gradient), len(c)
    lower = cholesky(here.curvature / unit, lower=True)
    across = solve_triangular(lower, np.column_stack([here.gradient / unit, rows.T]), lower=True)
    centre, across = across[:, 0], across[:, 1:].T
    slack = np.diag(np.sqrt(unit / penalties))
    g = np.block([[-across, slack], [np.zeros((k, n)), slack]])
    h = np.concatenate([c + 1.0 - across @ centre, np.ones(k)])
    # with the least-squares residual r of [Gᵀ; hᵀ] u = (0, …, 0, 1), u ≥ 0:  x = −r / r_last,  multipliers u / r_last
    matrix, right = np.vstack([g.T, h]), np.eye(1, n + k + 1, n + k)[0]
    u = nnls(matrix, right)[0]
    u /= 1.0 - h @ u
    return solve_triangular(lower, g[:, :n].T @ u - centre, lower=True, trans="T"), unit * u[:k]


def updated(
    curvature: np.ndarray, s: np.ndarray, y: np.ndarray, lengths: np.ndarray, *, first: bool = False
) -> np.ndarray:
    """The BFGS update of a Hessian for the change ``y`` of the gradient along the step ``s``.

    Damped as Powell proposes, so that the Hessian stays positive definite; at the ``first`` step it is reset, in
    units of ``lengths``.
    """
    if not y.any():
        return curvature
    if (first or not curvature.any()) and y @ s > 0.0:
        curvature = np.diag(float(y @ s) / float(np.sum((s / lengths) ** 2)) / lengths**2)
    bs = curvature @ s
    if (known := float(s @ bs)) <= 0.0:
        return curvature
    if y @ s < 0.2 * known:
        y = bs + 0.8 * known / (known - y @ s) * (y - bs)
    return curvature + np.outer(y, y) / float(y @ s) - np.outer(bs, bs) / known


def turned(hessians: np.ndarray, s: np.ndarray, change: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Hessians of residuals (m, n, n) after a step ``s`` (n,) that has changed their Jacobian by ``change`` (m, n)."""
    known, found = hessians @ s @ s, change @ s
    if known.any():
        hessians = min(max(float(known @ found) / float(known @ known), 0.0), 1.0) * hessians
    w, off = _dual(s, lengths), change - hessians @ s
    sides = off[:, :, None] * w
    return hessians + (sides + sides.transpose(0, 2, 1)) - (off @ s)[:, None, None] * np.outer(w, w)


def bent(hessians: np.ndarray, s: np.ndarray, second: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Hessians of residuals (m, n, n) with ``second`` derivatives sᵀ H s (m,) along a step ``s`` (n,)."""
    w = _dual(s, lengths)
    return hessians + (second - hessians @ s @ s)[:, None, None] * np.outer(w, w)


def _dual(s: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """w ∝ s / ℓ² with w · s = 1, (n,)."""
    w = s / lengths**2
    return w / float(w @ s)
