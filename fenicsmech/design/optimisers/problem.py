"""What optimisers minimise, what they return, and why they stop.

----
When to stop: what is left to gain cannot be told from the errors that the finite elements leave.

Residuals have errors e_k. With s the step to the minimum of the objective with its residuals made linear, it is enough
if s would change no residual by more than a tenth of its error, and O by no more than the errors do:

    |J s|_k ≤ φ e_k  for all k,     O(p) − min O ≤ Σ (|r_k| e_k + ½ e_k²),     φ = 0.1.

So results move by less than their errors when the minimisation goes on, regularisers included: they are part of O.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np


class Infeasible(Exception):
    """The objective has no value at these parameters; the step that led there is taken back."""


class TooHigh(Infeasible):
    """The objective has a value, but one that is of no use to the optimiser."""


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A function near one point.

    Attributes:
        value: R.
        gradient: ∂R/∂p, (n,).
        curvature: ∂²R/∂p², or a positive semidefinite approximation, (n, n).
    """

    value: float
    gradient: np.ndarray
    curvature: np.ndarray

    @staticmethod
    def zero(size: int) -> Quadratic:
        """R = 0 of ``size`` parameters."""
        return Quadratic(0.0, np.zeros(size), np.zeros((size, size)))


def exact() -> np.ndarray:
    """The errors of residuals that have none."""
    return np.zeros(())


@dataclass(frozen=True, eq=False)
class Evaluation:
    """O(p) = ½ |r|² + R and its derivatives at one point.

    Attributes:
        parameters: p, (n,).
        residuals: r, (m,).
        jacobian: ∂r/∂p, (m, n).
        regulariser: R near p, which costs little to evaluate.
        errors: estimates the errors |e| of the residuals, (m,); to be asked at the best point so far only.
    """

    parameters: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    regulariser: Callable[[np.ndarray], Quadratic]
    errors: Callable[[], np.ndarray] = exact

    @cached_property
    def penalty(self) -> Quadratic:
        """R at p."""
        return self.regulariser(self.parameters)

    @property
    def value(self) -> float:
        """O."""
        return 0.5 * float(self.residuals @ self.residuals) + self.penalty.value

    @property
    def gradient(self) -> np.ndarray:
        """∂O/∂p = Jᵀ r + ∂R/∂p, (n,)."""
        return self.jacobian.T @ self.residuals + self.penalty.gradient

    def model(self, parameters: np.ndarray) -> Quadratic:
        """½ |r + J s|² + R(p + s), the objective with displacements made linear, at ``parameters`` p + s."""
        r = self.residuals + self.jacobian @ (parameters - self.parameters)
        penalty = self.regulariser(parameters)
        return Quadratic(
            0.5 * float(r @ r) + penalty.value,
            self.jacobian.T @ r + penalty.gradient,
            self.jacobian.T @ self.jacobian + penalty.curvature,
        )


class LeastSquaresProblem(Protocol):
    """An objective that can be evaluated with its derivatives.

    Attributes:
        lengths: changes of the parameters that count alike, (n,).
    """

    lengths: np.ndarray

    def evaluate(self, parameters: np.ndarray, below: float = np.inf) -> Evaluation:
        """O and its derivatives.

        Raises:
            Infeasible: O has no value there.
            TooHigh: it is larger than ``below``; its derivatives were not computed.
        """


class Reason(Enum):
    """Why a minimisation ended; the value is what to tell the user."""

    CONVERGED = "the gradient vanishes or the objective no longer falls: a minimum was found"
    RESOLVED = "what is left to gain is small beside the error of the elements: refine them, or give a tolerance"
    ITERATIONS = "the number of iterations ran out: allow more to get closer to the minimum"
    NO_DESCENT = "no step lowers the objective although the gradient does not vanish: check bounds and mesh quality"

    @property
    def converged(self) -> bool:
        """Whether a minimum was found, as far as it can be told."""
        return self in (Reason.CONVERGED, Reason.RESOLVED)


@dataclass(frozen=True, eq=False)
class Start:
    """Where a minimisation starts, or goes on after it was interrupted.

    Attributes:
        parameters: p, (n,).
        number, evaluations: iterations and objective evaluations so far.
        memory: what the optimiser had learnt, from ``Iterate.memory``; None at the very start.
    """

    parameters: np.ndarray
    number: int = 0
    evaluations: int = 0
    memory: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Iterate:
    """State of a minimisation after an iteration.

    Attributes:
        number: iterations so far.
        evaluations: objective evaluations so far, infeasible ones included.
        evaluation: the best point.
        memory: what the optimiser has learnt, to go on with.
        promise: the reduction that is still expected, over the objective; inf if that is not known.
        reason: None while it goes on.
    """

    number: int
    evaluations: int
    evaluation: Evaluation
    memory: np.ndarray
    promise: float
    reason: Reason | None


class Optimiser(ABC):
    """A method that minimises a least-squares problem from a start.

    Attributes:
        iterations: most iterations.
        least_promise: promised reduction over the objective at which it ends at the latest.
    """

    iterations: int

    @property
    @abstractmethod
    def least_promise(self) -> float: ...

    @abstractmethod
    def minimise(self, problem: LeastSquaresProblem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        """The last iterate; ``watch`` sees every one, the start as well.

        Raises:
            Infeasible: at the start.
        """


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
