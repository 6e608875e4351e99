"""Load steps: from a known equilibrium to the wanted control value, by predictor and Newton.

Steps halve when Newton fails and double when it was easy, and never go farther than a stride of the tangent;
equilibria that were reached are never lost. They end where they are small beside the way gone, however far the target:
the softest stiffness falls as √(1 − p / p*) towards a limit load p*, and the last equilibrium, at p* − 2 p* / 1024 or
nearer, keeps 5 % of it at most. A step that moves anything otherwise than the tangents at both its ends say may have
leapt over a fold, where the path turns back: it halves too, and where that does not help the leap is kept and counted.
"""

from __future__ import annotations

from dataclasses import replace

from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.predictor import Anchor, Predictor, Tangent
from fenicsmech.equilibrium.solver import Iteration, NotConverged, Solution
from fenicsmech.equilibrium.state import State, Step
from fenicsmech.log import logger

_log = logger(__name__)
SMALLEST = 1.0 / 1024.0
"""Smallest step, of the distance asked for, or of the way that lies behind if that is less."""
STRIDE = 0.2
"""How far a step may move anything by the tangent, of the mechanism's length, or rad (measured)."""
BEYOND = 0.2
"""Of the largest rate: what moves farther off its tangents may have leapt; kinks never do."""
_EASY = 5  # iterations
_SINGULAR = 1e-6  # of the distance asked for: a tangent that wants steps this small has no meaning
_RUNAWAY = 5.0 * STRIDE  # a prediction that moves anything this far is none
_BENT = 2.2  # times the rate at its end: how far a step off a bifurcation may go
_LEAST_MOTION = 1e-4  # of the mechanism's length, or rad: what is no leap in any case, as past a bifurcation
_SMALLEST_LEAP = 1.0 / 64.0  # likewise: a step that is not halved any more because it leaps
ZERO_ENERGY_SHIFT = 1e-10
"""Least shift of the tangent where freedoms have no stiffness, in units of the mean stiffness."""
_LESS = (1.0, 1e-3, 0.0)  # parts of it that are tried: soft springs, or forces, may hold such freedoms with less yet


class PathFailed(Exception):
    """Load stepping ended before the target.

    Attributes:
        last: the last equilibrium reached, or None.
        reached: its control value.
        reason: what Newton said.
        tried: control values tried in vain.
    """

    def __init__(self, last: Solution | None, reached: float, reason: str, tried: tuple[float, ...]) -> None:
        super().__init__(reason)
        self.last, self.reached, self.reason, self.tried = last, reached, reason, tried


