"""The problem that optimisers solve, and the history of a run.

    min O(p)   subject to   c(p) ≤ 0,     O(p) = ½ |r(p)|² + f(p) + R(p)

with the residuals r, a plain objective f, the regularisation R and the inequalities c. A problem of least squares has
neither f nor c.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np

from fenicsmech.errors import DescriptionError


class Infeasible(Exception):
    """The objective has no value at these parameters; the step that led there is taken back."""


class TooHigh(Infeasible):
    """The merit exceeds the optimiser's limit.

    Attributes:
        merit: O + Σ ν_k (x_k + ½ x_k²), x = max(c, 0).
        residuals: r there, (m,), from which their curvature is estimated; None if they are not given.
    """

    def __init__(self, merit: float, residuals: np.ndarray | None = None) -> None:
        super().__init__(merit)
        self.merit, self.residuals = merit, residuals

    def __str__(self) -> str:
        return f"the merit is {self.merit:.3g}"


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


class Deferred(Quadratic):
    """One whose gradient and curvature are computed when they are asked for: line searches compare many values.

    Args:
        value: R.
        derivatives: computes its gradient and curvature.
    """

    def __init__(self, value: float, derivatives: Callable[[], tuple[np.ndarray, np.ndarray]]) -> None:
        vars(self).update(value=value, _derivatives=derivatives)

    @cached_property
    def _found(self) -> tuple[np.ndarray, np.ndarray]:
        return vars(self).pop("_derivatives")()

    @property
    def gradient(self) -> np.ndarray:  # type: ignore[override]
        return self._found[0]

    @property
    def curvature(self) -> np.ndarray:  # type: ignore[override]
        return self._found[1]


@dataclass(frozen=True, eq=False)
class Plain:
    """An objective f that is not a sum of squares.

    Attributes:
        value: f.
        gradient: ∂f/∂p, (n,).
    """

    value: float = 0.0
    gradient: np.ndarray = field(default_factory=lambda: np.zeros(()))


@dataclass(frozen=True, eq=False)
class Inequalities:
    """The inequalities c ≤ 0, best scaled so that 0.01 is small and 1 is large.

    Attributes:
        names: of each, for messages, (k,).
        values: c, (k,).
        jacobian: ∂c/∂p, (k, n).
    """

    names: tuple[str, ...] = ()
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))
    jacobian: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


def merit(value: float, inequalities: np.ndarray, penalties: np.ndarray | float) -> float:
    """O + Σ ν_k (x_k + ½ x_k²) of an objective O, inequalities c, x = max(c, 0), and penalties ν."""
    violated = np.maximum(inequalities, 0.0)
    return value + float(np.sum(penalties * violated * (1.0 + 0.5 * violated)))


def no_errors() -> np.ndarray:
    """The errors of residuals that have none."""
    return np.zeros(())


@dataclass(frozen=True, eq=False)
class Evaluation:
    """O(p), c(p) and their derivatives at one point.

    Attributes:
        parameters: p, (n,).
        residuals: r, (m,).
        jacobian: ∂r/∂p, (m, n).
        regulariser: R near p, which costs little to evaluate.
        errors: estimates the errors |e| of the residuals, (m,); valid at the best point so far only.
        plain: f, zero by default.
        inequalities: c, none by default.
    """

    parameters: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    regulariser: Callable[[np.ndarray], Quadratic]
    errors: Callable[[], np.ndarray] = no_errors
    plain: Plain = Plain()
    inequalities: Inequalities = Inequalities()

    @cached_property
    def penalty(self) -> Quadratic:
        """R at p."""
        return self.regulariser(self.parameters)

    @property
    def value(self) -> float:
        """O."""
        return 0.5 * float(self.residuals @ self.residuals) + self.plain.value + self.penalty.value

    def merit(self, penalties: np.ndarray | float) -> float:
        """O + Σ ν_k (x_k + ½ x_k²), x = max(c, 0), of penalties ν, (k,)."""
        return merit(self.value, self.inequalities.values, penalties)

    @property
    def gradient(self) -> np.ndarray:
        """∂O/∂p = Jᵀ r + ∂f/∂p + ∂R/∂p, (n,)."""
        return self.jacobian.T @ self.residuals + self.plain.gradient + self.penalty.gradient

    def model(self, parameters: np.ndarray, hessians: np.ndarray, bend: np.ndarray) -> Quadratic:
        """½ |r̃|² + f + ∂f/∂p s + ½ sᵀ B s + R(p + s), r̃ = r + J s + ½ sᵀ H s, at ``parameters`` p + s.

        Args:
            parameters: p + s, (n,).
            hessians: H, second derivatives of the residuals, (m, n, n).
            bend: B, positive semidefinite, (n, n).
        """
        step, penalty = parameters - self.parameters, self.regulariser(parameters)
        turned, bent = hessians @ step, bend @ step
        r = self.residuals + (self.jacobian + 0.5 * turned) @ step
        smooth = self.plain.value + float(np.sum(self.plain.gradient * step)) + 0.5 * float(bent @ step)

        def derivatives() -> tuple[np.ndarray, np.ndarray]:
            jacobian = self.jacobian + turned
            gradient = jacobian.T @ r + self.plain.gradient + bent + penalty.gradient
            curvature = jacobian.T @ jacobian + bend + penalty.curvature
            return gradient, _positive(curvature + np.tensordot(r, hessians, 1), curvature)

        return Deferred(0.5 * float(r @ r) + smooth + penalty.value, derivatives)


def _positive(matrix: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """The symmetric ``matrix`` if it is positive definite."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return otherwise
    return matrix


