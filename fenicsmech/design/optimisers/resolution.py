"""When to stop: what is left to gain cannot be told from the errors that the finite elements leave.

Residuals have errors e_k. With s the step to the minimum of the objective with its residuals made linear, it is enough
if s would change no residual by more than a tenth of its error, and O by no more than the errors do:

    |J s|_k ≤ φ e_k  for all k,     O(p) − min O ≤ Σ (|r_k| e_k + ½ e_k²),     φ = 0.1.

So results move by less than their errors when the minimisation goes on, regularisers included: they are part of O.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenicsmech.design.optimisers.problem import Evaluation, Iterate, exact

_SHARE = 0.1  # φ
_AGAIN = 0.1  # of what was left to gain when errors were estimated last: the design has changed, and errors with it


class Resolution:
    """The errors of one minimisation, estimated a few times on its way from ``start``."""

    def __init__(self, start: Iterate) -> None:
        self._errors, self._estimated, self._below = exact(), None, _AGAIN * _gain(start)

    def reached(self, last: Iterate, ahead: Callable[[], np.ndarray]) -> bool:
        """Whether the minimum is as near as can be told.

        Args:
            last: the best point so far.
            ahead: finds s there, (n,).
        """
        here = last.evaluation
        if _gain(last) < self._below:
            self._estimate(last)
        if self._hidden(last, ahead) and self._estimated is not here:
            self._estimate(last)
        return self._hidden(last, ahead)

    def _estimate(self, last: Iterate) -> None:
        self._errors, self._estimated = last.evaluation.errors(), last.evaluation
        self._below = _AGAIN * _gain(last)

    def _hidden(self, last: Iterate, ahead: Callable[[], np.ndarray]) -> bool:
        return _gain(last) <= self._doubt(last.evaluation) and bool(
            np.all(np.abs(last.evaluation.jacobian @ ahead()) <= _SHARE * self._errors)
        )

    def _doubt(self, here: Evaluation) -> float:
        """What the errors do to O."""
        return float(np.sum(np.abs(here.residuals) * self._errors + 0.5 * self._errors**2))


def _gain(last: Iterate) -> float:
    """O(p) − min O, as promised."""
    return last.promise * last.evaluation.value
