"""Load steps (natural continuation): from a known equilibrium to the wanted value of a control.

An equilibrium is predicted from those before, corrected, and accepted. Steps halve when the solver fails and double
when it took few iterations; the tangent bounds their motion; equilibria reached are kept. They end where they are small
relative to the distance covered, however far the target: the softest stiffness falls as √(1 − p / p*)
towards a limit load p*, and the last equilibrium, at p* − 2 p* / 1024 or nearer, keeps 5 % of it at most. A step that
moves a coordinate outside the range of the tangents at its ends may have snapped over a fold, where the path turns
back: it is halved too, and if that does not help the snap is accepted and counted.

Motors may go beyond a dead centre, where the slack of the joints ends and links must strain. Towards it a
coordinate x moves ever faster while the links are free of strain: close by, in units of x,

    C = b + ½ x² − e = 0,     E = ½ k e²,     λ = k e,     x λ = 0,

e the strain and b how far the motors are beyond the dead centre. Before it (b < 0) joints close by x alone, x = √(−2b)
and λ = 0; beyond it x = 0 and λ = k b. Newton's method does not get from one to the other: as long as λ = 0 the energy
is not curved along x, every step closes the joints by x alone, x ← ½ x − b / x, and for b > 0 these oscillate
without end. From a state that strains instead it converges, λ being the curvature. Such states lie along the rate with
x held:

    K ẏ = r,     K w = n,     ẏ ← ẏ − w (n · ẏ) / (n · w),     n the motion in ẏ, which is all x near the dead centre.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fenicsmech.equilibrium import (
    Control,
    EquilibriumPoint,
    EquilibriumSystem,
    Iteration,
    NotConverged,
    State,
    Step,
)
from fenicsmech.log import logger

_log = logger(__name__)


@dataclass(frozen=True, kw_only=True)
class LoadSteps:
    """Options of load steps; motions are in lengths of the mechanism, or rad.

    Attributes:
        smallest: smallest step, over the distance to the target, or the distance covered if that is less.
        motion: largest motion of a step along the tangent (measured).
        meaningless: smallest step that the tangent may impose, over the distance to the target; smaller ones arise in
            singular positions, where the tangent is ignored.
        runaway: motion from which on a prediction is discarded.
        reach: longest extrapolation by the cubic, over the width between its equilibria: its error grows as t⁴.
        easy: iterations up to which the next step is twice as long.
        off_tangent: deviation from the tangents, over the largest rate, that counts as a snap; kinks stay below.
        bend: largest rate of a step off a bifurcation, over the rate at its end.
        least_snap: smallest motion that counts as a snap; bifurcations stay below.
        smallest_snap: smallest step, as ``smallest``, that is halved because of a snap.
        minimum_shift: least shift of the tangent, in units of the mean stiffness, where a mechanism has zero-energy
            modes, which would leave it singular.
        shifts: factors of ``minimum_shift``, tried in order: a shift slows Newton's method down where soft springs or
            forces hold zero-energy modes with a smaller stiffness.
    """

    smallest: float = 1.0 / 1024.0
    motion: float = 0.2
    meaningless: float = 1e-6
    runaway: float = 1.0
    reach: float = 4.0
    easy: int = 5
    off_tangent: float = 0.2
    bend: float = 2.2
    least_snap: float = 1e-4
    smallest_snap: float = 1.0 / 64.0
    minimum_shift: float = 1e-10
    shifts: tuple[float, ...] = (1.0, 1e-3, 0.0)


class LoadStepsFailed(Exception):
    """Load stepping ended before the target.

    Attributes:
        last: the last equilibrium reached, or None.
        reached: its control value.
        reason: the solver's message.
        tried: control values without equilibrium.
    """

    def __init__(self, last: EquilibriumPoint | None, reached: float, reason: str, tried: tuple[float, ...]) -> None:
        super().__init__(reason)
        self.last, self.reached, self.reason, self.tried = last, reached, reason, tried


class Predictor(ABC):
    """Extrapolates a path."""

    @abstractmethod
    def predict(
        self, system: EquilibriumSystem, points: Sequence[EquilibriumPoint], value: float, reach: float
    ) -> State:
        """The guess at ``value`` from at most the last two points, whose cubic extrapolates ``reach`` widths."""


class Constant(Predictor):
    """The last equilibrium again."""

    def predict(self, system, points, value, reach):
        return points[-1].state


class Tangent(Predictor):
    """y(v) = y₀ + (v − v₀) y₀′."""

    def predict(self, system, points, value, reach):
        last = points[-1]
        return system.moved(last.state, last.tangent.scaled(value - last.control.target))


class Hermite(Predictor):
    """The cubic through the last two equilibria and their tangents.

    The tangent replaces it while there is only one, and where the two lie close together compared with the step.

    With t = (v − v₀) / w, w = v₀ − v₋₁:

        y(v) = y₀ + t² (3 + 2 t) (y₋₁ − y₀) + w t² (1 + t) y₋₁′ + w t (1 + t)² y₀′.
    """

    def predict(self, system, points, value, reach):
        before, last = points[0], points[-1]
        width = last.control.target - before.control.target
        if len(points) == 1 or abs(value - last.control.target) > reach * abs(width):
            return Tangent().predict(system, points, value, reach)
        t = (value - last.control.target) / width
        step = (
            system.difference(before.state, last.state).scaled(t * t * (3.0 + 2.0 * t))
            + before.tangent.scaled(width * t * t * (1.0 + t))
            + last.tangent.scaled(width * t * (1.0 + t) ** 2)
        )
        return system.moved(last.state, step)


class LoadStepper:
    """Follows equilibria as the target of one control changes.

    Args:
        solver: of the equilibria.
        start: a first guess at the control's value there.
        control: whose target changes.
        predictor: of the next equilibrium.
        steps: options of the steps.

    Attributes:
        iterations: KKT systems factored and solved so far.
        snaps: number of times the path turned back and an equilibrium on another one was reached.
    """

    def __init__(
        self,
        solver: Iteration,
        start: State,
        control: Control,
        *,
        predictor: Predictor,
        steps: LoadSteps = LoadSteps(),  # noqa: B008 (frozen)
    ) -> None:
        self._solver, self._system, self._predictor, self._steps = solver, solver.system, predictor, steps
        self._start, self._value = start, control.value(solver.system, start)
        self._origin, self._way = self._value, 0.0  # farthest from there so far
        self._shifts = tuple(part * start.minimum_shift for part in steps.shifts) if start.minimum_shift else (0.0,)
        self._points: list[EquilibriumPoint] = []  # the last two, at different values
        self._rate: Step | None = None  # of the last step, by the control value
        self.iterations = self.snaps = 0

    def advance(self, control: Control) -> EquilibriumPoint:
        """The equilibrium at ``control``'s target, reached in as many steps as needed.

        Raises:
            LoadStepsFailed: the smallest step failed.
        """
        if not self._points:
            self._settle(control.at(self._value))
        steps, distance = self._steps, control.target - self._value
        step, tried = distance, []
        while True:
            remaining = control.target - self._value
            step = self._shortened(step, least=steps.meaningless * abs(distance))
            arrives = abs(step) >= abs(remaining) * (1.0 - 1e-9)
            value = control.target if arrives else self._value + step
            try:
                point = self._solve(self._guess(value), control.at(value))
            except NotConverged as failure:
                tried.append(value)
                step = 0.5 * (value - self._value)
                if abs(step) <= steps.smallest * self._scale(distance):
                    raise LoadStepsFailed(self._last, self._value, failure.reason, tuple(tried)) from failure
                continue
            if self._snapped(point):
                if abs(value - self._value) > steps.smallest_snap * self._scale(distance):
                    step = 0.5 * (value - self._value)
                    continue
                self.snaps += 1
                self._rate = None
                _log.warning("between %g and %g the path turns back; what follows is another one", self._value, value)
            self._accept(point)
            if arrives:
                return point
            if point.iterations <= steps.easy:
                step *= 2.0

    @property
    def _last(self) -> EquilibriumPoint | None:
        return self._points[-1] if self._points else None

    def _settle(self, control: Control) -> None:
        """The equilibrium at the start, whose tangent limits the first step."""
        try:
            self._accept(self._solve(self._start, control))
        except NotConverged:
            pass

    def _solve(self, guess: State, control: Control) -> EquilibriumPoint:
        """The equilibrium near ``guess``, with the largest shift for zero-energy modes that leads there.

        Raises:
            NotConverged: none leads there.
        """
        for place, shift in enumerate(self._shifts):
            try:
                point = self._solver.solve(replace(guess, minimum_shift=shift), control)
            except NotConverged as failure:
                self.iterations += failure.iterations
                reason = failure.reason
                continue
            self.iterations += point.iterations
            self._shifts = self._shifts[place:]
            return point
        raise NotConverged(reason)

    def _guess(self, value: float) -> State:
        """The prediction at ``value``; where it moves too far that of the tangent, then the last equilibrium."""
        if not self._points:
            return self._start
        system, last = self._system, self._points[-1].state
        for predictor in (self._predictor, Tangent()):
            guess = predictor.predict(system, self._points, value, self._steps.reach)
            if system.size(system.difference(guess, last)) <= self._steps.runaway:
                return guess
        return last

    def _shortened(self, step: float, *, least: float) -> float:
        """``step``, shortened to the largest ``motion`` unless that is less than ``least``."""
        if not self._points:
            return step
        motion = self._system.size(self._points[-1].tangent) * abs(step)
        shortened = step * min(1.0, self._steps.motion / max(motion, self._steps.motion))
        return shortened if abs(shortened) > least else step

    def _scale(self, distance: float) -> float:
        """Reference length of steps: the distance covered so far, at first the first step, whatever the target.

        A limit load is located as closely by a load a thousand times as large as by one just beyond it.
        """
        way = self._way or abs(self._shortened(distance, least=self._steps.meaningless * abs(distance)))
        return min(abs(distance), way)

    def _snapped(self, point: EquilibriumPoint) -> bool:
        """Whether the rate of the step to ``point`` lies outside the range of the tangents at its ends.

        The rate of every coordinate over the step should lie between those at its ends, whatever moves elsewhere:

            r = (y₁ − y₀) / (v₁ − v₀),    |r − [y₀′, y₁′]| > 0.2 max(|y₀′|, |y₁′|)

        A path that bends off at a bifurcation moves as √v and r = 2 y₁′, however short the step; the span includes
        that. Close to a fold y₀′ grows beyond all bounds and is replaced by the rate of the step before. A step over
        which the two differ by a large motion is too long to judge.
        """
        distance = point.control.target - self._value
        if not self._points or distance == 0.0:
            return False
        system, last, steps = self._system, self._points[-1], self._steps
        before = last.tangent if self._rate is None else last.tangent.slower(self._rate)
        rate = system.difference(point.state, last.state).scaled(1.0 / distance)
        span = (before, point.tangent, point.tangent.scaled(steps.bend))
        beyond = system.size(system.independent(rate.beyond(span)))
        largest = max(system.size(before), system.size(point.tangent))
        grown = system.size(last.tangent + before.scaled(-1.0)) * abs(distance)
        if (
            beyond > max(steps.off_tangent * largest, steps.least_snap / abs(distance))
            or grown > steps.off_tangent * steps.motion
        ):
            return True
        self._rate = rate
        return False

    def _accept(self, point: EquilibriumPoint) -> None:
        """Keeps ``point`` and the one before it at another value."""
        self._value = point.control.target
        self._points = [*(p for p in self._points[-1:] if p.control.target != self._value), point]
        self._way = max(self._way, abs(self._value - self._origin))


class MotorStepper(LoadStepper):
    """Load steps of motors, also past the dead centre of an unloaded mechanism."""

    def advance(self, control: Control) -> EquilibriumPoint:
        try:
            return super().advance(control)
        except LoadStepsFailed as failure:
            if failure.last is None or not self._strain(failure.last, control):
                raise
        return super().advance(control)

    def _strain(self, last: EquilibriumPoint, control: Control) -> bool:
        """Continues from the ``last`` equilibrium by straining links; whether this succeeded."""
        system, steps, distance = self._system, self._steps, control.target - self._value
        try:
            rate = self._held_rate(last, control.at(self._value))
        except NotConverged:
            return False
        step = distance * min(1.0, steps.motion / max(system.size(rate) * abs(distance), steps.motion))
        while abs(step) > steps.smallest * self._scale(distance):
            guess = system.moved(last.state, rate.scaled(step))
            try:
                point = self._solve(guess, control.at(self._value + step))
            except NotConverged:
                point = None
            if point is None or self._strayed(last, rate, step, point):
                step *= 0.5
                continue
            _log.info("links strain beyond a dead centre near %g", self._value)
            self._rate, self._points = None, []
            self._accept(point)
            return True
        return False

    def _strayed(self, last: EquilibriumPoint, held: Step, step: float, point: EquilibriumPoint) -> bool:
        """Whether a coordinate's rate over ``step`` lies outside the range of ``held`` and the tangents at its ends."""
        system = self._system
        rate = system.difference(point.state, last.state).scaled(1.0 / step)
        beyond = system.size(system.independent(rate.beyond((held, last.tangent, point.tangent))))
        return beyond > self._steps.off_tangent * max(system.size(held), system.size(point.tangent))

    def _held_rate(self, last: EquilibriumPoint, control: Control) -> Step:
        """Rate of the state with the target of ``control``, the dominant motion x held.

        Raises:
            NotConverged: the tangent cannot be factored or solved with, or is not positive along the motion.
        """
        at = self._solver.linearise(last.state, control)
        rate = at.rate()
        motion = rate.duplicate()
        motion.pointwiseMult(self._system.unknowns.coordinates_mask(), rate)
        motion.normalize()
        strain = at.solve(motion)
        compliance = motion.dot(strain)
        if not compliance > 0.0:
            raise NotConverged("nothing resists the motion towards a dead centre")
        rate.axpy(-motion.dot(rate) / compliance, strain)
        return at.step(rate)
