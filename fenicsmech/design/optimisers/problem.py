"""The least-squares problem that optimisers solve, and the history of a run.

    O(p) = ½ |r(p)|² + R(p)

with the residuals r and the regularisation R.
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
    """The objective exceeds the optimiser's limit."""


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
    """O(p) and its derivatives at one point.

    Attributes:
        parameters: p, (n,).
        residuals: r, (m,).
        jacobian: ∂r/∂p, (m, n).
        regulariser: R near p, which costs little to evaluate.
        errors: estimates the errors |e| of the residuals, (m,); valid at the best point so far only.
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
        lengths: typical change ℓ of each parameter, (n,).
    """

    lengths: np.ndarray

    def evaluate(self, parameters: np.ndarray, below: float = np.inf) -> Evaluation:
        """O and its derivatives.

        Raises:
            Infeasible: O has no value there.
            TooHigh: it is larger than ``below``; its derivatives were not computed.
        """


class Reason(Enum):
    """Reasons for the end of a minimisation; the value is text."""

    CONVERGED = "the gradient vanishes or the objective no longer falls: a minimum was found"
    RESOLVED = "what is left to gain is small beside the error of the elements: refine them, or give a tolerance"
    ITERATIONS = "the number of iterations ran out: allow more to get closer to the minimum"
    NO_DESCENT = "no step lowers the objective although the gradient does not vanish: check bounds and mesh quality"

    @property
    def converged(self) -> bool:
        """Whether a minimum was found within the errors."""
        return self in (Reason.CONVERGED, Reason.RESOLVED)


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a minimisation, or of one resumed after an interruption.

    Attributes:
        parameters: p, (n,).
        number, evaluations: iterations and objective evaluations so far.
        memory: state of the optimiser, from ``Iterate.memory``; None at the very start.
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
        memory: state of the optimiser, for resuming.
        promise: the reduction that is still expected, over the objective; inf if that is not known.
        reason: None while it runs.
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
        least_promise: predicted reduction over the objective at which it ends at the latest.
    """

    iterations: int

    @property
    @abstractmethod
    def least_promise(self) -> float: ...

    @abstractmethod
    def minimise(self, problem: LeastSquaresProblem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        """The last iterate; ``watch`` is called with every one, the start included.

        Raises:
            Infeasible: at the start.
        """
