"""Primal–dual Newton iteration with inertia control for min E(s) s.t. C(s) = 0, E the total energy.

Each iteration solves

    [[∇²L + δ I, −Aᵀ], [−A, −1/ρ]] (ds, dλ) = −(∇L, −C),

the Newton step of the augmented Lagrangian, which tends to the KKT step for large ρ and stays regular for redundant
constraints. If the matrix has more negative eigenvalues than there are multipliers, the step need not descend, and δ
grows until it does (every pressure of near-incompressible links counts as a multiplier: E has a maximum there); close
to an equilibrium δ stays zero, so that unstable equilibria on the path are found and reported as such. There a step
that turns stiff links by an angle φ strains them by φ², which may raise the residual of soft motions by orders of
magnitude until the next step undoes it. From an unstable equilibrium, where descent would only lead away, these
iterations converge as long as steps that raise it become shorter; from a stable one they descend instead, unless the
residual stays small and rises but once. Merit of a step: the augmented Lagrangian

    Φ(s) = E(s) − λᵀC + ½ ρ_m |C + cλ|²  at the new multipliers λ, with the compliance c of joints,

and at the new pressures p, with the additional term ½ ρ_m |∂E/∂p|².

Slender links are far softer in bending than in tension, so a good step may raise every merit for a few iterations:
steps are taken in full as long as a watchdog allows, then the iteration returns to its best state and applies a line
search. For the same reason ∇²L holds, far from equilibrium, the stress that the last step solved for instead of the one
its displacements led to (``elasticity.PredictedStress``): fewer iterations, and longer steps converge.

Close to convergence the factor of the KKT matrix K is reused (simplified Newton method),

    y ← y − K(y₁)⁻¹ r(y),

as long as corrections contract by a factor of 1000 or more; otherwise, for example near a limit point, K is factored
again.

Where links may touch obstacles a step linearises the gaps and finds the points that touch (see ``active_set``). From
the equilibrium found last the first such step takes the factor that this left: it needs no iteration.

Links that spin between ball joints, where loads alone resist, are held and turned step by step (see ``spinning``).

Across a path (see ``control``) equilibria of any stability are wanted and a good guess is near: steps are taken in
full, moved into the plane by bordering; where they diverge, a shorter step along the path is tried instead of descent.

Sources: Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5), chapters 17–19; Chamberlain et al. on
the watchdog (Mathematical Programming Studies 16, 1982); Deuflhard on the simplified Newton method
(doi:10.1007/978-3-642-23899-4, section 2.1).
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np
from petsc4py import PETSc

from fenicsmech.collective import agreed, from_one
from fenicsmech.equilibrium.active_set import ActiveSet
from fenicsmech.equilibrium.control import ArcLengthControl, Control, PathPlane
from fenicsmech.equilibrium.linearisation import EquilibriumPoint, NotConverged
from fenicsmech.equilibrium.solver import STEP, EquilibriumMethod, EquilibriumSolver
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.errors import not_negative
from fenicsmech.log import logger

_log = logger(__name__)
_LEAST_SHIFT = 1e-9  # first, in units of the mean stiffness; slender links bend with 1e-6 of it and less
_FLOOR_OF_SHIFTS = 1e-13  # likewise, to which they fall from iteration to iteration

_Began = tuple[State, np.ndarray] | None
"""Where the last step began, and its motion of the nodes."""


@dataclass(frozen=True, kw_only=True)
class PrimalDualNewton(EquilibriumMethod):
    """Newton's method on the KKT system with inertia control, the default solver.

    Attributes:
        near: residual over the forces below which any equilibrium, unstable ones too, is converged to; farther
            off, steps descend.
        iterations: maximum number of iterations.
        factorisations: after as many no iteration begins: thirty times those of an ordinary solve, which has five.
        shifts: δ of one iteration that may be tried.
        halvings: of a step along which the line search looks for descent.
        halvings_inverted: of a whole step that inverts elements.
        watchdog: iterations in a row that may fail to improve on the best residual.
        creeping: iterations in a row that may raise δ where the residual is rounding: then the best state is the
            equilibrium, if nothing moves there.
        predicted_stress: whether K_uu, as long as the residual is large, holds the stress that the last step solved
            for instead of the one it led to.
        largest_turn: largest rotation (rad), or displacement over the mechanism's length, of one step.
        reuse_factor: largest contraction rate of corrections at which the last factor of K is reused, also for
            stability and the tangent of the path; 0: never.
        path_iterations: maximum number of iterations of an arc-length step, after which a shorter one is tried.
        divergence: growth of the residual, over its least value or ``near``, at which a shorter step is tried too.
        contraction: from an unstable equilibrium to one near, length of a step that raises the residual over that of
            the last one that did, above which steps descend.
        turns: of links whose spin loads or obstacles resist, from one equilibrium with held spins to the next.
        loose: stiffness left in a spin, over the mean one of the links, below which it is held and turned so.

    Raises:
        DescriptionError: a limit is not a positive number, a number of iterations not a whole one, or ``reuse_factor``
            is negative.
    """

    near: float = 1e-2
    iterations: int = 25
    factorisations: int = 150
    shifts: int = 20
    halvings: int = 20
    halvings_inverted: int = 12
    watchdog: int = 12
    creeping: int = 3
    predicted_stress: bool = True
    largest_turn: float = 0.5
    reuse_factor: float = 1e-3
    path_iterations: int = 10
    divergence: float = 1e3
    contraction: float = 0.5
    turns: int = 20
    loose: float = 1e-8

    def __post_init__(self) -> None:
        super().__post_init__(
            free=("reuse_factor",),
            iterations=1,
            factorisations=1,
            shifts=1,
            halvings=1,
            halvings_inverted=1,
            watchdog=0,
            creeping=1,
            path_iterations=1,
            turns=1,
        )
        not_negative("reuse_factor of Newton's method", self.reuse_factor)

    def solver(self, system: EquilibriumSystem) -> NewtonSolver:
        return SpinningSolver(system, self) if system.spinning.spins else NewtonSolver(system, self)


class NewtonSolver(EquilibriumSolver):
    """Newton's method for one system."""

    options: PrimalDualNewton
    _held = False  # whether spins that loads or obstacles may resist are
    _left: EquilibriumPoint | None = None  # found last

    def __init__(self, system: EquilibriumSystem, options: PrimalDualNewton) -> None:
        super().__init__(system, options)
        self._moved = system.moved

    @property
    def turning(self) -> NewtonSolver | None:
        """The same solver with steps that turn links as rotations (``turning``); None if this is that one."""
        if self._moved == self.system.turned:
            return None
        other = copy(self)
        other._moved = self.system.turned
        return other

    def patient(self, factor: int) -> NewtonSolver:
        other = copy(self)
        other.options = replace(self.options, iterations=factor * self.options.iterations)
        return other

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        system, options, path = self.system, self.options, control.along_path
        limit, least = options.path_iterations if path else options.iterations, start.minimum_shift
        state, residual = start, self.residual(start, control)
        best, not_better, creeping, line_search = (state, residual), 0, 0, False
        diverged, raising = None, math.inf  # before the first step of any stability that raised the residual; length of
        # the last such step
        last: _Began = None
        residuals, shift, any_stability, predicted, norm = [], least, True, False, math.inf
        most = self.factorisations + options.factorisations
        contact = system.contact
        if contact is not None:
            contact.start(start.load_factor)
            if (found := self._without_factor(start, control, residual)) is not None:
                state, residual, last = found
                best = min(best, (state, residual), key=lambda each: each[1].norm)
        for iteration in range(limit + 1):
            residuals.append(self.relative(residual))
            # steps with a shift creep along soft modes: that rounding no longer falls with them says nothing
            if iteration > 0 and self.converged(residual, norm if shift == least else math.inf):
                if path and not self._held:  # critical points are located by its tangent and inertia
                    return self.linearise(state, control, residual).point(residuals, iteration + 1)
                current = shift == least and not predicted and (contact is None or contact.current)
                current = current and options.reuse_factor > 0.0
                if not (current or self._held):  # stability is of the true matrix
                    self.linearise(state, control, residual, iterations=iteration)
                point = self.accept(state, control, residual, residuals, iteration)
                self._left = None if self._held else point
                return point
            if iteration == limit or self.factorisations >= most:
                break
            creeping = creeping + 1 if shift > least and residual.norm <= self.rounding(residual) else 0
            if creeping == options.creeping:  # along a mode whose stability rounding does not tell
                if (rounded := self._rounded(*best, control, residuals, iteration)) is not None:
                    return rounded
                residual = self._again(state, control)
            near = path or (any_stability and (diverged is not None or residuals[-1] < options.near))
            predicted = last is not None and not near
            self.assemble(state, control, residual, last if predicted else None, contact)
            x, shift = self._direction(residual, least, last=shift, any_stability=near)
            plane = self.plane(state, control, residual)
            if contact is not None:
                x = self._with_contact(contact, x, residual, plane)
            if x is None:
                raise NotConverged("the linear solver stalled", iteration + 1)
            step = self.newton_step(x, plane)
            _log.debug("iteration %d: residual %.2e, shift %.1e", iteration, residuals[-1], shift)
            if path:
                norm = residual.norm
                state, residual = self._path_step(state, control, step, residuals)
                continue
            before, norm, motion = state, residual.norm, system.unknowns.apply(x)
            advance = self._search if line_search else self._full_step
            try:
                state, residual, length = advance(state, control, step, residual, iteration)
            except NotConverged as failure:
                return self.accept_best(*best, control, residuals, failure)
            last = (before, -length * motion) if self.options.predicted_stress else None
            close = self.relative(residual) < options.near
            if near and not (close and residual.norm <= norm) and not self.converged(residual, norm):
                # once from a stable equilibrium too: just beyond a bifurcation small residuals hide large motions
                kept = length == 1.0 and (start.unstable or (close and diverged is None))
                if kept and (moved := system.size(step)) <= options.contraction * raising:
                    diverged, raising = diverged or before, moved
                else:
                    if best[1].norm <= self.rounding(best[1]):  # the step strained stiff links that it turned
                        if (rounded := self._rounded(*best, control, residuals, iteration + 1)) is not None:
                            return rounded
                    # no contraction: near a limit or bifurcation point, where only descent makes progress
                    state, any_stability, line_search, last = diverged or before, False, True, None
                    # no step led to this residual: as large as before does not mean that it no longer falls
                    residual, norm = self._again(state, control), math.inf
            elif near and shift == least and length == 1.0:
                state, residual, norm = self._finish(state, control, residual, norm, step)
            if residual.norm < best[1].norm:
                best, not_better = (state, residual), 0
            else:
                not_better += 1
            if not_better > options.watchdog and not line_search:
                state, line_search, last = best[0], True, None
                residual, norm = self._again(state, control), math.inf
        return self.accept_best(*best, control, residuals, self.exhausted(residuals, iteration))

    def _rounded(
        self, best: State, residual: Residual, control: Control, residuals: list[float], iterations: int
    ) -> EquilibriumPoint | None:
        """The ``best`` state before the iterations end, if its residual is rounding (``accept_best``); else None."""
        try:
            return self.accept_best(best, residual, control, residuals, NotConverged("", iterations))
        except NotConverged:
            return None

    def _without_factor(
        self, start: State, control: Control, residual: Residual
    ) -> tuple[State, Residual, _Began] | None:
        """The first step from the equilibrium found last, with the factor it left; None where that is another one's.

        With gaps linearised it is the prediction under contact.
        """
        left, contact = self._left, self.system.contact
        if self._held or left is None or contact is None or control.along_path:
            return None
        if not left.linearisation.left_by(start, control) or self.relative(residual) < self.options.near:
            return None
        contact.take_factor()
        x = self.try_solve(residual.vector, self.step_accuracy(residual))
        if x is not None and self.descends():
            x = self._with_contact(contact, x, residual)
            if x is not None:
                motion = self.system.unknowns.apply(x)
                try:
                    state, after, length = self._full_step(start, control, self.newton_step(x, None), residual, 0)
                except NotConverged:
                    pass
                else:
                    return state, after, (start, -length * motion) if self.options.predicted_stress else None
        self._again(start, control)
        return None

    def residual(self, state: State, control: Control) -> Residual:
        """The residual that steps bring to zero."""
        return self.system.residual(state, control)

    def assemble(self, state: State, control: Control, residual: Residual, last, contact) -> None:
        """The matrix of the next step."""
        self.system.linearise(state, control, residual, last, contact)

    def _with_contact(
        self, contact: ActiveSet, x: PETSc.Vec, residual: Residual, plane: PathPlane | None = None
    ) -> PETSc.Vec | None:
        """The solution ``x`` with gaps linearised in place of the points that touch; None if a solve fails."""
        accuracy = self.step_accuracy(residual)
        return contact.corrected(x, residual.vector, lambda right: self.try_solve(right, accuracy), plane)

    def _again(self, state: State, control: Control) -> Residual:
        """The residual at an earlier ``state``, from which iterations go on."""
        system = self.system
        system.load(state)
        if system.contact is not None:
            system.contact.start(state.load_factor)
        return self.residual(state, control)

    def _direction(
        self, residual: Residual, least: float, *, last: float, any_stability: bool
    ) -> tuple[PETSc.Vec, float]:
        """x with K x the residual, and δ, raised until the inertia guarantees descent unless ``any_stability`` will do.

        δ = ``least`` is tried first; then a third of the ``last`` successful one, and eight times that, …
        """
        shift, following = least, _LEAST_SHIFT
        if last > least:
            following = max(last / 3.0, 8.0 * least, _FLOOR_OF_SHIFTS)
        for _ in range(self.options.shifts):
            factored = self.factor(shift, least=shift == least)
            x = self.try_solve(residual.vector, self.step_accuracy(residual)) if factored else None
            if x is not None and (any_stability or self.descends()):
                break
            shift, following = following, 8.0 * following
        else:
            raise NotConverged("no shift of the KKT matrix gives a direction of descent", 0)
        return x, shift

    def _path_step(self, state: State, control: Control, step: Step, residuals: list[float]) -> tuple[State, Residual]:
        """The whole step across a path, unless it is too large or diverges: then a shorter one along it is due."""
        iteration, system, options = len(residuals), self.system, self.options
        if not system.size(step) <= options.largest_turn:
            raise self.exhausted(residuals, iteration)
        state = self._moved(state, step)
        residual = self.residual(state, control)
        if not math.isfinite(residual.norm):
            raise NotConverged("elements are inverted", iteration)
        if self.relative(residual) > options.divergence * max(min(residuals), options.near):
            raise self.exhausted(residuals, iteration)
        return state, residual

    def _finish(
        self, state: State, control: Control, residual: Residual, before: float, step: Step
    ) -> tuple[State, Residual, float]:
        """Corrections with the factor that ``step`` to ``state`` was solved with, as long as it is current.

        Their lengths fall by the factor's relative error: |K⁻¹ r(y₁)| / |K⁻¹ r(y₀)| ≈ |K⁻¹ (K(y) − K)| as y₁ → y.

        Returns state and residual after them, and the residual norm before the last one; ``before`` is that before the
        step.
        """
        system, size = self.system, self.system.size(step)
        while not self.converged(residual, before):
            x = self.try_solve(residual.vector, self.step_accuracy(residual))
            if x is not None and system.contact is not None:
                x = self._with_contact(system.contact, x, residual)
            if x is None:
                break
            correction = self.newton_step(x, None)
            length = system.size(correction)
            if not length <= self.options.reuse_factor * size:
                break
            following = self._moved(state, correction)
            found = self.residual(following, control)
            if not (found.norm < residual.norm or self.converged(found, residual.norm)):
                system.load(state)
                return state, self.residual(state, control), before
            state, residual, before, size = following, found, residual.norm, length
        return state, residual, before

    def _full_step(
        self, state: State, control: Control, step: Step, residual: Residual, iteration: int
    ) -> tuple[State, Residual, float]:
        """The whole step, shortened only where it turns too far or inverts elements."""
        system = self.system
        length = min(1.0, self.options.largest_turn / max(system.size(step), 1e-300))
        for _ in range(self.options.halvings_inverted):
            trial = self._moved(state, step.scaled(length))
            if math.isfinite(system.elastic_energy()):
                return trial, self.residual(trial, control), length
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
        for _ in range(self.options.halvings):
            trial = self._moved(state, step.scaled(length))
            after = self._merit(trial, control, *towards)
            if math.isfinite(after):
                new = self.residual(trial, control)
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
            gap = control.gap(system, state) / system.joints.length
            value += force * control.prescribed + 0.5 * stiffness * gap**2
        return agreed(system.comm, value)


