"""Reasons why an estimate of an error may be off by more than a factor of two.

Estimates η are of first order, sums over cells, and of quantities that converge. Each of these may fail:

- η is above a tenth of the largest value of its curve.
- The path turns back near, in the prescribed value v: a limit point of forces, or a turning point of displacements.
  Finer elements shift the path in the plane of v and the unknown Q. Measured in units in which the largest values of
  the curve are one, it crosses the given v elsewhere by η and, to second order, by half of η R more,

      R = |q′ / q| (1 + s²/q²)⁻² |η| > 0.4,      q = dQ/dv,     s = max |Q| / max |v|,

  with the derivative q′ of q by Q along the path. Where a limit point is at the distance d in u, q ~ 1/d, and the
  error is d − √(d² − 2 d η): twice η at η = d/2, and beyond it finer elements have no equilibrium near. q′ is a
  difference over a small part of η along the tangent.
- There is no such difference: the KKT matrix is singular that near, or an iterative solver stalls.
- Errors cancel: |η| < ½ Σ ‖e_u‖_K ‖e_z‖_K in the norm of ∂²W/∂F∂F of each cell K, which bounds its contribution; those
  of the unloaded configuration, from which displacements count, included. Contributions of cells cancel each other
  then, or within cells the error of the displacement is nearly orthogonal to that of the adjoint. Errors of a quarter
  in what adds and what takes away make one of a half in η.
- Elements are too large: ‖e_z‖² is above a tenth of ‖∇z‖², as where η is above a tenth of a displacement of the links
  alone. Springs and compliant interfaces move the quantity too, and hide how much of the links' part is missed. What
  they miss, as how contraction varies over the thickness, the estimate of plane stress misses as well.
- The force acts at a point of a flexible link, whose displacement has no limit (``point_forces``).
- The equilibrium itself is known to rounding only: its residual r changes Q by up to Σ |z_i r_i|, above half of |η|.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fenicsmech.equilibrium import EquilibriumSolver, State, Unknown
from fenicsmech.errors import EquilibriumError, set_options
from fenicsmech.estimates.estimates import Equilibrium, ErrorKind, Estimates, adjoint_at

TURNS = {Unknown.DISPLACEMENT: "limit point near", Unknown.FORCE: "turning point of the displacement near"}
_NO_TANGENT = "tangent not defined"
ROUNDED = "equilibrium known to rounding only"


@dataclass(frozen=True)
class DoubtOptions:
    """When estimates are in doubt.

    Attributes:
        turn: largest R, second-order part of an error over half of its first-order one.
        step: change of the unknown over the estimate for differences of its derivative, at most.
        cancelled: least estimate over the bound of the contributions of cells.
        unresolved: largest part of the adjoint's energy that the elements miss.
        growth: largest growth with each halving of the elements, by forces at points, over the estimate.
        left: largest estimate in finer elements over the error that they find, and growth there with another halving:
            where these are off by a factor of two, the error is off by no more. Of residuals over errors, too.
        miss: of a step back from finer elements, over the step: up to 2.2 on one branch, 30 and more across folds.
        rounding: misses up to this part of the mechanism's length, or rad, count as none.

    Raises:
        DescriptionError: a number is not positive.
    """

    turn: float = 0.4
    step: float = 0.05
    cancelled: float = 0.5
    unresolved: float = 0.1
    growth: float = 0.2
    left: float = 0.5
    miss: float = 8.0
    rounding: float = 1e-6

    def __post_init__(self) -> None:
        set_options(self, "doubts of estimates")


@dataclass(frozen=True)
class Origin:
    """The place of the unloaded configuration, from which displacements count.

    Attributes:
        error: the estimate of its error.
        bound: of the contributions of cells to it.
    """

    error: float = 0.0
    bound: float = 0.0

    @staticmethod
    def at(estimates: Estimates, solver: EquilibriumSolver, unloaded: Equilibrium, kind: ErrorKind) -> Origin:
        """Of the unloaded equilibrium, with its displacement as the unknown; raises as ``Estimates.at``."""
        with estimates.shaped(unloaded.design):
            own = estimates.bounded(adjoint_at(solver, unloaded), kind)
        return Origin(own.error, own.bound)


def examined(
    estimates: Estimates,
    solver: EquilibriumSolver,
    equilibrium: Equilibrium,
    kind: ErrorKind,
    origin: Origin,
    scale: float,
    options: DoubtOptions,
) -> tuple[float, tuple[str, ...]]:
    """The estimate at an equilibrium, and reasons against it that it has alone, from a factor there and one near.

    Args:
        estimates: of the model.
        solver: of the equilibrium.
        equilibrium: that is examined.
        kind: of the error.
        origin: from which displacements count.
        scale: s.
        options: when it is in doubt.

    Raises:
        DescriptionError: plane stress is the ``kind`` and the model is another one.
        EquilibriumError: the KKT matrix of the equilibrium is singular.
    """
    force = equilibrium.unknown is Unknown.FORCE
    with estimates.shaped(equilibrium.design):
        adjoint = adjoint_at(solver, equilibrium)
        own = estimates.bounded(adjoint, kind)
        slope = adjoint.by_control()
        error = own.error + slope * origin.error if force else own.error - origin.error
        imbalance = adjoint.imbalance
        bound = own.bound + (abs(slope) * origin.bound if force else origin.bound)
        # the adjoint of the conjugate of a control is the rate along the path, but for its sign
        at = adjoint.at
        tangent = at.control.tangent(at.step(adjoint.x).scaled(-1.0 if force else 1.0))
        # of v, along the path: bounded where q vanishes, or grows without limit
        size = slope**2 + scale**2
        step = options.step * error * slope / size if 0.0 < size < math.inf else 0.0
        reasons = []
        if step != 0.0:
            try:
                there = _slope_at(solver, equilibrium, solver.system.moved(equilibrium.state, tangent.scaled(step)))
            finally:
                solver.system.load(equilibrium.state)
            if not math.isfinite(there):
                reasons.append(_NO_TANGENT)
            elif abs((there - slope) * slope) > options.step * options.turn * size:
                reasons.append(TURNS[equilibrium.unknown])
    if kind is ErrorKind.ELEMENTS and abs(error) < options.cancelled * bound:
        reasons.append("contributions of elements cancel")
    if own.unresolved > options.unresolved:
        reasons.append("elements too large")
    if imbalance > options.left * abs(error):
        reasons.append(ROUNDED)
    return error, tuple(reasons)


def _slope_at(solver: EquilibriumSolver, equilibrium: Equilibrium, state: State) -> float:
    """q at a ``state`` near the equilibrium; NaN where it has none."""
    try:
        return adjoint_at(solver, Equilibrium(state, equilibrium.design, equilibrium.unknown)).by_control()
    except EquilibriumError:
        return math.nan
