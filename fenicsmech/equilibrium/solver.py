"""What every equilibrium solver is: a description with its limits, and the iteration it makes for one system.

An iteration finds equilibria its own way; what follows an equilibrium (its stability, its rate along the path,
sensitivities) is the same for all: linear solves with the true KKT matrix there, or where the last step came
from, and its inertia.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from petsc4py import PETSc

from fenicsmech.checks import positive
from fenicsmech.compat import destroy_garbage
from fenicsmech.equilibrium.border import PointLoad
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.linear import BySize, Inertia, LinearMethod, LinearSolver
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual

_STEP = 1e-6  # relative error of steps and tangents that iterative solvers may leave to the next iteration
_ROUGH = 1e-3  # far from the equilibrium
_SPARE = 1e-3  # of the tolerance, what linear solves may leave when a step reaches it
_EXACT = 1e-10  # the same of other solutions
_LEAST_MOTION = 1e-9  # of the mechanism's length: what is smaller counts as no displacement
_FALLING = 0.25  # of the residual before: soft springs and modes feel what is left below rounding of stiff links
_CLOSED = 1e-10  # of the mechanism's length, or rad: joints open farther hide behind reactions without bounds
_BEARABLE = 1e-4  # of the forces, where the tangent is all but singular


@dataclass(frozen=True, eq=False)
class Solution:
    """A converged equilibrium.

    Attributes:
        state: the equilibrium.
        residuals: relative residual before each iteration and at the end.
        iterations: KKT systems factored and solved on the way.
        unstable_modes: number of directions in which the energy has a maximum, under dead loads.
        unstable_under_control: the same with the control's constraint.
        tangent: rate of the state with the control's target.
        linearisation: the KKT matrix last factored on the way, which has served for stability and tangent.
    """

    state: State
    residuals: tuple[float, ...]
    iterations: int
    unstable_modes: int
    unstable_under_control: int
    tangent: Step
    linearisation: Linearisation


class NotConverged(Exception):
    """The iteration ended without an equilibrium; ``reason`` says why."""

    def __init__(self, reason: str, iterations: int) -> None:
        super().__init__(reason)
        self.reason, self.iterations = reason, iterations


@dataclass(frozen=True, kw_only=True)
class EquilibriumSolver(ABC):
    """How equilibria are found.

    Attributes:
        tolerance: residual over the forces that balance in it, at convergence.
        roundoff: residual in units of mean stiffness times the largest displacement (rotations: times length) below
            which digits are lost; of mean stiffness times length where the tangent is all but singular.
        linear: how the linear systems are solved; by their size unless said otherwise.

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

    It serves until its solver factors another matrix; from then on it refuses.

    Args:
        solver: which has just factored K.
        state, control, residual: where K was taken.

    Attributes:
        state, control, residual: likewise.
    """

    def __init__(self, solver: Iteration, state: State, control: Control, residual: Residual) -> None:
        self.state, self.control, self.residual = state, control, residual
        self._solver, self._made = solver, self._present(solver)

    def solve(self, right: PETSc.Vec, *, tolerance: float = _EXACT) -> PETSc.Vec:
        """x with K x = ``right``.

        Args:
            right: right-hand side.
            tolerance: relative error that iterative solvers may leave.

        Raises:
            NotConverged: an iterative solver stalled.
        """
        self._check()
        x = self._solver._solution(right, tolerance)
        if x is None:
            raise NotConverged("the linear solver stalled", 0)
        return x

    def rate(self) -> PETSc.Vec:
        """x′ of the scaled unknowns x with the control's target."""
        self._turn()
        return self.solve(self.control.rate(self._solver.system, self.state))

    def inertia(self) -> Inertia:
        """Numbers of K's negative and zero eigenvalues."""
        self._check()
        with self._solver.system.clock.phase("inertia"):
            return self._solver._linear.inertia()

    def travel_gradient(self, load: PointLoad) -> PETSc.Vec:
        """∂(a · u_P)/∂x of a load's travel."""
        self._turn()
        return self._solver.system.travel_gradient(load, self.state)

    def displacements(self, x: PETSc.Vec) -> np.ndarray:
        """∂u/∂x · x of all nodes, as in ``State.u``, (owned dofs,)."""
        self._turn()
        return self._solver.system.unknowns.apply(x)

    def step(self, x: PETSc.Vec) -> Step:
        """The change of state that x stands for."""
        return self._solver.system.unknowns.step(x)

    def _check(self) -> None:
        if self._made != self._present(self._solver):
            raise RuntimeError("this linearisation is out of date: another matrix was made or factored since")

    @staticmethod
    def _present(solver: Iteration) -> tuple[int, int]:
        """Numbers of the matrix and of the factor that the solver holds."""
        return solver.system.kkt.linearised, solver.factored

    def _turn(self) -> None:
        """Brings the map from x to displacements back to this state."""
        unknowns = self._solver.system.unknowns
        if unknowns.poses is not self.state.poses:
            unknowns.turn(self.state.poses)


