"""BFGS with a line search for the strong Wolfe conditions, the quasi-Newton method of section V-B of the paper.

    B_{k+1} = B_k + y yᵀ / yᵀ s − B_k s sᵀ B_k / sᵀ B_k s,     y = change of ∂(½ |r|² + f)/∂p along the step s

from B_0 = diag(ℓ⁻²), scaled, with the lengths ℓ of the parameters. B approximates the expensive part alone: the
regulariser R, whose barriers are too steep to be learnt from gradients, enters directions by its own models,

    d = argmin ½ dᵀ B d + (Jᵀ r + ∂f/∂p)ᵀ d + R(p + d).

A BFGS that learns O as a whole advances slowly along the barriers of thickness and curvature. Line searches begin
within half a length of each parameter, since distant designs are often infeasible, and B is reset where the search
along its direction finds no descent. Steps p + α d meet the strong Wolfe conditions (Nocedal & Wright, Numerical
Optimization, doi:10.1007/978-0-387-40065-5, algorithms 3.5 and 3.6, as scipy has them); infeasible points count as
infinitely high.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import line_search

from fenicsmech.design.optimisers.problem import (
    Deferred,
    Evaluation,
    Inequalities,
    Infeasible,
    Iterate,
    Optimiser,
    Problem,
    Quadratic,
    Reason,
    Start,
    TooHigh,
    refuse_inequalities,
)
from fenicsmech.design.optimisers.step import minimum, updated
from fenicsmech.errors import DescriptionError, set_options


@dataclass(frozen=True)
class BFGS(Optimiser):
    """Stops when the expected reduction is below ``tolerance`` times the objective, or after ``iterations``.

    The expected reduction depends on an approximate Hessian: with a large tolerance it ends far from a minimum.

    Attributes:
        iterations: largest number.
        tolerance: least reduction worth a step, over O.
        armijo: fraction of the decrease predicted by the slope that a step must reach.
        wolfe: largest slope at the end of a step over that at its start.
        longest: largest change of a parameter, over its length, in the first step of a line search.

    Raises:
        DescriptionError: a number is out of its range; later: there are inequalities.
    """

    iterations: int = 300
    tolerance: float = 1e-6
    armijo: float = 1e-4
    wolfe: float = 0.9
    longest: float = 0.5

    def __post_init__(self) -> None:
        set_options(self, "BFGS", below_one=("armijo", "wolfe"), iterations=1)
        if not self.armijo < self.wolfe:
            raise DescriptionError(
                "line search of BFGS",
                f"armijo={self.armijo:g} is not below wolfe={self.wolfe:g}",
                "Give a smaller armijo, so that there are steps that satisfy both",
            )

    @property
    def least_reduction(self) -> float:
        return self.tolerance

    def minimise(self, problem: Problem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        here, size = problem.evaluate(start.parameters), len(start.parameters)
        refuse_inequalities(type(self).__name__, here)
        if start.memory is None:
            curvature = _fresh(here, problem.lengths)
        else:
            curvature = start.memory.reshape(size, size)
        last = _iterate(start.number, start.evaluations + 1, here, curvature)
        watch(last)
        while last.reason is None:
            last = self._advance(problem, last)
            watch(last)
        return last

    def _advance(self, problem: Problem, last: Iterate) -> Iterate:
        here, number, evaluations = last.evaluation, last.number, last.evaluations
        curvature = last.memory.reshape(len(here.parameters), -1)
        if last.reduction <= self.tolerance:
            return _iterate(number, evaluations, here, curvature, Reason.CONVERGED)
        there, tried, refusal = self._search(problem, here, _step(here, curvature))
        if there is None:  # B was learnt elsewhere and may not hold here
            curvature = _fresh(here, problem.lengths)
            there, more, refusal = self._search(problem, here, _step(here, curvature))
            tried += more
        if there is None:
            stuck = Reason.BLOCKED if refusal else Reason.NO_DESCENT
            return replace(_iterate(number, evaluations + tried, here, curvature, stuck), refusal=refusal)
        s, y = there.parameters - here.parameters, _gradient(there) - _gradient(here)
        curvature = updated(curvature, s, y, problem.lengths, first=number == 0)
        reason = Reason.ITERATIONS if number + 1 >= self.iterations else None
        return _iterate(number + 1, evaluations + tried, there, curvature, reason)

    def _search(self, problem: Problem, here: Evaluation, step: np.ndarray) -> tuple[Evaluation | None, int, str]:
        """The last point of the line search that was lower than those before, the number of evaluations, and the reason
        why a point has no value, empty if all have one."""
        step = step * min(1.0, self.longest / float(np.max(np.abs(step / problem.lengths))))
        found, tried, refusal, slope = here, 0, "", float(here.gradient @ step)

        def value(p: np.ndarray) -> float:
            nonlocal found, tried, refusal
            length = float((p - here.parameters) @ step) / float(step @ step)
            tried += 1
            try:
                found = problem.evaluate(p, min(here.value + self.armijo * length * slope, found.value))
            except TooHigh as high:
                return high.merit
            except Infeasible as failure:
                refusal = str(failure)
                return np.inf
            return found.value

        if slope < 0.0:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a search that ends early keeps its best point
                line_search(
                    value, lambda p: found.gradient, here.parameters, step, here.gradient, here.value,
                    c1=self.armijo, c2=self.wolfe, maxiter=20,
                )  # fmt: skip
        return None if found is here else found, tried, refusal


def _gradient(here: Evaluation) -> np.ndarray:
    """∂(½ |r|² + f)/∂p."""
    return here.gradient - here.penalty.gradient


def _fresh(here: Evaluation, lengths: np.ndarray) -> np.ndarray:
    """B at the start: the gradient changes by its own size when parameters change by their lengths."""
    return max(float(np.linalg.norm(lengths * _gradient(here))), 1e-30) * np.diag(lengths**-2)


def _model(here: Evaluation, curvature: np.ndarray, p: np.ndarray) -> Quadratic:
    """½ |r|² + f by its gradient and B, and R, at ``p``."""
    away, gradient, penalty = p - here.parameters, _gradient(here), here.regulariser(p)
    curved = curvature @ away
    value = here.value - here.penalty.value + float((gradient + 0.5 * curved) @ away) + penalty.value
    return Deferred(value, lambda: (gradient + curved + penalty.gradient, curvature + penalty.curvature))


def _step(here: Evaluation, curvature: np.ndarray) -> np.ndarray:
    """The quasi-Newton step d."""
    lowest = minimum(lambda p: _model(here, curvature, p), here.parameters, Inequalities(), np.zeros(0))
    return lowest.parameters - here.parameters


def _iterate(
    number: int, evaluations: int, here: Evaluation, curvature: np.ndarray, reason: Reason | None = None
) -> Iterate:
    """The iterate with the reduction predicted for the quasi-Newton step."""
    lowest = _model(here, curvature, here.parameters + _step(here, curvature)).value
    size = max(here.value + abs(here.plain.value) - here.plain.value, 1e-30)  # positive whatever the sign of f
    return Iterate(number, evaluations, here, curvature.ravel(), (here.value - lowest) / size, reason)
