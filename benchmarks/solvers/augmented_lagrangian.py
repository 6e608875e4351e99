"""The augmented Lagrangian method for min E(s) s.t. C(s) = 0.

Between updates of the multipliers λ and the penalty μ, Newton's method minimises over s

    L_A(s; λ, μ) = E(s) − λᵀ C(s) + ½ μ |C(s)|²,     ∇L_A = ∇E − Aᵀ λ⁺,     λ⁺ = λ − μ C(s),

to a tolerance ω. Its steps solve (∇²L(s, λ⁺) + δ I + μ AᵀA) ds = −∇L_A in the form that does not suffer from a large μ,

    [[∇²L + δ I, −Aᵀ], [−A, −1/μ]] (ds, dλ) = −(∇L_A, 0),

with δ grown until the matrix of ds is positive definite (by the inertia of the whole one), and lengths by
Armijo's rule on L_A. Then λ ← λ⁺ where |C| has fallen to η, and the penalty grows where it has not. A controlled
displacement is one more constraint, its force one more multiplier; where joints have a compliance c, the constraint is
C + c λ⁺ = 0 and λ⁺ = (λ − μ C) / (1 + μ c).

The method of *Optimal Design of Flexible-Link Mechanisms with Desired Load-Displacement Profiles*, equations (1) and
(2): the energy (3), (4) minimised under the joints' constraints by "a standard Augmented Lagrangian Method"; that is
Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5): algorithm 17.4 with their constants,
equation (17.21) for the steps, algorithms 3.2 and 3.3 for shift and length. μ is in units of mean stiffness, ω of
forces, η of the mechanism's length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.equilibrium import (
    Border,
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
from fenicsmech.errors import DescriptionError

_LEAST_SHIFT = 1e-9  # in units of the mean stiffness
_LARGEST_PENALTY = 1e8
_DECREASE = 1e-4
_HALVINGS = 30
_ROUNDING = 1e-10  # of L_A: a change below this is meaningless


@dataclass(frozen=True, kw_only=True)
class AugmentedLagrangian(EquilibriumMethod):
    """Minimisation of augmented Lagrangians by Newton's method, multipliers updated between.

    Attributes:
        iterations: maximum number of Newton iterations, over all updates.
        penalty: first penalty μ, in units of mean stiffness.
        growth: of the penalty where constraints are not met well enough.
    """

    iterations: int = 100
    penalty: float = 10.0
    growth: float = 100.0

    def solver(self, system: EquilibriumSystem) -> AugmentedLagrangianSolver:
        if system.blocks.pressures.size:
            raise DescriptionError(
                "solver",
                "the augmented Lagrangian method minimises, and links have pressures of their own, in which the energy "
                "has a maximum",
                "Give formulation=DisplacementFormulation(), or use PrimalDualNewton()",
            )
        return AugmentedLagrangianSolver(system, self)


class AugmentedLagrangianSolver(EquilibriumSolver):
    """The solver, with the linear solver it keeps between solves."""

    options: AugmentedLagrangian

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        system, options, minimum_shift = self.system, self.options, start.minimum_shift
        if control.along_path:
            problem = "the augmented Lagrangian method corrects no arc-length steps"
            raise DescriptionError("solver", problem, "Follow paths with PrimalDualNewton()")
        state = start
        penalty = options.penalty
        omega, eta = 1.0 / penalty, penalty**-0.1
        shift, residuals, before, best = minimum_shift, [], math.inf, None
        for iteration in range(options.iterations + 1):
            # multipliers of ``state`` are λ, those of ``current`` λ⁺
            current = self._updated(state, control, 1.0 / penalty)
            residual = system.residual(current, control)
            residuals.append(self.relative(residual))
            # λ⁺ = λ − μ C(s) holds the rounding of C, μ times
            noise = penalty * options.roundoff * system.unknowns.unit
            if self.converged(residual, before, noise=noise) and iteration > 0:
                self.linearise(current, control, residual, iterations=iteration)
                return self.accept(self._normalised(current), control, residual, residuals, iteration)
            if best is None or residual.norm < best[1].norm:
                best = current, residual
            if iteration == options.iterations:
                break
            before = residual.norm
            gradient, violation = self._parts(residual)
            if gradient <= max(omega, options.tolerance) * residual.forces:
                if violation <= eta:
                    state = current
                    omega, eta = omega / penalty, eta * penalty**-0.9
                else:
                    penalty = min(options.growth * penalty, _LARGEST_PENALTY)
                    omega, eta = 1.0 / penalty, penalty**-0.1
                current = self._updated(state, control, 1.0 / penalty)
                residual = system.residual(current, control)
                gradient, violation = self._parts(residual)
            step, descent, shift = self._direction(current, control, residual, 1.0 / penalty, minimum_shift, last=shift)
            try:
                state = self._search(state, control, step, descent, gradient, 1.0 / penalty, iteration)
            except NotConverged as failure:
                return self.accept_best(self._normalised(best[0]), best[1], control, residuals, failure)
        failure = self.exhausted(residuals, options.iterations)
        return self.accept_best(self._normalised(best[0]), best[1], control, residuals, failure)

    def _normalised(self, state: State) -> State:
        """``state`` with quaternions of unit length."""
        return self.system.moved(state, self.system.difference(state, state))

    def _updated(self, state: State, control: Control, softness: float) -> State:
        """``state``, whose multipliers are λ, with λ⁺ instead; softness is 1/μ."""
        system = self.system
        weight = self._weights(softness).multipliers
        violation = system.constraints(state, np.zeros(system.joints.rows))
        multipliers = (weight * state.multipliers - violation) / (weight + system.compliances)
        force = state.force
        if control.constrained:
            force -= (system.load_displacement(state) - control.prescribed) / self._weights(softness).load[0]
        return replace(state, multipliers=multipliers, force=force)

    def _value(self, state: State, control: Control, softness: float) -> float:
        """L_A at the loaded ``state``, whose multipliers are λ."""
        system = self.system
        new = self._updated(state, control, softness)
        multipliers, change = new.multipliers, new.multipliers - state.multipliers
        weight = self._weights(softness).multipliers
        value = system.potential(state, new.force) - multipliers @ system.constraints(state, 0.5 * multipliers)
        value -= 0.5 * change @ (weight * change)
        if control.constrained:
            value += (
                new.force * control.prescribed - 0.5 * self._weights(softness).load[0] * (new.force - state.force) ** 2
            )
        return value

    def _weights(self, softness: float) -> Border:
        """``softness`` in the units of the multipliers and the load."""
        return self.system.blocks.restrict_border(softness / self.system.unknowns.scale**2)

    def _parts(self, residual: Residual) -> tuple[float, float]:
        """|∇L_A|, and |C| over the mechanism's length, of a residual at λ⁺."""
        local, states = residual.vector.array_r, self.system.blocks.multipliers.local.start
        squares = [float(part @ part) for part in (local[:states], local[states:])]
        gradient, violation = (math.sqrt(self.system.comm.allreduce(square)) for square in squares)
        return gradient, violation / self.system.unknowns.unit

    def _direction(
        self,
        current: State,
        control: Control,
        residual: Residual,
        softness: float,
        minimum_shift: float,
        *,
        last: float,
    ) -> tuple[Step, float, float]:
        """The Newton step of s, with δ grown until it descends; the slope of L_A along it; δ."""
        system = self.system
        system.linearise(current, control, residual)
        system.kkt.soften(softness, control)
        right = residual.vector.copy()
        right.array_w[system.blocks.multipliers.local.start :] = 0.0
        shift, following = minimum_shift, max(_LEAST_SHIFT, last / 3.0)
        for _ in range(20):
            factored = self.factor(shift, least=shift == minimum_shift)
            x = self.try_solve(right, self.step_accuracy(residual)) if factored else None
            if x is not None and self.descends():
                break
            shift, following = following, 8.0 * following
        else:
            raise NotConverged("no shift of the KKT matrix gives a direction of descent", 0)
        x.scale(-1.0)
        return system.unknowns.step(x), x.dot(right), shift

    def _moved(self, state: State, step: Step, length: float) -> State:
        """``state`` after ``length`` of ``step`` in s; the unit length of quaternions is a constraint like others."""
        joints, poses = self.system.joints, state.poses.copy()
        poses[joints.free_bodies] = (joints.unknowns(poses) + length * step.z).reshape(-1, joints.space.pose_size)
        moved = replace(state, u=state.u + length * step.u, poses=poses)
        self.system.load(moved)
        return moved

    def _search(
        self, state: State, control: Control, step: Step, slope: float, gradient: float, softness: float, iteration: int
    ) -> State:
        """Armijo backtracking on L_A; where its digits are lost, a smaller gradient will do."""
        system, length = self.system, 1.0
        system.load(state)
        before = self._value(state, control, softness)
        for _ in range(_HALVINGS):
            trial = self._moved(state, step, length)
            after = self._value(trial, control, softness)
            if after <= before + _DECREASE * length * slope:
                return trial
            if math.isfinite(after) and after - before <= _ROUNDING * abs(before):
                residual = system.residual(self._updated(trial, control, softness), control)
                if self._parts(residual)[0] <= (1.0 - _DECREASE * length) * gradient:
                    return trial
            length *= 0.5
        raise NotConverged("the line search finds no descent", iteration + 1)
