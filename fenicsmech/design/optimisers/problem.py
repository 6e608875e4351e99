"""What minimisers minimise, what they return, and why they stop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np


class Infeasible(Exception):
    """The objective has no value at these parameters; the step that led there is taken back."""


@dataclass(frozen=True)
class Evaluation:
    """O(p) = ½ |r|² + R and its derivatives at one point.

    Attributes:
        parameters: p, (n,).
        residuals: r, (m,).
        jacobian: ∂r/∂p, (m, n).
        penalty: R.
        penalty_gradient: ∂R/∂p, (n,).
        penalty_curvature: ∂²R/∂p², or a positive semidefinite approximation, (n, n).
    """

    parameters: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    penalty: float
    penalty_gradient: np.ndarray
    penalty_curvature: np.ndarray

    @property
    def value(self) -> float:
        """O."""
        return 0.5 * float(self.residuals @ self.residuals) + self.penalty

    @property
    def gradient(self) -> np.ndarray:
        """∂O/∂p = Jᵀ r + ∂R/∂p, (n,)."""
        return self.jacobian.T @ self.residuals + self.penalty_gradient

    @property
    def curvature(self) -> np.ndarray:
        """Jᵀ J + ∂²R/∂p², (n, n)."""
        return self.jacobian.T @ self.jacobian + self.penalty_curvature


class LeastSquaresProblem(Protocol):
    """An objective that can be evaluated with its derivatives."""

    def evaluate(self, parameters: np.ndarray) -> Evaluation:
        """O and its derivatives.

        Raises:
            Infeasible: O has no value there.
        """


class Reason(Enum):
    """Why a minimisation ended; the value is what to tell the user."""

    CONVERGED = "the gradient vanishes or the objective no longer falls: a minimum was found"
    ITERATIONS = "the number of iterations ran out: allow more to get closer to the minimum"
    NO_DESCENT = "no step lowers the objective although the gradient does not vanish: check bounds and mesh quality"


@dataclass(frozen=True)
class Iterate:
    """State of a minimisation after an iteration.

    Attributes:
        number: iterations so far.
        evaluations: objective evaluations so far, infeasible ones included.
        evaluation: the best point.
        damping: the minimiser's step control, to resume with.
        reason: None while it goes on.
    """

    number: int
    evaluations: int
    evaluation: Evaluation
    damping: float
    reason: Reason | None


class Minimiser(ABC):
    """A method that minimises a least-squares problem from a start."""

    @abstractmethod
    def minimise(self, problem: LeastSquaresProblem, start: np.ndarray, *, watch: Callable[[Iterate], None]) -> Iterate:
        """The last iterate; ``watch`` sees every one, the start as number 0.

        Raises:
            Infeasible: at the start.
        """