def refuse_inequalities(optimiser: str, here: Evaluation) -> None:
    """Raises DescriptionError if there are inequalities."""
    if here.inequalities.names:
        raise DescriptionError(
            optimiser,
            f"it does not take inequalities: {', '.join(here.inequalities.names)}",
            "Minimise under inequalities by optimiser=fm.SQP()",
        )


class Problem(Protocol):
    """A problem that can be evaluated with its derivatives.

    Attributes:
        lengths: typical change ℓ of each parameter, (n,).
    """

    lengths: np.ndarray

    def evaluate(
        self, parameters: np.ndarray, below: float = np.inf, penalties: np.ndarray | float = 0.0
    ) -> Evaluation:
        """O and c with their derivatives; the point becomes the best so far.

        Args:
            parameters: p, (n,).
            below: largest merit of use to the optimiser.
            penalties: ν of the merit, (k,).

        Raises:
            Infeasible: O has no value there.
            TooHigh: the merit is larger than ``below``; derivatives were not computed.
        """


class Reason(Enum):
    """Reasons for the end of a minimisation; the value is text."""

    CONVERGED = "the gradient vanishes or the objective no longer falls: a minimum was found"
    RESOLVED = "the remaining gain is small compared with the error of the elements: refine them, or give a tolerance"
    VIOLATED = "inequalities stay violated, and no small change of the design helps: relax one, or start elsewhere"
    ITERATIONS = "the number of iterations ran out: allow more to get closer to the minimum"
    BLOCKED = "designs ahead have no value, and short steps gain little"
    NO_DESCENT = "no step lowers the objective although the gradient does not vanish: check bounds and mesh quality"

    @property
    def converged(self) -> bool:
        """Whether a minimum was found within the errors."""
        return self in (Reason.CONVERGED, Reason.RESOLVED)

    def words(self, refusal: str) -> str:
        """The text, where designs have no value with the reason for that: ``refusal``, as in ``Iterate``."""
        return f"{self.value}: {refusal}" if self is Reason.BLOCKED else self.value


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a minimisation, or of one resumed after an interruption.

    Attributes:
        parameters: p, (n,).
        number, evaluations: iterations and objective evaluations so far.
        memory: state of the optimiser, from ``Iterate.memory``; None at the very start.
        resumed: whether a minimisation was interrupted here.
        refusal: as in ``Iterate``.
    """

    parameters: np.ndarray
    number: int = 0
    evaluations: int = 0
    memory: np.ndarray | None = None
    resumed: bool = False
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class Iterate:
    """State of a minimisation after an iteration.

    Attributes:
        number: iterations so far.
        evaluations: objective evaluations so far, infeasible ones included.
        evaluation: the best point.
        memory: state of the optimiser, for resuming.
        reduction: the predicted one, over the objective; inf if that is not known.
        reason: None while it runs.
        refusal: reason why designs ahead of the last steps that gained little have no value; empty if they have.
    """

    number: int
    evaluations: int
    evaluation: Evaluation
    memory: np.ndarray
    reduction: float
    reason: Reason | None
    refusal: str = ""


@dataclass(frozen=True)
class Optimiser(ABC):
    """A method that minimises from a start, a frozen dataclass.

    Attributes:
        iterations: maximum number of iterations.
        tolerance: least reduction worth a step, over the objective.
        least_reduction: predicted reduction over the objective below which it ends in any case.
    """

    iterations: int
    tolerance: float | None

    @property
    @abstractmethod
    def least_reduction(self) -> float: ...

    def continued(self, memory: np.ndarray) -> np.ndarray | None:
        """The memory to start with where values are shifted, from that at the end before; None to start without."""
        return None

    @abstractmethod
    def minimise(self, problem: Problem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        """The last iterate; ``watch`` is called with every one, the start included.

        Raises:
            Infeasible: at the start.
        """
