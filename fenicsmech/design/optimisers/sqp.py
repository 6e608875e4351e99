"""Sequential quadratic programming for objectives and inequalities that are expensive to evaluate.

    min O(p)   subject to   c(p) ≤ 0,     O = ½ |r|² + f + R

Each step s minimises a model under linearised inequalities (``step``),

    ½ |r + J s + ½ sᵀ H s|² + f + ∂f/∂p s + ½ sᵀ B s + R(p + s) + ½ μ |s / ℓ|² + Σ ν_k β(c_k + C_k s),

with the regulariser R by its own models (``regularisers``), in B the curvature of f + λᵀ c that its gradients show
(BFGS, damped as Powell proposes), and in H that of the residuals along the steps so far, refused ones included
(``step``). Where residuals are steep and R is flat, the minimum lies at the end of a curved valley, along which R
falls. Without H (Gauss–Newton) steps leave the valley and are refused until μ makes them short: the model takes R for
all the curvature along the valley, where in truth Σ r_k H_k outweighs R. Convergence is judged by the undamped step
without H, since H may be too large.

A step is accepted if it lowers the merit O + Σ ν_k β(c_k) by a part of the predicted reduction; μ falls after good
steps and grows after bad or infeasible ones. An end by short steps is a minimum only if no infeasible ones made them
short. O jumps where equilibria snap as the shape changes: where steps end short of what derivatives promise, descents
are tried from where the undamped step leads, and from half way. The penalties ν exceed the multipliers λ of that step,
follow them slowly where they fall, and grow where it leaves inequalities violated: the method is Fletcher's Sℓ₁QP
(Practical Methods of Optimization, doi:10.1002/9781118723203, section 14.4) with Levenberg's damping in place of a
trust region and Powell's rule for ν (Nocedal & Wright, Numerical Optimization, doi:10.1007/978-0-387-40065-5, chapter
18).

Libraries' methods (SLSQP, MMA, CCSA, trust-constr) see O as one function: they do not use residuals, take the barriers
of R for curvature, and end or diverge at infeasible points. ``python3 -m benchmarks.constrained`` compares them on
formulas and designs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.design.optimisers.problem import (
    Evaluation,
    Infeasible,
    Iterate,
    Optimiser,
    Problem,
    Reason,
    Start,
    TooHigh,
    merit,
)
from fenicsmech.design.optimisers.step import Step, bent, minimum, turned, updated
from fenicsmech.errors import DescriptionError, set_options


@dataclass(frozen=True, eq=False)
class Memory:
    """Memory between steps.

    Attributes:
        damping: μ.
        stalls: number of steps in a row that gained little.
        scale: typical change of O, the unit of μ.
        penalties: ν, (k,).
        curvature: B, (n, n).
        hessians: H, (m, n, n).
    """

    damping: float
    stalls: int
    scale: float
    penalties: np.ndarray
    curvature: np.ndarray
    hessians: np.ndarray

    @staticmethod
    def unpacked(numbers: np.ndarray, here: Evaluation) -> Memory:
        """The memory from the numbers of ``packed``."""
        k, (m, n) = len(here.inequalities.values), here.jacobian.shape
        rows, columns = np.tril_indices(n)
        penalties, halves, rest = np.split(numbers[3:], [k, k + m * len(rows)])
        curvature, hessians = rest.reshape(n, n) if len(rest) else np.zeros((n, n)), np.zeros((m, n, n))
        hessians[:, rows, columns] = hessians[:, columns, rows] = halves.reshape(m, len(rows))
        return Memory(numbers[0], int(numbers[1]), numbers[2], penalties, curvature, hessians)

    def packed(self) -> np.ndarray:
        """The memory as numbers; without B where it is zero."""
        curvature = self.curvature if self.curvature.any() else np.zeros(0)
        halves = self.hessians[:, *np.tril_indices(len(self.curvature))]
        return np.concatenate(
            [[self.damping, self.stalls, self.scale], self.penalties, halves.ravel(), curvature.ravel()]
        )


@dataclass(frozen=True)
class SQP(Optimiser):
    """Ends at a stationary point, or when three steps in a row gained less than ``tolerance`` times the merit.

    A point is stationary if the predicted reduction is below ``tolerance`` times the merit, and along the gradient of
    the Lagrangian O changes by less than √tolerance of its scale when parameters change by their lengths ℓ:

        |ℓ (∂O/∂p + Σ λ_k ∂c_k/∂p)| ≤ √tolerance max(|O|, |ℓ ∂O/∂p|) at the start.

    Attributes:
        iterations: largest number.
        tolerance: least reduction worth a step, over the merit.
        flat: change of the residuals by the lengths of all parameters, over the residuals, below which a stationary
            point may be a saddle, as a straight link's that may bend to either side.
        aside: largest change of a parameter, over its length, to a point beside such a saddle.
        tries: descents from points beside it, or beyond a jump of O, at most.
        violation: largest value of an inequality that counts as satisfied.
        damping: μ at the start, over the change of O when parameters change by their lengths.
        least_damping: least μ, which keeps parameters without influence in place.
        poor, good: actual over predicted reduction; below the first a step is refused, above the second damping falls.
        refusals: maximum number of steps refused in a row.
        stalls: steps in a row that gain less than ``tolerance``, after which it ends.

    Raises:
        DescriptionError: a number is out of its range.
    """

    iterations: int = 60
    tolerance: float = 5e-3
    flat: float = 0.1
    aside: float = 0.5
    tries: int = 2
    violation: float = 1e-3
    damping: float = 1e-2
    least_damping: float = 1e-9
    poor: float = 0.1
    good: float = 0.75
    refusals: int = 20
    stalls: int = 3

    def __post_init__(self) -> None:
        name = type(self).__name__
        set_options(self, name, free=("poor",), iterations=1, refusals=1, stalls=1, tries=0)
        if not self.poor < self.good:
            raise DescriptionError(
                f"reductions of {name}",
                f"poor={self.poor:g} is not below good={self.good:g}",
                "Give the ratio at which steps are refused below that at which damping falls",
            )

    @property
    def least_reduction(self) -> float:
        return self.tolerance

    def continued(self, memory: np.ndarray) -> np.ndarray | None:
        """H, B and ν as they are, since shifts keep derivatives; no stalls, and μ not above that of a start."""
        return np.concatenate([[min(memory[0], self.damping), 0.0], memory[2:]])

    def minimise(self, problem: Problem, start: Start, *, watch: Callable[[Iterate], None]) -> Iterate:
        last = self._descent(problem, start, watch)
        if self._may_be_saddle(last, problem.lengths):
            # the same directions every time
            ways = np.random.default_rng(0).uniform(-self.aside, self.aside, (self.tries, len(problem.lengths)))
            last = self._from_elsewhere(problem, last, ways * problem.lengths, watch)
        elif self._may_be_before_jump(last):
            memory = Memory.unpacked(last.memory, last.evaluation)
            step, _ = self._undamped(last.evaluation, memory, problem.lengths)
            away = step.parameters - last.evaluation.parameters
            last = self._from_elsewhere(problem, last, [away / 2**k for k in range(self.tries)], watch)
        watch(last)
        return last

    def _from_elsewhere(
        self, problem: Problem, end: Iterate, ways: Iterable[np.ndarray], watch: Callable[[Iterate], None]
    ) -> Iterate:
        """The first lower end of descents from points some ``ways``, (n,), from an ``end``; that itself if none is."""
        number, evaluations = end.number, end.evaluations
        for way in ways:
            try:
                found = self._descent(problem, Start(end.evaluation.parameters + way, number, evaluations), watch)
            except Infeasible:
                evaluations += 1
                continue
            violated = np.any(found.evaluation.inequalities.values > self.violation)
            if found.evaluation.value < end.evaluation.value and not violated:
                return found
            number, evaluations = found.number, found.evaluations
        problem.evaluate(end.evaluation.parameters)
        return replace(end, number=number, evaluations=evaluations + 1)

    def _descent(self, problem: Problem, start: Start, watch: Callable[[Iterate], None]) -> Iterate:
        """The end of a descent; ``watch`` is called with all iterates before."""
        here, lengths = problem.evaluate(start.parameters), problem.lengths
        memory = self._begin(here, lengths) if start.memory is None else Memory.unpacked(start.memory, here)
        last, ahead = self._iterate(start.number, start.evaluations + 1, here, memory, lengths)
        last = replace(last, refusal=start.refusal)
        watch(last)
        resolved = self._resolution(last, lengths, start.resumed)
        while last.reason is None:
            if resolved(last):
                last = replace(last, reason=Reason.RESOLVED)
            else:
                last, ahead = self._advance(problem, last, ahead, lengths)
            if last.reason is None:
                watch(last)
        return last

    def _may_be_saddle(self, last: Iterate, lengths: np.ndarray) -> bool:
        """Whether an end is one at which residuals hardly depend on the parameters, to first order."""
        here = last.evaluation
        r, most = float(np.linalg.norm(here.residuals)), float(np.linalg.norm(here.jacobian * lengths))
        return last.reason is Reason.CONVERGED and r**2 > here.value and most < self.flat * r

    def _may_be_before_jump(self, last: Iterate) -> bool:
        """Whether an end is one at which steps no longer gain what derivatives promise, as before a jump of O."""
        return last.reason in (Reason.CONVERGED, Reason.NO_DESCENT) and last.reduction > self.least_reduction

    def _begin(self, here: Evaluation, lengths: np.ndarray) -> Memory:
        """Memory at the start: O changes by the scale, and f's gradient by itself, when p changes by its lengths.

        Where nothing but limits is asked for, O vanishes with its gradient, and violations give the scale.
        """
        change = float(np.linalg.norm(lengths * here.gradient))
        scale = max(_magnitude(here, 0.0 if here.value or change else 1.0), change)
        bend = float(np.linalg.norm(lengths * here.plain.gradient))
        penalties, curvature = _sizes(here, lengths, scale), bend * np.diag(lengths**-2)
        return Memory(self.damping, 0, scale, penalties, curvature, np.zeros((*here.jacobian.shape, len(lengths))))

    def _resolution(self, first: Iterate, lengths: np.ndarray, resumed: bool) -> Callable[[Iterate], bool]:
        """A test of whether errors exceed the remaining reduction; here none, as errors of f and c are not known."""
        return lambda last: False

    def _advance(
        self, problem: Problem, last: Iterate, ahead: tuple[Step, Memory], lengths: np.ndarray
    ) -> tuple[Iterate, tuple[Step, Memory]]:
        """The next iterate from the last one, both with their undamped steps."""
        here, evaluations, (step, eased) = last.evaluation, last.evaluations, ahead
        memory = Memory.unpacked(last.memory, here)
        violated = np.any(here.inequalities.values > self.violation)
        little, stalled = last.reduction <= self.least_reduction, memory.stalls >= self.stalls
        if (little and (stalled or self._stationary(here, memory, step, lengths))) or (stalled and not violated):
            blocked = Reason.BLOCKED if last.refusal and not little else Reason.CONVERGED
            return replace(last, reason=Reason.VIOLATED if violated else blocked), ahead
        memory, refusal = eased, last.refusal
        merit_here, damping = here.merit(memory.penalties), memory.damping
        for _ in range(self.refusals):
            step = self._step(here, memory, damping, lengths)
            predicted = merit_here - _predicted(here, memory, step)
            if predicted <= 0.0:
                break  # damped to a standstill
            evaluations += 1
            try:
                new = problem.evaluate(step.parameters, merit_here - self.poor * predicted, memory.penalties)
            except TooHigh as failure:
                damping *= 4.0
                if failure.residuals is not None:
                    s = step.parameters - here.parameters
                    second = 2.0 * (failure.residuals - here.residuals - here.jacobian @ s)
                    memory = replace(memory, hessians=bent(memory.hessians, s, second, lengths))
                continue
            except Infeasible as failure:
                refusal = str(failure)
                damping *= 10.0
                continue
            gain, number = merit_here - new.merit(memory.penalties), last.number + 1
            if gain > self.good * predicted:
                damping = max(damping / 5.0, self.least_damping)
            stalls = memory.stalls + 1 if gain < self.least_reduction * _magnitude(here, memory.penalties) else 0
            tilted = new.inequalities.jacobian - here.inequalities.jacobian
            y = new.plain.gradient - here.plain.gradient + tilted.reshape(-1, len(lengths)).T @ step.multipliers
            s = new.parameters - here.parameters
            curvature = updated(memory.curvature, s, y, lengths, first=last.number == 0)
            hessians = turned(memory.hessians, s, new.jacobian - here.jacobian, lengths)
            memory = replace(memory, damping=damping, stalls=stalls, curvature=curvature, hessians=hessians)
            reason = Reason.ITERATIONS if number >= self.iterations else None
            found, ahead = self._iterate(number, evaluations, new, memory, lengths, reason)
            return replace(found, refusal=refusal if stalls else ""), ahead
        stuck = Reason.BLOCKED if refusal else Reason.NO_DESCENT
        reason = Reason.VIOLATED if violated else stuck
        return replace(last, evaluations=evaluations, reason=reason, refusal=refusal), ahead

    def _iterate(
        self,
        number: int,
        evaluations: int,
        here: Evaluation,
        memory: Memory,
        lengths: np.ndarray,
        reason: Reason | None = None,
    ) -> tuple[Iterate, tuple[Step, Memory]]:
        """The iterate with the reduction that the undamped step predicts, of the merit or of violations; that step."""
        step, eased = self._undamped(here, memory, lengths)
        straight = replace(eased, hessians=np.zeros_like(memory.hessians))
        reduction = here.merit(eased.penalties) - _predicted(here, straight, step)
        reduction /= _magnitude(here, eased.penalties)
        removed = np.maximum(here.inequalities.values, 0.0) - np.maximum(_ahead(here, step), 0.0)
        reduction = max(reduction, self.least_reduction * float(np.max(removed, initial=0.0)) / self.violation)
        return Iterate(number, evaluations, here, memory.packed(), reduction, reason), (step, eased)

    def _stationary(self, here: Evaluation, memory: Memory, step: Step, lengths: np.ndarray) -> bool:
        """Whether the Lagrangian's gradient is small. Where B is too stiff, the predicted reduction is small before."""
        if not memory.curvature.any():
            return True  # the curvature is that of the residuals and of R
        left = here.gradient + here.inequalities.jacobian.reshape(-1, len(lengths)).T @ step.multipliers
        return float(np.linalg.norm(lengths * left)) <= self.least_reduction**0.5 * memory.scale

    def _undamped(self, here: Evaluation, memory: Memory, lengths: np.ndarray) -> tuple[Step, Memory]:
        """The undamped step, and the memory with penalties for which it satisfies the inequalities if any step does."""
        violated, penalties = np.maximum(here.inequalities.values, 0.0), memory.penalties
        straight = replace(memory, hessians=np.zeros_like(memory.hessians))
        for _ in range(4):
            step = self._step(here, replace(straight, penalties=penalties), self.least_damping, lengths)
            missed = _ahead(here, step) > 1e-3 * violated + 1e-9
            if not missed.any():
                break
            penalties = np.where(missed, 10.0 * penalties, penalties)
        wanted, least = 1.5 * step.multipliers, 1e-3 * _sizes(here, lengths, memory.scale)
        eased = np.maximum.reduce([wanted, 0.5 * (memory.penalties + wanted), least])
        return step, replace(memory, penalties=np.where(missed, penalties, eased))

    def _step(self, here: Evaluation, memory: Memory, damping: float, lengths: np.ndarray) -> Step:
        curvature = memory.curvature + np.diag(damping * memory.scale / lengths**2)
        return minimum(
            lambda p: here.model(p, memory.hessians, curvature), here.parameters, here.inequalities, memory.penalties
        )


def _ahead(here: Evaluation, step: Step) -> np.ndarray:
    """Linearised inequalities after a step, (k,)."""
    away = step.parameters - here.parameters
    return here.inequalities.values + here.inequalities.jacobian.reshape(-1, len(away)) @ away


def _predicted(here: Evaluation, memory: Memory, step: Step) -> float:
    """The merit after a step, as predicted without damping."""
    model = here.model(step.parameters, memory.hessians, memory.curvature)
    return merit(model.value, _ahead(here, step), memory.penalties)


def _magnitude(here: Evaluation, penalties: np.ndarray | float) -> float:
    """The size of the merit, which is positive whatever the sign of f."""
    return max(here.merit(penalties) + abs(here.plain.value) - here.plain.value, 1e-30)


def _sizes(here: Evaluation, lengths: np.ndarray, scale: float) -> np.ndarray:
    """Penalties of the size ``scale`` of O over the change of each inequality when parameters change by lengths."""
    slopes = np.linalg.norm(here.inequalities.jacobian.reshape(-1, len(lengths)) * lengths, axis=1)
    return scale / np.where(slopes > 0.0, slopes, 1.0)
