"""Newton's method on the KKT equations as they stand: full steps, no inertia, no shift.

    [[∇²L, −Aᵀ], [−A, −ε]] (ds, dλ) = −(∇L, −C),     (s, λ) ← (s, λ) + α (ds, dλ)

with α = 1, or, on request, the largest of 1, ½, ¼, … that lowers the residual r by Armijo's rule
|r(α)| ≤ (1 − 10⁻⁴ α) |r(0)|. Any equilibrium will do, stable or not. Source: Nocedal & Wright, Numerical Optimization
(doi:10.1007/978-0-387-40065-5), section 18.1 and algorithm 11.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fenicsmech.equilibrium import (
    Control,
    EquilibriumMethod,
    EquilibriumPoint,
    EquilibriumSolver,
    EquilibriumSystem,
    NotConverged,
    Residual,
    State,
    Step,
)

_DECREASE = 1e-4
_HALVINGS = 20


@dataclass(frozen=True, kw_only=True)
class KKTNewton(EquilibriumMethod):
    """Newton's method on the KKT equations, nothing else.

    Attributes:
        iterations: maximum number of iterations.
        backtracking: whether steps are shortened until the residual falls.
    """

    iterations: int = 25
    backtracking: bool = False

    def solver(self, system: EquilibriumSystem) -> KKTNewtonSolver:
        return KKTNewtonSolver(system, self)


class KKTNewtonSolver(EquilibriumSolver):
    """The solver, with the linear solver it keeps between solves."""

    options: KKTNewton

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        system, options = self.system, self.options
        state = start
        residual, residuals, before = system.residual(state, control), [], math.inf
        best = state, residual
        for iteration in range(options.iterations + 1):
            residuals.append(self.relative(residual))
            if not math.isfinite(residuals[-1]):
                raise NotConverged("the residual overflows", iteration)
            if self.converged(residual, before) and iteration > 0:
                return self.accept(state, control, residual, residuals, iteration)
            if iteration == options.iterations:
                break
            self.linearise(state, control, residual, iterations=iteration)
            x = self.try_solve(residual.vector, self.step_accuracy(residual))
            if x is None:
                raise NotConverged("the linear solver stalled", iteration)
            step, before = self.newton_step(x, self.plane(state, control, residual)), residual.norm
            try:
                state, residual = self._advance(state, control, step, residual, iteration)
            except NotConverged as failure:
                return self.accept_best(*best, control, residuals, failure)
            if residual.norm < best[1].norm:
                best = state, residual
        return self.accept_best(*best, control, residuals, self.exhausted(residuals, options.iterations))

    def _advance(
        self, state: State, control: Control, step: Step, residual: Residual, iteration: int
    ) -> tuple[State, Residual]:
        """The state after the whole step, or after as much of it as lowers the residual."""
        system = self.system
        for halvings in range(_HALVINGS if self.options.backtracking else 1):
            length = 0.5**halvings
            trial = system.moved(state, step.scaled(length))
            if not math.isfinite(system.elastic_energy()):
                continue
            new = system.residual(trial, control)
            falls = new.norm <= (1.0 - _DECREASE * length) * residual.norm
            if falls or self.converged(new) or not self.options.backtracking:
                return trial, new
        reason = "no step lowers the residual" if self.options.backtracking else "the step inverts elements"
        raise NotConverged(reason, iteration + 1)
