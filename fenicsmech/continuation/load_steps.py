"""Load steps (natural continuation): from a known equilibrium to the wanted value of a control.

An equilibrium is predicted from those before, corrected, and accepted. Steps halve when the solver fails and double
when it was easy, and never go farther than a stride of the tangent; equilibria that were reached are never lost. They
end where they are small beside the way gone, however far the target: the softest stiffness falls as √(1 − p / p*)
towards a limit load p*, and the last equilibrium, at p* − 2 p* / 1024 or nearer, keeps 5 % of it at most. A step that
moves anything otherwise than the tangents at both its ends say may have snapped over a fold, where the path turns
back: it halves too, and where that does not help the snap is accepted and counted.

Motors may go beyond a dead centre, where the slack of the joints ends and links must strain. On the way there a
coordinate x swings ever faster while the links do as they like: close by, in units of x,

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
    """How long load steps are; motions are in lengths of the mechanism, or rad.

    Attributes:
        smallest: smallest step, of the distance asked for, or of the way that lies behind if that is less.
        motion: how far a step may move anything by the tangent (measured).
        meaningless: of the distance asked for; a tangent that wants steps this small says nothing, as in a singular
            position.
        runaway: a prediction that moves anything this far is discarded.
        reach: widths between two equilibria that their cubic is trusted to go on for: its error grows as t⁴.
        easy: iterations up to which the next step is twice as long.
        off_tangent: of the largest rate; what moves farther off its tangents may have snapped, kinks never do.
        bend: times the rate at its end, how far a step off a bifurcation may go.
        least_snap: a motion that never is a snap, as past a bifurcation.
        smallest_snap: a step, as ``smallest``, that is not halved any more because it snaps.
        minimum_shift: least shift of the tangent, in units of the mean stiffness, where a mechanism has zero-energy
            modes, which would leave it singular.
        shifts: parts of it that are tried: soft springs, or forces, may hold zero-energy modes with less yet, and a
            shift slows Newton's method down where the true stiffness is smaller still.
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
        reason: what the solver said.
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
        """The guess at ``value`` from at most the last two points, whose cubic is trusted for ``reach`` widths."""


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

    While there is only one, and where the two lie close together compared with the step, along the tangent.

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
        control: that changes.
        predictor: of the next equilibrium.
        steps: how long steps are.

    Attributes:
        iterations: KKT systems factored and solved so far.
        snaps: how often the path turned back, and the equilibrium that was reached lies on another one.
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
        """The equilibrium at ``control``'s target, reached in as many steps as it takes.

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
        """The prediction at ``value``, a plainer one where it runs away, in the end the last equilibrium."""
        if not self._points:
            return self._start
        system, last = self._system, self._points[-1].state
        for predictor in (self._predictor, Tangent()):
            guess = predictor.predict(system, self._points, value, self._steps.reach)
            if system.size(system.difference(guess, last)) <= self._steps.runaway:
                return guess
        return last

    def _shortened(self, step: float, *, least: float) -> float:
        """``step``, shortened if it moves anything too far, not to less than ``least``."""
        if not self._points:
            return step
        motion = self._system.size(self._points[-1].tangent) * abs(step)
        shortened = step * min(1.0, self._steps.motion / max(motion, self._steps.motion))
        return shortened if abs(shortened) > least else step

    def _scale(self, distance: float) -> float:
        """What steps are small beside: the way gone so far, or the first step if there is none, whatever the target.

        A limit load is located as closely by a load a thousand times as large as by one just beyond it.
        """
        way = self._way or abs(self._shortened(distance, least=self._steps.meaningless * abs(distance)))
        return min(abs(distance), way)

    def _snapped(self, point: EquilibriumPoint) -> bool:
        """Whether a step to ``point`` leads where the tangents at its ends do not.

        The rate of every coordinate over the step should lie between those at its ends, whatever moves elsewhere:

            r = (y₁ − y₀) / (v₁ − v₀),    |r − [y₀′, y₁′]| > 0.2 max(|y₀′|, |y₁′|)

        A path that bends off at a bifurcation moves as √v and r = 2 y₁′, however short the step; the span reaches that
        far. Close to a fold y₀′ says nothing, as it grows beyond all bounds; the rate of the step before does. A step
        over which the difference of the two would go far is too long to judge.
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
    """Equilibria as motors move, past the dead centre of an unloaded mechanism too."""

    def advance(self, control: Control) -> EquilibriumPoint:
        try:
            return super().advance(control)
        except LoadStepsFailed as failure:
            if failure.last is None or not self._strain(failure.last, control):
                raise
        return super().advance(control)

    def _strain(self, last: EquilibriumPoint, control: Control) -> bool:
        """Goes on from the ``last`` equilibrium by straining links; whether that led to another one."""
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
        """Whether a coordinate moved otherwise than at a rate between the ``held`` one, x's before and that after."""
        system = self._system
        rate = system.difference(point.state, last.state).scaled(1.0 / step)
        beyond = system.size(system.independent(rate.beyond((held, last.tangent, point.tangent))))
        return beyond > self._steps.off_tangent * max(system.size(held), system.size(point.tangent))

    def _held_rate(self, last: EquilibriumPoint, control: Control) -> Step:
        """Rate of the state with the target of ``control``, the motion that runs away held.

        Raises:
            NotConverged: the tangent cannot be factored, or solved with, or has a maximum of the energy in it.
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