class SpinningSolver(NewtonSolver):
    """Newton's method where loads or obstacles may resist spins.

    Loose spins, which hardly anything resists at the last equilibrium, are held while all else comes to equilibrium,
    and turned from one such equilibrium to the next; so are all where the plain iteration fails. The hold's moments μ
    fall by Newton's method in the few angles: downhill, and no farther than half of the last turn once μ has changed
    sign.
    """

    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        if control.along_path and not start.loose:  # the plane fixes the spin
            return super().iterate(start, control)
        used = 0
        if not start.loose:
            try:
                return self._spun(super().iterate(start, control))
            except NotConverged as failure:
                used = failure.iterations
                self._again(start, control)
        try:
            point = self._turned(start, control)
        except NotConverged as failure:
            raise NotConverged(failure.reason, used + failure.iterations) from failure
        point = self._spun(replace(point, iterations=used + point.iterations))
        if isinstance(control, ArcLengthControl) and point.state.loose:
            return point.scaled(1.0 / control.metric.norm(point.tangent))
        return point

    def _turned(self, state: State, control: Control) -> EquilibriumPoint:
        """The equilibrium found by turns between those with held spins."""
        system, options = self.system, self.options
        # along a path spins stay as they are while their moments may be rounding, as the next point is near
        residuals, iterations, before = list[float](), 0, 0.0 if control.along_path else math.inf
        largest, last = options.largest_turn, None  # moments and length of the last turn
        for _ in range(options.turns):
            self._held = True
            try:
                held = super().iterate(state, control)
            except NotConverged as failure:
                raise NotConverged(failure.reason, iterations + failure.iterations) from failure
            finally:
                self._held = False
            state, iterations, residuals = held.state, iterations + held.iterations, [*residuals, *held.residuals]
            residual = self._again(state, control)
            holds = system.holds(state)
            if self.converged(residual, before) or not holds:
                at = self.linearise(state, control, residual, iterations=iterations)
                return at.point(residuals, iterations, tolerance=STEP)
            before, iterations = residual.norm, iterations + 1
            moments = np.array([hold.dot(residual.vector) / hold.dot(hold) for hold in holds])
            if last is not None and len(moments) == len(last[0]) and moments @ last[0] < 0.0:
                largest = 0.5 * last[1]
            step = self._turn(state, control, residual, moments, largest)
            last = moments, min(system.size(step), largest)
            _log.debug("moments %s turn links by %.1e", moments, last[1])
            state, _, _ = self._full_step(state, control, step, residual, iterations)
        raise NotConverged(f"links between ball joints still turn after {options.turns} turns", iterations)

    def _turn(self, state: State, control: Control, residual: Residual, moments: np.ndarray, largest: float) -> Step:
        """The step x by which spins turn downhill under the ``moments`` μ of holds, each mode by ``largest`` at most.

            x = S M⁻¹ μ,     S = (K + H Hᵀ)⁻¹ H,     M = I − Hᵀ S

        Modes of negative eigenvalues of M turn by ``largest``.
        """
        system = self.system
        system.linearise(state, control, residual, None, system.contact, held=True)
        # zero-energy modes other than spins need the least shift
        if not (self.factor(0.0) and self.linear.inertia().zero == 0) and not self.factor(state.minimum_shift):
            raise NotConverged("the KKT matrix with held spins cannot be factored")
        holds = system.holds(state)
        responses = [x for hold in holds if (x := self.try_solve(hold, STEP)) is not None]
        if len(responses) < len(holds):
            raise NotConverged("the linear solver stalled")
        left = np.eye(len(holds)) - np.array([[hold.dot(x) for x in responses] for hold in holds])
        # of one process: decisions depend on their signs
        values, modes = from_one(system.comm, lambda: np.linalg.eigh(0.5 * (left + left.T)))
        steps = []
        for value, mode in zip(values, modes.T, strict=True):
            x = system.unknowns.zeros()
            for factor, response in zip(mode, responses, strict=True):
                x.axpy(float(factor), response)
            own, moment = self.newton_step(x, None), float(mode @ moments)
            farthest = largest / max(system.size(own), 1e-300)
            amplitude = farthest if value <= 0.0 else min(abs(moment) / value, farthest)
            steps.append(own.scaled(math.copysign(amplitude, moment)))
        return reduce(add, steps)

    def _spun(self, point: EquilibriumPoint) -> EquilibriumPoint:
        """``point``, whether its spins are loose, and if so its tangent without them.

        The stiffness left in a spin is 1 / hᵀ K⁻¹ h.
        """
        state, holds = point.state, self.system.holds(point.state)
        loose = len(holds) < len(self.system.spinning.spins)
        for hold in holds:
            x = self.try_solve(hold, STEP)
            loose = loose or x is None or not abs(hold.dot(x)) * self.options.loose < 1.0
        state = replace(state, loose=loose)
        return replace(point, state=state, tangent=self.system.settled(point.tangent, state))

    def residual(self, state: State, control: Control) -> Residual:
        residual = super().residual(state, control)
        if not self._held:
            return residual
        vector = residual.vector
        for hold in self.system.holds(state):
            vector.axpy(-hold.dot(vector) / hold.dot(hold), hold)
        return replace(residual, norm=vector.norm())

    def assemble(self, state, control, residual, last=None, contact=None) -> None:
        self.system.linearise(state, control, residual, last, contact, held=self._held)

    def accept(self, state, control, residual, residuals, iterations):
        """While spins are held, the state is all that is asked for."""
        if self._held:
            return _Held(state, tuple(residuals), iterations)
        return super().accept(state, control, residual, residuals, iterations)

    def accept_best(self, best, residual, control, residuals, failure):
        if not self._held:
            return super().accept_best(best, residual, control, residuals, failure)
        if not residual.norm <= self.roundoff(residual) < math.inf:
            raise failure
        return _Held(best, tuple(residuals[: failure.iterations + 1]), failure.iterations)


@dataclass(frozen=True)
class _Held:
    """An equilibrium with held spins."""

    state: State
    residuals: tuple[float, ...]
    iterations: int
