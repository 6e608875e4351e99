"""Primal–dual Newton iteration with inertia control for min E(s) s.t. C(s) = 0.

Each iteration solves

    [[∇²L + δ I, −Aᵀ], [−A, −1/ρ]] (ds, dλ) = −(∇L, −C),

the Newton step of the augmented Lagrangian, which tends to the KKT step for large ρ and stays regular for
redundant constraints. If the matrix has more negative eigenvalues than there are multipliers, the step need not
descend, and δ grows until it does; close to an equilibrium δ stays zero, so that unstable equilibria on the path are
found and reported as such. Merit of a step: the augmented Lagrangian

    Φ(s) = E(s) − λᵀC + ½ ρ_m |C + cλ|²  at the new multipliers λ, with the compliance c of joints.

Slender links bend at far smaller forces than they stretch, so a good step may raise every merit for a few
iterations: steps are taken in full while a small allowance lasts, then the iteration returns to its best
state and searches the line. Sources: Nocedal & Wright, Numerical Optimization (doi:10.1007/978-0-387-40065-5),
chapters 17–19; Chamberlain et al. on the watchdog (Mathematical Programming Studies 16, 1982).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from petsc4py import PETSc

from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.linear import BySize, LinearMethod, LinearSolver
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import Balance, EquilibriumSystem
from fenicsmech.log import logger

_log = logger(__name__)
_STEP = 1e-6  # relative error of steps and tangents that iterative solvers may leave to the next iteration
_ROUGH = 1e-3  # far from the equilibrium
_EXACT = 1e-10  # the same of other solutions
_LEAST_SHIFT = 1e-9  # in units of the mean stiffness; slender links bend with 1e-6 of it and less


@dataclass(frozen=True)
class NewtonOptions:
    """Limits of the iteration.

    Attributes:
        tolerance: residual over the forces that balance in it, at convergence.
        roundoff: residual in units of mean stiffness times length below which digits are lost.
        near: residual over the forces below which any equilibrium, unstable ones too, is converged to; farther
            off, steps descend.
        iterations: most iterations.
        allowance: iterations in a row that may fail to improve on the best residual.
        largest_turn: largest rotation (rad), or displacement over the mechanism's length, of one step.
        linear: how the linear systems are solved; by their size unless said otherwise.
    """

    tolerance: float = 1e-10
    roundoff: float = 1e-14
    near: float = 1e-2
    iterations: int = 25
    allowance: int = 4
    largest_turn: float = 0.5
    linear: LinearMethod = field(default_factory=BySize)


@dataclass(frozen=True)
class Solution:
    """A converged equilibrium.

    Attributes:
        state: the equilibrium.
        residuals: relative residual before each iteration and at the end.
        iterations: KKT systems factored and solved on the way.
        unstable_modes: number of directions in which the energy has a maximum, under dead loads.
        unstable_under_control: the same with the control's constraint.
        tangent: rate of the state with the control's target.
    """

    state: State
    residuals: tuple[float, ...]
    iterations: int
    unstable_modes: int
    unstable_under_control: int
    tangent: Step


class NotConverged(Exception):
    """The iteration ended without an equilibrium; ``reason`` says why."""

    def __init__(self, reason: str, iterations: int) -> None:
        super().__init__(reason)
        self.reason, self.iterations = reason, iterations


@dataclass
class Newton:
    """The iteration, with the linear solver it keeps between solves."""

    system: EquilibriumSystem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    _solver: LinearSolver | None = None

    def solve(self, start: State, control: Control, *, floor: float = 0.0) -> Solution:
        """The equilibrium near ``start`` under ``control`` (collective).

        Args:
            start: first guess.
            control: what is asked for.
            floor: least shift δ, for mechanisms with idle freedoms.

        Raises:
            NotConverged: too many iterations, no descent, or elements inverted all along.
        """
        system, options = self.system, self.options
        start = control.prepare(start)
        system.load(start)
        if not math.isfinite(system.elastic_energy()):
            raise NotConverged("elements are inverted in the predicted state", 0)
        state, balance = start, system.balance(start, control)
        best, spent, careful = (state, balance.norm), 0, False
        residuals, shift, trusted = [], floor, True
        for iteration in range(options.iterations + 1):
            residuals.append(self._relative(balance))
            if self._converged(balance) and iteration > 0:
                return self._accept(state, control, balance, shift, floor, residuals, iteration)
            if iteration == options.iterations:
                break
            near = trusted and residuals[-1] < options.near
            step, shift = self._direction(state, control, balance, floor, last=shift, any_inertia=near)
            _log.debug("iteration %d: residual %.2e, shift %.1e", iteration, residuals[-1], shift)
            before, norm = state, balance.norm
            advance = self._search if careful else self._full_step
            state, balance = advance(state, control, step, balance, iteration)
            if near and balance.norm > norm and not self._converged(balance):
                # no contraction: near a limit or bifurcation point, where only descent leads on
                state, trusted, careful = before, False, True
                system.load(state)
                balance = system.balance(state, control)
            if balance.norm < best[1]:
                best, spent = (state, balance.norm), 0
            else:
                spent += 1
            if spent > options.allowance and not careful:
                state, careful = best[0], True
                system.load(state)
                balance = system.balance(state, control)
        raise NotConverged(
            f"the residual is {residuals[-1]:.1e} of the forces after {options.iterations} iterations",
            options.iterations,
        )

    def factor(self, state: State, control: Control, balance: Balance, floor: float) -> None:
        """Factors the KKT matrix of the loaded ``state``, for linear solves with it (collective).

        Raises:
            NotConverged: it cannot be factored.
        """
        if not self._refactor(self.system.kkt(state, control, balance), floor):
            raise NotConverged("the tangent at the equilibrium cannot be factored", 0)

    def solve_linear(self, right: PETSc.Vec, *, tolerance: float = _EXACT) -> PETSc.Vec:
        """The solution of KKT x = ``right`` with the matrix last factored (collective).

        Args:
            right: right-hand side.
            tolerance: relative error that iterative solvers may leave.

        Raises:
            NotConverged: an iterative solver stalled.
        """
        x = self._solution(right, tolerance)
        if x is None:
            raise NotConverged("the linear solver stalled", 0)
        return x

    def _relative(self, balance: Balance) -> float:
        return balance.norm / max(balance.forces, self.options.roundoff * self.system.unit)

    def _converged(self, balance: Balance) -> bool:
        return balance.norm <= max(self.options.tolerance * balance.forces, self.options.roundoff * self.system.unit)

    def _direction(
        self, state: State, control: Control, balance: Balance, floor: float, *, last: float, any_inertia: bool
    ) -> tuple[Step, float]:
        """The Newton step; unless ``any_inertia`` will do, raises δ until the inertia promises descent.

        δ = ``floor`` is tried first; then a third of the ``last`` one that served, and eight times that, …
        """
        system = self.system
        matrix = system.kkt(state, control, balance)
        shift, following = floor, max(_LEAST_SHIFT, last / 3.0)
        # a tenth of what the step leaves anyway
        tolerance = min(max(0.1 * self._relative(balance), _STEP), _ROUGH)
        for _ in range(20):
            x = self._solution(balance.vector, tolerance) if self._refactor(matrix, shift) else None
            if x is not None and (any_inertia or self._descends()):
                break
            shift, following = following, 8.0 * following
        else:
            raise NotConverged("no shift of the tangent gives a direction of descent", 0)
        x.scale(-1.0)
        return system.step(x), shift

    def _refactor(self, matrix: PETSc.Mat, shift: float) -> bool:
        with self.system.clock.phase("factor"):
            self.system.shift(shift)
            if self._solver is None:
                self._solver = self.options.linear.solver(self.system, matrix)
            return self._solver.refactor()

    def _solution(self, right: PETSc.Vec, tolerance: float) -> PETSc.Vec | None:
        """The solution with the matrix last factored, None if an iterative solver stalled."""
        with self.system.clock.phase("solve"):
            x = right.duplicate()
            return x if self._solver.solve(right, x, tolerance) else None

    def _descends(self) -> bool:
        """Whether what the solver saw of the matrix promises that its solution is a direction of descent."""
        inertia = self._solver.known_inertia()
        return inertia.negative <= self._expected and inertia.zero == 0

    @property
    def _expected(self) -> int:
        """Negative eigenvalues of a stable equilibrium: one per multiplier, one for the controlled force."""
        return self.system.joints.rows + 1

    def _full_step(
        self, state: State, control: Control, step: Step, balance: Balance, iteration: int
    ) -> tuple[State, Balance]:
        """The whole step, shortened only where it turns too far or inverts elements."""
        system = self.system
        length = min(1.0, self.options.largest_turn / max(system.size(step), 1e-300))
        for _ in range(12):
            trial = system.moved(state, step.scaled(length))
            if math.isfinite(system.elastic_energy()):
                return trial, system.balance(trial, control)
            length *= 0.5
        raise NotConverged("every step along the Newton direction inverts elements", iteration + 1)

    def _search(
        self, state: State, control: Control, step: Step, balance: Balance, iteration: int
    ) -> tuple[State, Balance]:
        """Armijo backtracking on the augmented Lagrangian; near convergence a smaller residual will do."""
        system = self.system
        system.load(state)
        towards = (state.multipliers + step.multipliers, state.force + step.force)
        before = self._merit(state, control, *towards)
        length = min(1.0, self.options.largest_turn / max(system.size(step), 1e-300))
        for _ in range(20):
            trial = system.moved(state, step.scaled(length))
            after = self._merit(trial, control, *towards)
            if math.isfinite(after):
                new = system.balance(trial, control)
                if after < before or new.norm < 0.9 * balance.norm:
                    return trial, new
            length *= 0.5
        raise NotConverged("the line search finds no descent", iteration + 1)

    def _merit(self, state: State, control: Control, multipliers: np.ndarray, force: float) -> float:
        """Φ of the loaded state, with the multipliers the step leads to."""
        system, stiffness = self.system, 10.0 * self.system.unit**2
        violation = system.joints.row_scale * system.constraints(state, multipliers)
        value = system.potential(state, force) - multipliers @ system.joints.value(state.poses, state.motors)
        value += 0.5 * stiffness * float(violation @ violation)
        if control.constrained:
            gap = (system.load_displacement(state) - control.target) / system.joints.length
            value += force * control.target + 0.5 * stiffness * gap**2
        return value

    def _accept(self, state, control, balance, shift, floor, residuals, iteration) -> Solution:
        """Stability and tangent at the equilibrium, from the last factor if it was of the true matrix."""
        system = self.system
        if shift > floor and not self._refactor(system.kkt(state, control, balance), floor):
            raise NotConverged("the tangent at the equilibrium cannot be factored", iteration)
        x = self.solve_linear(control.rate(system, state), tolerance=_STEP)
        with system.clock.phase("inertia"):
            under_control = self._solver.inertia().negative - self._expected
        unstable = under_control
        if control.constrained:
            row = system.control_row()
            # Schur complement of the control row: negative exactly if removing the row leaves stability as it is
            unstable += 1 - int(self.solve_linear(row, tolerance=_STEP).dot(row) < 0.0)
        return Solution(state, tuple(residuals), iteration, max(unstable, 0), max(under_control, 0), system.step(x))
