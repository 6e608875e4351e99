"""Levenberg–Marquardt for least squares with a regulariser of negligible cost.

Residuals r enter each step by their Jacobian J and estimates of their Hessians H from the steps so far; the regulariser
R, barriers included, enters by its own models (``regularisers``), most of them exact:

    s = argmin ½ |r + J s + ½ sᵀ H s|² + R(p + s) + ½ μ |s / ℓ|²,     ℓ the lengths of the parameters.

A step is accepted if it lowers O by a part of the predicted reduction; μ falls after good steps and grows after bad or
infeasible ones. This is sequential quadratic programming (``sqp``) without inequalities. Sources: Nocedal & Wright,
Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapter 10; for the composite model: Fletcher, Practical Methods
of Optimization (doi:10.1002/9781118723203), chapter 14.

Residuals have errors e_k, those of the finite elements. Iteration ends early if the undamped step s would change no
residual by more than a tenth of its error, and O by no more than the errors do:

    |J s|_k ≤ φ e_k  for all k,     O(p) − min O ≤ Σ (|r_k| e_k + ½ e_k²),     φ = 0.1.

Further iterations would change results by less than their errors; regularisers count, as part of O.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.design.optimisers.problem import Evaluation, Iterate, no_errors, refuse_inequalities
from fenicsmech.design.optimisers.sqp import SQP, Memory
from fenicsmech.errors import DescriptionError, positive, set_fields


@dataclass(frozen=True)
class LevenbergMarquardt(SQP):
    """Ends when the predicted reduction is below ``tolerance`` times O, or three steps in a row gained less.

    Attributes:
        tolerance: least reduction worth a step, over O. By default 0.005, or earlier where the errors of the finite
            elements exceed the remaining reduction.
        damping: μ at the start.
        resolved: φ, the part of a residual's error that the step to the minimum may change it by.
        again: fraction of the remaining reduction at the last estimate of errors, at which they are estimated again.

    The others are those of ``SQP``.

    Raises:
        DescriptionError: a number is out of its range; later: the problem is not one of least squares.
    """

    tolerance: float | None = None  # type: ignore[assignment]
    resolved: float = 0.1
    again: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tolerance is not None:
            set_fields(self, tolerance=positive(f"tolerance of {type(self).__name__}", self.tolerance))

    @property
    def least_reduction(self) -> float:
        return 5e-3 if self.tolerance is None else self.tolerance

    def _minimum(self, here: Evaluation, lengths: np.ndarray) -> np.ndarray:
        """The minimum of the undamped model, (n,)."""
        return self._step(here, self._begin(here, lengths), self.least_damping, lengths).parameters

    def _begin(self, here: Evaluation, lengths: np.ndarray) -> Memory:
        refuse_inequalities(type(self).__name__, here)
        if here.plain.gradient.any():
            raise DescriptionError(
                type(self).__name__, "the objective is more than a sum of squares", "Minimise it by optimiser=fm.SQP()"
            )
        return replace(super()._begin(here, lengths), scale=1.0)

    def _resolution(self, first: Iterate, lengths: np.ndarray, resumed: bool) -> Callable[[Iterate], bool]:
        resolution = Resolution(self, first, resumed=resumed)

        def resolved(last: Iterate) -> bool:
            undecided = self.tolerance is None and last.reduction > self.least_reduction
            return undecided and resolution.reached(last, lengths)

        return resolved


class Resolution:
    """Test of the remaining reduction against the errors, which are estimated a few times from ``start`` on.

    A resumed run does not know how far the interrupted one has come from its start, and estimates errors immediately.
    """

    def __init__(self, options: LevenbergMarquardt, start: Iterate, *, resumed: bool = False) -> None:
        self._options, self._errors = options, no_errors()
        self._estimated: Evaluation | None = None
        self._below = np.inf if resumed else options.again * _gain(start)

    def reached(self, last: Iterate, lengths: np.ndarray) -> bool:
        """Whether the best point so far, ``last``, is as near to the minimum as the errors resolve."""
        if _gain(last) < self._below:
            self._estimate(last)
        if self._hidden(last, lengths) and self._estimated is not last.evaluation:
            self._estimate(last)
        return self._hidden(last, lengths)

    def _estimate(self, last: Iterate) -> None:
        self._errors, self._estimated = last.evaluation.errors(), last.evaluation
        self._below = self._options.again * _gain(last)

    def _hidden(self, last: Iterate, lengths: np.ndarray) -> bool:
        here = last.evaluation
        if _gain(last) > np.sum(np.abs(here.residuals) * self._errors + 0.5 * self._errors**2):
            return False
        s = self._options._minimum(here, lengths) - here.parameters
        return bool(np.all(np.abs(here.jacobian @ s) <= self._options.resolved * self._errors))


def _gain(last: Iterate) -> float:
    """O(p) − min O, as predicted."""
    return last.reduction * last.evaluation.value