class Iteration(ABC):
    """One system's solver, with the linear solver it keeps between solves.

    Attributes:
        system: the equations.
        options: of the solver.
        factored: number of matrices factored so far.
    """

    def __init__(self, system: EquilibriumSystem, options: EquilibriumSolver) -> None:
        self.system, self.options = system, options
        self._linear: LinearSolver | None = None
        self.factored = 0

    @abstractmethod
    def solve(self, start: State, control: Control) -> Solution:
        """The equilibrium near ``start`` under ``control``.

        Args:
            start: first guess.
            control: what is asked for.

        Raises:
            NotConverged: too many iterations, no descent, or elements inverted all along.
        """

    def _begin(self, start: State, control: Control) -> State:
        """``start`` with what the control prescribes, loaded (collective).

        Raises:
            NotConverged: elements are inverted there.
        """
        state = control.prepare(start)
        self.system.load(state)
        if not math.isfinite(self.system.elastic_energy()):
            raise NotConverged("elements are inverted in the predicted state", 0)
        return state

    def linearise(self, state: State, control: Control) -> Linearisation:
        """The KKT matrix at an equilibrium, factored.

        Raises:
            NotConverged: it cannot be factored.
        """
        self.system.load(state)
        residual = self.system.residual(state, control)
        self._factor_true(state, control, residual, 0)
        return Linearisation(self, state, control, residual)

    def relative(self, residual: Residual) -> float:
        """The residual over the forces that balance in it."""
        return residual.norm / max(residual.forces, self._rounding(residual))

    def converged(self, residual: Residual, before: float = 0.0, *, noise: float = 0.0) -> bool:
        """Whether the residual is small beside the forces and joints are closed, or it is rounding that falls no more.

        Args:
            residual: with the residual.
            before: norm of the residual one iteration ago; 0 if no other iteration can follow.
            noise: what else rounds the residual, as a norm of it.
        """
        if residual.norm <= self.options.tolerance * residual.forces < math.inf and residual.gap <= _CLOSED:
            return True
        return _FALLING * before < residual.norm <= max(self._rounding(residual), noise) < math.inf

    def bearable(self, residual: Residual) -> bool:
        """Whether a state will do where nothing better is found, as at a bifurcation."""
        limit = min(_BEARABLE * residual.forces, self.options.roundoff * self.system.unknowns.unit)
        return residual.norm <= limit < math.inf

    def _rounding(self, residual: Residual) -> float:
        """Rounding of displacements and rotations, which are counted from the drawn configuration."""
        return self.options.roundoff * self.system.unknowns.unit * max(residual.motion, _LEAST_MOTION)

    def _refactor(self, shift: float) -> bool:
        """Takes the KKT matrix last linearised with a ``shift``; whether that could be done."""
        with self.system.clock.phase("factor"):
            self.factored += 1
            self.system.kkt.shift(shift)
            if self._linear is None:
                self._linear = self.options.linear.solver(self.system)
            return self._linear.refactor()

    def _factor_true(self, state: State, control: Control, residual: Residual, iterations: int) -> None:
        """Factors the KKT matrix of the loaded ``state`` with the least shift.

        Raises:
            NotConverged: it cannot be factored.
        """
        self.system.linearise(state, control, residual)
        if not self._refactor(state.minimum_shift):
            raise NotConverged("the tangent at the equilibrium cannot be factored", iterations)

    def _solution(self, right: PETSc.Vec, tolerance: float) -> PETSc.Vec | None:
        """The solution with the matrix last factored, None if an iterative solver stalled."""
        with self.system.clock.phase("solve"):
            x = right.duplicate()
            return x if self._linear.solve(right, x, tolerance) else None

    def _accuracy(self, residual: Residual) -> float:
        """Relative error of a step from there that does no harm.

        A tenth of what the step leaves anyway, or what takes the residual well below the tolerance: an error of stiff
        modes counts for hundreds of times more in the residual than in the energy.
        """
        relative = self.relative(residual)
        enough = _SPARE * self.options.tolerance / max(relative, self.options.tolerance)
        return min(max(0.1 * relative, enough, _STEP), _ROUGH)

    def _descends(self) -> bool:
        """Whether what the last solve saw of the matrix promises that its solution is a direction of descent."""
        inertia = self._linear.known_inertia()
        return inertia.negative <= self.expected and inertia.zero == 0

    @property
    def expected(self) -> int:
        """Negative eigenvalues where stable: one per multiplier and pressure, one for the controlled force."""
        return self.system.joints.rows + 1 + self.system.blocks.pressures.size

    def _bear(
        self, best: State, residual: Residual, control: Control, residuals: list[float], failure: NotConverged
    ) -> Solution:
        """The ``best`` state where nothing better is found; raises ``failure`` unless it is bearable."""
        if not self.bearable(residual):
            raise failure
        self.system.load(best)
        residual = self.system.residual(best, control)
        self._factor_true(best, control, residual, failure.iterations)
        residuals = [*residuals[: failure.iterations], self.relative(residual)]
        return self._accept(best, control, residual, residuals, failure.iterations)

    def _spent(self, residuals: list[float], iterations: int) -> NotConverged:
        """The failure after the last iteration."""
        return NotConverged(
            f"the residual is {residuals[-1]:.1e} of the forces after {iterations} iterations", iterations
        )

    def _accept(
        self, state: State, control: Control, residual: Residual, residuals: Sequence[float], iteration: int
    ) -> Solution:
        """Stability and tangent at the equilibrium, from the matrix last factored, without what mends steps."""
        system = self.system
        destroy_garbage(system.comm)
        right = control.rate(system, state)
        x = right.duplicate()
        with system.clock.phase("solve"):
            inertia = self._linear.solve_and_count(right, x, _STEP)
        if inertia is None:
            raise NotConverged("the linear solver stalled", iteration)
        under_control = inertia.negative - self.expected
        unstable = under_control
        if control.constrained:
            # x = −K⁻¹ e, and e · K⁻¹ e < 0 exactly if removing the control's row e leaves stability as it is
            unstable += int(x.dot(system.unknowns.control_row()) <= 0.0)
        return Solution(
            state,
            tuple(residuals),
            iteration,
            max(unstable, 0),
            max(under_control, 0),
            system.unknowns.step(x),
            Linearisation(self, state, control, residual),
        )
