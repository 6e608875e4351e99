"""The interface of equilibrium solvers: a description with its limits, and the iteration it makes for one system.

Iterations differ in how they reach an equilibrium. All factor the KKT matrix K there, whose ``Linearisation`` gives
rates along paths, stability and adjoints.

All prescribe the arc length of a path by bordering: Newton's method with the equation of a plane normal to the path in
place of that of the followed value, without a row in K,

    R(y) = 0,    ⟨n, y − y₀⟩ = s,        K x₀ = −R,    K x₁ = r,    x = x₀ + τ x₁,

r the rate of the control that is held for the solves, τ such that y + x lies in the plane.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from fenicsmech.checks import positive
from fenicsmech.compat import destroy_garbage
from fenicsmech.equilibrium.border import PointLoad
from fenicsmech.equilibrium.control import ArcLengthControl, Control, Stability
from fenicsmech.equilibrium.linear import BySize, Inertia, LinearMethod, LinearSolver
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual

_STEP = 1e-6  # relative error that iterative solvers may leave in steps and tangents, as the next iteration mends it
_EXACT = 1e-10  # the same in other solutions


class NotConverged(Exception):
    """The iteration ended without an equilibrium; ``reason`` says why."""

    def __init__(self, reason: str, iterations: int = 0) -> None:
        super().__init__(reason)
        self.reason, self.iterations = reason, iterations


@dataclass(frozen=True, eq=False)
class EquilibriumPoint:
    """A converged equilibrium.

    Attributes:
        state: the equilibrium.
        control: under which it was found.
        tangent: rate of the state with the control's target; with an arc length, the path's direction of norm one.
        conjugate_rate: that of the control's conjugate along it, or of the conjugate of the value that is followed.
        stability: from the inertia of K.
        iterations: KKT systems factored and solved on the way.
        residuals: relative residual before each iteration and at the end.
        linearisation: K, last factored on the way, of which stability and tangent are.
    """

    state: State
    control: Control
    tangent: Step
    conjugate_rate: float
    stability: Stability
    iterations: int
    residuals: tuple[float, ...]
    linearisation: Linearisation

    @property
    def unstable_modes(self) -> int:
        """Number of directions in which the energy has a maximum, under dead loads."""
        return self.stability.under_load

    @property
    def unstable_under_control(self) -> int:
        """The same number with the controlled quantity held; along a path, the displacement of the force's point."""
        return self.stability.under_displacement if self.control.constrained else self.stability.under_load

    def scaled(self, factor: float) -> EquilibriumPoint:
        """The same equilibrium with ``factor`` times its tangent."""
        return replace(self, tangent=self.tangent.scaled(factor), conjugate_rate=factor * self.conjugate_rate)


@dataclass(frozen=True, kw_only=True)
class EquilibriumSolver(ABC):
    """Options of equilibrium solvers.

    Attributes:
        tolerance: residual over the forces that balance in it, at convergence.
        roundoff: residual in units of mean stiffness times the largest displacement (rotations: times length) below
            which digits are lost; of mean stiffness times length where the tangent is nearly singular.
        linear: method for the linear systems; by default chosen by their size.

    Raises:
        DescriptionError: a limit is not a positive number.
    """

    tolerance: float = 1e-9
    roundoff: float = 1e-14
    linear: LinearMethod = field(default_factory=BySize)

    def __post_init__(self) -> None:
        for limit in ("tolerance", "roundoff"):
            positive(f"Newton's {limit}", getattr(self, limit))

    @abstractmethod
    def on(self, system: EquilibriumSystem) -> Iteration:
        """The iteration for one system."""


