"""Primal–dual Newton iteration with inertia control for min E(s) s.t. C(s) = 0, E the total energy.

Each iteration solves

    [[∇²L + δ I, −Aᵀ], [−A, −1/ρ]] (ds, dλ) = −(∇L, −C),

the Newton step of the augmented Lagrangian, which tends to the KKT step for large ρ and stays regular for
redundant constraints. If the matrix has more negative eigenvalues than there are multipliers, the step need not
descend, and δ grows until it does (every pressure of near-incompressible links counts as a multiplier: E has a maximum
there); close to an equilibrium δ stays zero, so that unstable equilibria on the path are
found and reported as such. Merit of a step: the augmented Lagrangian

    Φ(s) = E(s) − λᵀC + ½ ρ_m |C + cλ|²  at the new multipliers λ, with the compliance c of joints,

and at the new pressures p, with ½ ρ_m |∂E/∂p|² beside it.

Slender links are far softer in bending than in tension, so a good step may raise every merit for a few iterations:
steps are taken in full as long as a watchdog allows, then the iteration returns to its best state and searches the
line. For the same reason ∇²L holds, far from equilibrium, the stress that the last step solved for
instead of the one its displacements led to (``elasticity.mixed_stress``): iterations halve, and steps ten times as
long converge.

Close to convergence the factor of the KKT matrix K is reused (simplified Newton method),

    y ← y − K(y₁)⁻¹ r(y),

as long as corrections contract by a factor of 1000 or more; otherwise, as next to a limit point, K is factored anew.

Sources: Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapters 17–19; Chamberlain et al. on
the watchdog (Mathematical Programming Studies 16, 1982); Deuflhard on the simplified Newton method
(doi:10.1007/978-3-642-23899-4, section 2.1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from fenicsmech.checks import positive
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.solver import EquilibriumPoint, EquilibriumSolver, Iteration, NotConverged
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.log import logger

_log = logger(__name__)
_LEAST_SHIFT = 1e-9  # in units of the mean stiffness; slender links bend with 1e-6 of it and less


@dataclass(frozen=True, kw_only=True)
class PrimalDualNewton(EquilibriumSolver):
    """Newton's method on the KKT system with inertia control, the default solver.

    Attributes:
        near: residual over the forces below which any equilibrium, unstable ones too, is converged to; farther
            off, steps descend.
        iterations: most iterations.
        watchdog: iterations in a row that may fail to improve on the best residual.
        mixed_stress: whether tangents, as long as the residual is large, hold the stress that the last step solved
            for instead of the one it led to.
        largest_turn: largest rotation (rad), or displacement over the mechanism's length, of one step.
        reuse_factor: largest contraction rate of corrections at which the last factor of K is reused, also for
            stability and the tangent of the path; 0: never.

    Raises:
        DescriptionError: a limit is not a positive number, or ``reuse_factor`` is negative.
    """

    near: float = 1e-2
    iterations: int = 25
    watchdog: int = 12
    mixed_stress: bool = True
    largest_turn: float = 0.5
    reuse_factor: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        for limit in ("near", "largest_turn"):
            positive(f"Newton's {limit}", getattr(self, limit))
        if self.reuse_factor != 0.0:
            positive("Newton's reuse_factor", self.reuse_factor)

    def on(self, system: EquilibriumSystem) -> Newton:
        return Newton(system, self)


class Newton(Iteration):
    """The iteration, with the linear solver it keeps between solves."""

    options: PrimalDualNewton

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        system, options, least = self.system, self.options, start.minimum_shift
        state, residual = start, system.residual(start, control)
        best, spent, careful, missed = (state, residual), 0, False, None
        passed: tuple[State, np.ndarray] | None = None
        residuals, shift, trusted, mixed, norm = [], least, True, False, math.inf
        for iteration in range(options.iterations + 1):
            residuals.append(self.relative(residual))
            if self.converged(residual, norm) and iteration > 0:
                if mixed or shift > least or options.reuse_factor == 0.0:  # stability is of the true matrix
                    self.linearise(state, control, residual, iterations=iteration)
                return self.accept(state, control, residual, residuals, iteration)
            if iteration == options.iterations:
                break
            near = trusted and residuals[-1] < options.near
            kept = None if near else passed
            mixed = kept is not None
            if kept is not None:
                system.linearise_mixed(state, control, residual, *kept)
            else:
                system.linearise(state, control, residual)
            x, shift = self._direction(residual, least, last=shift, any_inertia=near)
            step, motion = system.unknowns.step(x), system.unknowns.apply(x)
            _log.debug("iteration %d: residual %.2e, shift %.1e", iteration, residuals[-1], shift)
            before, norm = state, residual.norm
            advance = self._search if careful else self._full_step
            try:
                state, residual, length = advance(state, control, step, residual, iteration)
            except NotConverged as failure:
                return self.accept_best(*best, control, residuals, failure)
            # pressures of mixed elements are stresses that the step solves for already
            passed = (before, length * motion) if options.mixed_stress and not system.blocks.pressures.size else None
            if near and residual.norm > norm and not self.converged(residual, norm):
                if missed is None and self.relative(residual) < options.near:
                    missed = before  # once may happen: just beyond a bifurcation small residuals hide large motions
                else:
                    # no contraction: near a limit or bifurcation point, where only descent leads on
                    state, trusted, careful, passed = missed or before, False, True, None
                    system.load(state)
                    residual = system.residual(state, control)
            elif near and shift == least and length == 1.0:
                state, residual, norm = self._finish(state, control, residual, norm, step)
            if residual.norm < best[1].norm:
                best, spent = (state, residual), 0
            else:
                spent += 1
            if spent > options.watchdog and not careful:
                state, careful, passed = best[0], True, None
                system.load(state)
                residual = system.residual(state, control)
        return self.accept_best(*best, control, residuals, self.exhausted(residuals, options.iterations))

    def _direction(
        self, residual: Residual, least: float, *, last: float, any_inertia: bool
    ) -> tuple[PETSc.Vec, float]:
        """The Newton step; unless ``any_inertia`` will do, raises δ until the inertia guarantees descent.

        δ = ``least`` is tried first; then a third of the ``last`` successful one, and eight times that, …
        """
        shift, following = least, max(_LEAST_SHIFT, last / 3.0)
        for _ in range(20):
            x = self.try_solve(residual.vector, self.step_accuracy(residual)) if self.factor(shift) else None
            if x is not None and (any_inertia or self.descends()):
                break
            shift, following = following, 8.0 * following
        else:
            raise NotConverged("no shift of the tangent gives a direction of descent", 0)
        x.scale(-1.0)
        return x, shift

    def _finish(
        self, state: State, control: Control, residual: Residual, before: float, step: Step
    ) -> tuple[State, Residual, float]:
        """Corrections with the factor that ``step`` to ``state`` was solved with, as long as it is current.

        Their lengths fall by the factor's relative error: |K⁻¹ r(y₁)| / |K⁻¹ r(y₀)| ≈ |K⁻¹ (K(y) − K)| as y₁ → y.

        Args:
            state, residual: where the step led.
            control: the prescribed value.
            before: residual norm before the step.
            step: the step.

        Returns:
            State and residual after the corrections, and the residual norm before the last one.
        """
        system, size = self.system, self.system.size(step)
        while not self.converged(residual, before):
            x = self.try_solve(residual.vector, self.step_accuracy(residual))
            if x is None:
                break
            x.scale(-1.0)
            correction = system.unknowns.step(x)
            length = system.size(correction)
            if not length <= self.options.reuse_factor * size:
                break
            following = system.moved(state, correction)
            found = system.residual(following, control)
            if not (found.norm < residual.norm or self.converged(found, residual.norm)):
                system.load(state)
                return state, system.residual(state, control), before
            state, residual, before, size = following, found, residual.norm, length
        return state, residual, before

    def _full_step(
        self, state: State, control: Control, step: Step, residual: Residual, iteration: int
    ) -> tuple[State, Residual, float]:
        """The whole step, shortened only where it turns too far or inverts elements."""
        system = self.system
        length = min(1.0, self.options.largest_turn / max(system.size(step), 1e-300))
        for _ in range(12):
            trial = system.moved(state, step.scaled(length))
            if math.isfinite(system.elastic_energy()):
                return trial, system.residual(trial, control), length
            length *= 0.5
        raise NotConverged("every step along the Newton direction inverts elements", iteration + 1)

    def _search(
        self, state: State, control: Control, step: Step, residual: Residual, iteration: int
    ) -> tuple[State, Residual, float]:
        """Armijo backtracking on the augmented Lagrangian; near convergence a smaller residual suffices."""
        system = self.system
        state, step = system.pressed(state, step)
        system.load(state)
        towards = (state.multipliers + step.multipliers, state.force + step.force)
        before = self._merit(state, control, *towards)
        length = min(1.0, self.options.largest_turn / max(system.size(step), 1e-300))
        for _ in range(20):
            trial = system.moved(state, step.scaled(length))
            after = self._merit(trial, control, *towards)
            if math.isfinite(after):
                new = system.residual(trial, control)
                if after < before or new.norm < 0.9 * residual.norm:
                    return trial, new, length
            length *= 0.5
        raise NotConverged("the line search finds no descent", iteration + 1)

    def _merit(self, state: State, control: Control, multipliers: np.ndarray, force: float) -> float:
        """Φ of the loaded state, with the multipliers the step leads to."""
        system, stiffness = self.system, 10.0 * self.system.unknowns.unit**2
        violation = system.joints.row_scale * system.constraints(state, multipliers)
        value = system.potential(state, force) - multipliers @ system.joints.value(state.poses, state.motors)
        value += 0.5 * stiffness * float(violation @ violation) + 5.0 * system.volume_violation() ** 2
        if control.constrained:
            gap = (system.load_displacement(state) - control.target) / system.joints.length
            value += force * control.target + 0.5 * stiffness * gap**2
        return value