class Path:
    """Follows equilibria as the target of one control changes.

    Args:
        newton: the solver.
        start: a first guess at ``value``.
        value: the control value there.
        predictor: how the next equilibrium is guessed.

    Attributes:
        iterations: KKT systems factored and solved so far.
        leaps: how often the path turned back, and the equilibrium that was reached lies on another one.
    """

    def __init__(self, newton: Iteration, start: State, value: float, *, predictor: Predictor) -> None:
        self._newton, self._start, self._value, self._predictor = newton, start, value, predictor
        self._origin, self._way = value, 0.0  # farthest from there so far
        self._shifts = tuple(part * start.minimum_shift for part in _LESS) if start.minimum_shift else (0.0,)
        self._anchors: list[Anchor] = []
        self._last: Solution | None = None
        self._rate: Step | None = None  # at which the last step moved, by the control value
        self.iterations = self.leaps = 0

    def advance(self, control: Control) -> Solution:
        """The equilibrium at ``control``'s target, reached in as many steps as it takes (collective).

        Raises:
            PathFailed: the smallest step failed.
        """
        if not self._anchors:
            self._settle(control.at(self._value))
        distance = control.target - self._value
        step, tried = distance, []
        while True:
            remaining = control.target - self._value
            step = self._strided(step, least=_SINGULAR * abs(distance))
            last = abs(step) >= abs(remaining) * (1.0 - 1e-9)
            value = control.target if last else self._value + step
            try:
                solution = self._solve(self._guess(value), control.at(value))
            except NotConverged as failure:
                tried.append(value)
                step = 0.5 * (value - self._value)
                if abs(step) <= SMALLEST * self._scale(distance):
                    raise PathFailed(self._last, self._value, failure.reason, tuple(tried)) from failure
                continue
            if self._leapt(value, solution):
                if abs(value - self._value) > _SMALLEST_LEAP * self._scale(distance):
                    step = 0.5 * (value - self._value)
                    continue
                self.leaps += 1
                self._rate = None
                _log.warning("between %g and %g the path turns back; what follows is another one", self._value, value)
            self._last = solution
            self._remember(Anchor(value, solution.state, solution.tangent))
            if last:
                return solution
            if solution.iterations <= _EASY:
                step *= 2.0

    def _settle(self, control: Control) -> None:
        """The equilibrium at the start, whose tangent tells how far to go at first."""
        try:
            solution = self._solve(self._start, control)
        except NotConverged:
            return
        self._last = solution
        self._remember(Anchor(self._value, solution.state, solution.tangent))

    def _solve(self, guess: State, control: Control) -> Solution:
        """The equilibrium near ``guess``, with the largest shift for zero-energy modes that leads there.

        A shift slows Newton's method down where the true stiffness is smaller still.

        Raises:
            NotConverged: none leads there.
        """
        for place, shift in enumerate(self._shifts):
            try:
                solution = self._newton.solve(replace(guess, minimum_shift=shift), control)
            except NotConverged as failure:
                self.iterations += failure.iterations
                reason = failure.reason
                continue
            self.iterations += solution.iterations
            self._shifts = self._shifts[place:]
            return solution
        raise NotConverged(reason, 0)

    def _strided(self, step: float, *, least: float) -> float:
        """``step``, shortened if it moves anything farther than Newton's method takes in its stride.

        Not to less than ``least``: a tangent that runs away, as in a singular position, does not tell how far to go.
        """
        if not self._anchors:
            return step
        motion = self._newton.system.size(self._anchors[-1].tangent) * abs(step)
        shortened = step * min(1.0, STRIDE / max(motion, STRIDE))
        return shortened if abs(shortened) > least else step

    def _scale(self, distance: float) -> float:
        """What steps are small beside: the way gone so far, or the first stride if there is none, whatever the target.

        A limit load is told as closely by a load a thousand times as large as by one just beyond it.
        """
        way = self._way or abs(self._strided(distance, least=_SINGULAR * abs(distance)))
        return min(abs(distance), way)

    def _leapt(self, value: float, solution: Solution) -> bool:
        """Whether a step to ``value`` leads where the tangents at its ends do not (collective).

        The rate of every coordinate over the step should lie between those at its ends, whatever moves elsewhere:

            r = (y₁ − y₀) / (v₁ − v₀),    |r − [y₀′, y₁′]| > 0.2 max(|y₀′|, |y₁′|)

        A path that bends off at a bifurcation moves as √v and r = 2 y₁′, however short the step; the span reaches that
        far. Close to a fold y₀′ tells nothing, as it grows beyond all bounds; the rate of the step before does. A step
        over which the difference of the two would go far is too long to tell.
        """
        if not self._anchors or value == self._value:
            return False
        system, last, distance = self._newton.system, self._anchors[-1], value - self._value
        before = last.tangent if self._rate is None else last.tangent.slower(self._rate)
        rate = system.difference(solution.state, last.state).scaled(1.0 / distance)
        span = (before, solution.tangent, solution.tangent.scaled(_BENT))
        beyond = system.size(system.independent(rate.beyond(span)))
        largest = max(system.size(before), system.size(solution.tangent))
        grown = system.size(last.tangent + before.scaled(-1.0))
        if beyond > max(BEYOND * largest, _LEAST_MOTION / abs(distance)) or grown * abs(distance) > BEYOND * STRIDE:
            return True
        self._rate = rate
        return False

    def _guess(self, value: float) -> State:
        """The prediction at ``value``, a plainer one where it runs away, in the end the last equilibrium."""
        if not self._anchors:
            return self._start
        system, last = self._newton.system, self._anchors[-1].state
        for predictor in (self._predictor, Tangent()):
            guess = predictor.predict(system, self._anchors, value)
            if system.size(system.difference(guess, last)) <= _RUNAWAY:
                return guess
        return last

    def _remember(self, anchor: Anchor) -> None:
        """Keeps the last two equilibria at different values."""
        self._anchors = [*(a for a in self._anchors[-1:] if a.value != anchor.value), anchor]
        self._value = anchor.value
        self._way = max(self._way, abs(anchor.value - self._origin))
