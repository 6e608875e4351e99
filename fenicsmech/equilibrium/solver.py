"""The interface of equilibrium solvers: a method with its limits, and the solver it makes for one system."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from petsc4py import PETSc

from fenicsmech.equilibrium.control import ArcLengthControl, Control, PathPlane
from fenicsmech.equilibrium.linearisation import (
    EquilibriumPoint,
    InvertedGuess,
    Linearisation,
    LinearMethod,
    LinearSolver,
    NotConverged,
)
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.equilibrium.system import EquilibriumSystem, Residual
from fenicsmech.equilibrium.two_level import BySize
from fenicsmech.errors import counted, expect, set_options

_STRETCHED = 5e-3  # motion over the mechanism's length, about an element's size, that rounds u as F = I + ∇u is
_NO_MOTION = 1e-9  # over the mechanism's length, or rad, that counts as none
_STILL = 1e-12  # likewise, that is the rounding of displacements
_FAR = 100.0  # residual over rounding beyond which no step is as small as that
_ROUNDING = 1e-4  # residual over the forces that may be rounding where the KKT matrix is nearly singular
_DONE = 1e-6  # work of a residual along the step it asks for, over the forces times the motion, that may be rounding
STEP = 1e-6  # relative error that iterative solvers may leave in steps and tangents: the next iteration corrects it


@dataclass(frozen=True, kw_only=True)
class EquilibriumMethod(ABC):
    """A method for equilibria, with its limits; ``solver`` makes the solver of one system.

    Attributes:
        tolerance: residual over the forces that balance in it, at convergence.
        roundoff: residual in units of mean stiffness times the largest displacement (rotations: times length) below
            which digits are lost, at least 5e-3 of the length where effects load links; of mean stiffness times length
            where the KKT matrix is nearly singular.
        linear: method for the linear systems; by default chosen by their size.

    Raises:
        DescriptionError: a limit is not a positive number, or ``linear`` is not a method.
    """

    tolerance: float = 1e-9
    roundoff: float = 1e-14
    linear: LinearMethod = field(default_factory=BySize)

    def __post_init__(self, *, free: Collection[str] = (), **least: int) -> None:
        """Checks all numbers; subclasses give those that may be any, and the least of whole ones (``set_options``)."""
        set_options(self, "Newton's method", free=free, below_one=(), **least)
        expect("linear systems", self.linear, LinearMethod, "a method", "Give BySize(…), Direct() or TwoLevel(…)")

    @abstractmethod
    def solver(self, system: EquilibriumSystem) -> EquilibriumSolver:
        """The solver for one system."""


class EquilibriumSolver(ABC):
    """The solver of one system's equilibria, with the linear solver it keeps between solves.

    Subclasses implement ``iterate``.

    Attributes:
        system: the equations.
        options: of the method.
        factorisations: of KKT matrices so far.
    """

    def __init__(self, system: EquilibriumSystem, options: EquilibriumMethod) -> None:
        self.system, self.options, self.factorisations = system, options, 0

    @cached_property
    def linear(self) -> LinearSolver:
        """The linear solver, made for the first matrix and kept."""
        return self.options.linear.solver(self.system)

    @property
    def turning(self) -> EquilibriumSolver | None:
        """A solver whose steps turn links instead of straining them; None if there is none."""
        return None

    def patient(self, factor: int) -> EquilibriumSolver:
        """A solver that takes up to ``factor`` times as many iterations; this one if their number has no bound."""
        return self

    def solve(self, start: State, control: Control) -> EquilibriumPoint:
        """The equilibrium near ``start`` under ``control``.

        Args:
            start: first guess; its least shift is that of all KKT matrices, and equilibria as ``unstable`` are wanted.
            control: the prescribed value.

        Raises:
            InvertedGuess: elements are inverted in it.
            NotConverged: too many iterations, no descent, or elements inverted all along.
        """
        start = control.prepare(start)
        self.system.load(start)
        if not math.isfinite(self.system.elastic_energy()):
            raise InvertedGuess
        return self.iterate(start, control)

    @abstractmethod
    def iterate(self, start: State, control: Control) -> EquilibriumPoint:
        """``solve`` from a ``start`` that is loaded and has the force, motors or load factor of ``control``."""

    def linearise(
        self, state: State, control: Control, residual: Residual | None = None, *, iterations: int = 0
    ) -> Linearisation:
        """The KKT matrix at an equilibrium, factored with the least shift of the state.

        Args:
            state: the equilibrium.
            control: the prescribed value.
            residual: at the state, if that is loaded.
            iterations: number so far, reported with a failure.

        Raises:
            NotConverged: it cannot be factored.
        """
        if residual is None:
            self.system.load(state)
            residual = self.system.residual(state, control)
        self.system.linearise(state, control, residual)
        if not self.factor(state.minimum_shift):
            raise NotConverged("the KKT matrix at the equilibrium cannot be factored", iterations)
        return Linearisation(self.system, self.linear, state, control, residual)

    def missed(self, start: State, found: EquilibriumPoint, rounding: float) -> float:
        """How far one step back from an equilibrium ``found`` misses its guess ``start``: ``Linearisation.missed``."""
        self.system.load(start)
        missing = self.system.residual(start, found.control).vector
        self.system.unknowns.turn(found.state.poses)
        return found.linearisation.missed(start, found.state, missing, rounding)

    def hides(self, state: State, control: Control) -> bool:
        """Whether the rounding of stiff links hides what resists some motion at a ``state``."""
        try:
            return self.linearise(state, control).drowns_modes
        except NotConverged:
            return False

    # -- parts of iterations -----------------------------------------------------------------------------------

    def factor(self, shift: float, *, least: bool = True) -> bool:
        """Factors the KKT matrix last linearised with a ``shift``; whether that could be done.

        The ``least`` one, which zero-energy modes need, has the weights of ``ScaledUnknowns``: what is less than the
        stiffness of a stiff link would hold a soft one.
        """
        self.factorisations += 1
        with self.system.clock.phase("factor"):
            self.system.kkt.shift(shift, weighted=least)
            return self.linear.refactor()

    def try_solve(self, right: PETSc.Vec, tolerance: float) -> PETSc.Vec | None:
        """The solution with the matrix last factored, None if an iterative solver stalled."""
        with self.system.clock.phase("solve"):
            x = right.duplicate()
            return x if self.linear.solve(right, x, tolerance) else None

    def plane(self, state: State, control: Control, residual: Residual) -> PathPlane | None:
        """The plane across a path, for steps with the matrix last factored; None for other controls."""
        if not isinstance(control, ArcLengthControl):
            return None
        rate = self.try_solve(control.rate(self.system, state), self.step_accuracy(residual))
        if rate is None:
            raise NotConverged("the linear solver stalled")
        return PathPlane(control, self.system, state, rate)

    def newton_step(self, x: PETSc.Vec, plane: PathPlane | None) -> Step:
        """The step −``x`` with K x the residual, moved into the ``plane`` across a path."""
        return self.system.unknowns.step(x).scaled(-1.0) if plane is None else plane.reached(-x)

    def descends(self) -> bool:
        """Whether the inertia known from the last solve guarantees that its solution is a descent direction."""
        inertia = self.linear.known_inertia()
        return inertia.negative <= self.system.negative_where_stable and inertia.zero == 0

    def relative(self, residual: Residual) -> float:
        """The residual over the forces that balance in it."""
        return residual.norm / max(residual.forces, self.rounding(residual))

    def step_accuracy(self, residual: Residual) -> float:
        """Admissible relative error of a Newton step, 1e-3 far from the equilibrium.

        A tenth of the residual that the step leaves anyway, or enough to take it well below the tolerance: errors of
        stiff modes weigh far more in the residual than in the energy.
        """
        relative = self.relative(residual)
        enough = 1e-3 * self.options.tolerance / max(relative, self.options.tolerance)
        return min(max(0.1 * relative, enough, STEP), 1e-3)

    def converged(self, residual: Residual, before: float = 0.0, *, noise: float = 0.0) -> bool:
        """Whether joints are closed and the residual is small relative to the forces, or rounding that no longer falls.

        Joints count as closed within 1e-10 of the mechanism's length, or rad: unbounded reactions would hide wider
        gaps. Rounding must have stopped falling, to no less than a quarter of ``before``: soft springs and modes
        respond to residuals below the rounding of stiff links. Nor may it rise to more than twice that: then links that
        turn are strained by the last step, which the next one undoes. ``before`` is the norm of the residual one
        iteration ago, 0 if this iteration is the last one; ``noise`` is that of other rounding errors of the residual.
        """
        if residual.norm <= self.options.tolerance * residual.forces < math.inf and residual.gap <= 1e-10:
            return True
        steady = 0.25 * before < residual.norm and (not before or residual.norm <= 2.0 * before)
        return steady and residual.norm <= max(self.rounding(residual), noise) < math.inf

    def accept(
        self, state: State, control: Control, residual: Residual, residuals: Sequence[float], iterations: int
    ) -> EquilibriumPoint:
        """The equilibrium, its stability and tangent from the matrix last factored."""
        at = Linearisation(self.system, self.linear, state, control, residual)
        return at.point(residuals, iterations, tolerance=STEP)

    def accept_best(
        self, best: State, residual: Residual, control: Control, residuals: list[float], failure: NotConverged
    ) -> EquilibriumPoint:
        """The ``best`` state if its residual is rounding, as at a bifurcation; else raises the ``failure``.

        Rounding is up to 1e-4 of the forces where the KKT matrix is nearly singular, more where stiff links turn. The
        step x that the residual r still asks for, of largest motion |x|, is none then, or r does no work along it,

            r · x ≤ 1e-6 forces |x|,     K x = r:

        near a fold a residual as small may ask for a large motion, and soft springs may be out of balance by less than
        |r| tells. The rounding of many nodes may exceed its bound: an x of neither work nor motion shows it, or one as
        small as the rounding of displacements. Where that of K drowns what resists, x tells nothing.
        """
        near_singular, rounding = residual.norm <= self.roundoff(residual), self.rounding(residual)
        if not (near_singular or residual.norm <= _FAR * rounding) or not math.isfinite(residual.norm):
            raise failure
        at = self.linearise(best, control, iterations=failure.iterations)
        x = at.solve(at.residual.vector)
        motion = self.system.size(self.system.unknowns.step(x))
        work = abs(x.dot(at.residual.vector)) / self.system.unknowns.unit
        within = near_singular or residual.norm <= rounding
        small = (within, motion <= _NO_MOTION, work <= _DONE * at.residual.forces * motion)
        if not (sum(small) >= 2 or motion <= _STILL) or at.drowns_modes:
            raise failure
        residuals = [*residuals[: failure.iterations], self.relative(at.residual)]
        return at.point(residuals, failure.iterations, tolerance=STEP)

    def roundoff(self, residual: Residual) -> float:
        """The largest residual that counts as rounding where the KKT matrix is nearly singular."""
        return min(_ROUNDING * residual.forces, self.options.roundoff * self.system.unknowns.unit)

    def exhausted(self, residuals: Sequence[float], iterations: int) -> NotConverged:
        """The failure after the last iteration."""
        return NotConverged(
            f"the residual is {residuals[-1]:.1e} of the forces after {counted(iterations, 'iteration')}", iterations
        )

    def rounding(self, residual: Residual) -> float:
        """Rounding of displacements and rotations, which are counted from the drawn configuration.

        Less than ``_NO_MOTION`` of the mechanism's length counts as no displacement. Where effects load links, that of
        F = I + ∇u counts as well: it is all that is left of loads that balance on each link, as pressure does.
        """
        least = _NO_MOTION if self.system.elastic.effects_ufl is None else _STRETCHED
        return self.options.roundoff * self.system.unknowns.unit * max(residual.motion, least)