class Linearisation:
    """The KKT matrix K at one state under one control, factored.

    Valid until its solver assembles or factors another matrix; methods raise RuntimeError afterwards.

    Args:
        solver: which has just factored K.
        state, control, residual: where K was taken.

    Attributes:
        state, control, residual: likewise.
    """

    def __init__(self, solver: Iteration, state: State, control: Control, residual: Residual) -> None:
        self.state, self.control, self.residual = state, control, residual
        self._solver, self._system = solver, solver.system
        self._made = self._present()

    def solve(self, right: PETSc.Vec, *, tolerance: float = _EXACT) -> PETSc.Vec:
        """x with K x = ``right``.

        Args:
            right: right-hand side.
            tolerance: relative error that iterative solvers may leave.

        Raises:
            NotConverged: an iterative solver stalled.
        """
        self._check()
        x = self._solver.try_solve(right, tolerance)
        if x is None:
            raise NotConverged("the linear solver stalled")
        return x

    def rate(self) -> PETSc.Vec:
        """x′ of the scaled unknowns x with the control's target."""
        self._turn()
        return self.solve(self.control.rate(self._system, self.state))

    def tangent(self) -> Step:
        """The rate of the state with the control's target."""
        return self.control.tangent(self.step(self.rate()))

    def correction(self) -> Step:
        """The Newton step −K⁻¹ R."""
        x = self.solve(self.residual.vector)
        x.scale(-1.0)
        return self.step(x)

    def point(self, residuals: Sequence[float], iterations: int, *, tolerance: float = _EXACT) -> EquilibriumPoint:
        """The equilibrium at this state, with its tangent and stability, from one solve.

        Raises:
            NotConverged: an iterative solver stalled.
        """
        self._check()
        self._turn()
        system, control = self._system, self.control
        destroy_garbage(system.comm)
        right = control.rate(system, self.state)
        x = right.duplicate()
        with system.clock.phase("solve"):
            inertia = self._solver.linear.solve_and_count(right, x, tolerance)
        if inertia is None:
            raise NotConverged("the linear solver stalled", iterations)
        tangent = control.tangent(self.step(x))
        rate = control.conjugate_rate(system, right, x, tangent)
        stability = control.stability(inertia.negative - self._solver.expected, rate)
        return EquilibriumPoint(self.state, control, tangent, rate, stability, iterations, tuple(residuals), self)

    def inertia(self) -> Inertia:
        """Numbers of K's negative and zero eigenvalues."""
        self._check()
        with self._system.clock.phase("inertia"):
            return self._solver.linear.inertia()

    def travel_gradient(self, load: PointLoad) -> PETSc.Vec:
        """∂(a · u_P)/∂x of a load's travel."""
        self._turn()
        return self._system.travel_gradient(load, self.state)

    def displacements(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x of all nodes, as in ``State.u``, (owned dofs,)."""
        self._turn()
        return self._system.unknowns.apply(x)

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state that x stands for."""
        return self._system.unknowns.step(x)

    def _check(self) -> None:
        if self._made != self._present():
            raise RuntimeError("this linearisation is out of date: another matrix was made or factored since")

    def _present(self) -> tuple[int, int]:
        """Numbers of the matrix and of the factor that the solver holds."""
        return self._system.kkt.linearised, self._solver.factored

    def _turn(self) -> None:
        """Brings the map from x to displacements back to this state."""
        if self._system.unknowns.poses is not self.state.poses:
            self._system.unknowns.turn(self.state.poses)


class Iteration(ABC):
    """One system's solver, with the linear solver it keeps between solves.

    Subclasses implement ``iterate``.

    Attributes:
        system: the equations.
        options: of the solver.
        factored: number of matrices factored so far.
    """

    def __init__(self, system: EquilibriumSystem, options: EquilibriumSolver) -> None:
        self.system, self.options = system, options
        self.factored = 0

    @cached_property
    def linear(self) -> LinearSolver:
        """The linear solver, made for the first matrix and kept."""
        return self.options.linear.solver(self.system)

    def solve(self, start: State, control: Control) -> EquilibriumPoint:
        """The equilibrium near ``start`` under ``control``.

        Args:
            start: first guess; its least shift is that of all tangents.
            control: what is prescribed.

        Raises:
            NotConverged: too many iterations, no descent, or elements inverted all along.
        """
        start = control.prepare(start)
        self.system.load(start)
        if not math.isfinite(self.system.elastic_energy()):
            raise NotConverged("elements are inverted in the predicted state")
        if isinstance(control, ArcLengthControl):
            return self._iterate_bordered(start, control)
        return self.iterate(start, control)

    @abstractmethod
    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        """``solve`` from a ``start`` that is loaded and has what ``control`` prescribes directly."""

    def linearise(
        self, state: State, control: Control, residual: Residual | None = None, *, iterations: int = 0
    ) -> Linearisation:
        """The KKT matrix at an equilibrium, factored with the least shift of the state.

        Args:
            state: the equilibrium.
            control: what is prescribed.
            residual: at the state, if that is loaded.
            iterations: so far.

        Raises:
            NotConverged: it cannot be factored.
        """
        if residual is None:
            self.system.load(state)
            residual = self.system.residual(state, control)
        self.system.linearise(state, control, residual)
        if not self.factor(state.minimum_shift):
            raise NotConverged("the tangent at the equilibrium cannot be factored", iterations)
        return Linearisation(self, state, control, residual)

    def factor(self, shift: float) -> bool:
        """Factors the KKT matrix last linearised with a ``shift``; whether that could be done."""
        with self.system.clock.phase("factor"):
            self.factored += 1
            self.system.kkt.shift(shift)
            return self.linear.refactor()

    def try_solve(self, right: PETSc.Vec, tolerance: float) -> PETSc.Vec | None:
        """The solution with the matrix last factored, None if an iterative solver stalled."""
        with self.system.clock.phase("solve"):
            x = right.duplicate()
            return x if self.linear.solve(right, x, tolerance) else None

    def descends(self) -> bool:
        """Whether the inertia known from the last solve guarantees that its solution is a descent direction."""
        inertia = self.linear.known_inertia()
        return inertia.negative <= self.expected and inertia.zero == 0

    @property
    def expected(self) -> int:
        """Negative eigenvalues where stable: one per multiplier and pressure, one for the controlled force."""
        return self.system.joints.rows + 1 + self.system.blocks.pressures.size

    def relative(self, residual: Residual) -> float:
        """The residual over the forces that balance in it."""
        return residual.norm / max(residual.forces, self._rounding(residual))

    def step_accuracy(self, residual: Residual) -> float:
        """Admissible relative error of a Newton step, 1e-3 far from the equilibrium.

        A tenth of the residual that the step leaves anyway, or enough to take it well below the tolerance: errors of
        stiff modes weigh hundreds of times more in the residual than in the energy.
        """
        relative = self.relative(residual)
        enough = 1e-3 * self.options.tolerance / max(relative, self.options.tolerance)
        return min(max(0.1 * relative, enough, _STEP), 1e-3)

    def converged(self, residual: Residual, before: float = 0.0, *, noise: float = 0.0) -> bool:
        """Whether the residual is small beside the forces and joints are closed, or rounding that no longer falls.

        Joints count as closed within 1e-10 of the mechanism's length, or rad: unbounded reactions would hide wider
        gaps. Rounding must have stopped falling, to no less than a quarter of ``before``: soft springs and modes
        respond to residuals below the rounding of stiff links.

        Args:
            residual: at the state.
            before: norm of the residual one iteration ago; 0 if no other iteration can follow.
            noise: norm of other rounding errors of the residual.
        """
        if residual.norm <= self.options.tolerance * residual.forces < math.inf and residual.gap <= 1e-10:
            return True
        return 0.25 * before < residual.norm <= max(self._rounding(residual), noise) < math.inf

    def accept(
        self, state: State, control: Control, residual: Residual, residuals: Sequence[float], iterations: int
    ) -> EquilibriumPoint:
        """The equilibrium, its stability and tangent from the matrix last factored.

        Raises:
            NotConverged: an iterative solver stalled.
        """
        return Linearisation(self, state, control, residual).point(residuals, iterations, tolerance=_STEP)

    def accept_best(
        self, best: State, residual: Residual, control: Control, residuals: list[float], failure: NotConverged
    ) -> EquilibriumPoint:
        """The ``best`` state if its residual is rounding, as at a bifurcation.

        Rounding is up to 1e-4 of the forces where the tangent is nearly singular.

        Raises:
            NotConverged: the ``failure``, if more is left.
        """
        limit = min(1e-4 * residual.forces, self.options.roundoff * self.system.unknowns.unit)
        if not residual.norm <= limit < math.inf:
            raise failure
        at = self.linearise(best, control, iterations=failure.iterations)
        residuals = [*residuals[: failure.iterations], self.relative(at.residual)]
        return at.point(residuals, failure.iterations, tolerance=_STEP)

    def exhausted(self, residuals: Sequence[float], iterations: int) -> NotConverged:
        """The failure after the last iteration."""
        return NotConverged(
            f"the residual is {residuals[-1]:.1e} of the forces after {iterations} iterations", iterations
        )

    def _iterate_bordered(self, start: State, control: ArcLengthControl) -> EquilibriumPoint:
        """Newton's method by bordering, as above.

        It ends early, so that a shorter step is tried, after 10 iterations, where the residual grows a thousandfold
        from below 1e-2 of the forces, or where an iteration moves anything by half the mechanism's length, or half a
        rad.
        """
        system, state, residuals, before = self.system, start, [], math.inf
        for iteration in range(11):
            system.load(state)
            held = control.hold(system, state)
            residual = system.residual(state, held)
            residuals.append(self.relative(residual))
            if iteration > 0 and self.converged(residual, before):
                return self._across(control, self.linearise(state, held, residual), residuals, iteration + 1)
            if not math.isfinite(residual.norm):
                raise NotConverged("elements are inverted", iteration)
            if residuals[-1] > 1e3 * max(min(residuals), 1e-2):
                break
            before = residual.norm
            at = self.linearise(state, held, residual)
            change = control.onto(system, state, at.correction(), at.tangent())
            if not system.size(change) <= 0.5:
                break
            state = system.moved(state, change)
        raise NotConverged(f"the residual is {residuals[-1]:.1e} of the forces", len(residuals))

    def _across(
        self, control: ArcLengthControl, at: Linearisation, residuals: Sequence[float], iterations: int
    ) -> EquilibriumPoint:
        """The equilibrium with the unit tangent of the path, oriented along the control's normal."""
        point, followed = at.point(residuals, iterations), control.metric.followed
        scale = 1.0 / control.metric.norm(point.tangent)
        if not control.metric.dot(point.tangent, control.normal) > 0.0:
            scale = -scale
        rate = point.conjugate_rate if isinstance(at.control, type(followed)) else 1.0  # held is the conjugate itself
        return replace(point, control=control, tangent=point.tangent.scaled(scale), conjugate_rate=scale * rate)

    def _rounding(self, residual: Residual) -> float:
        """Rounding of displacements and rotations, which are counted from the drawn configuration.

        Less than 1e-9 of the mechanism's length counts as no displacement.
        """
        return self.options.roundoff * self.system.unknowns.unit * max(residual.motion, 1e-9)
