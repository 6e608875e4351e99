"""Load steps (natural continuation): from a known equilibrium to the wanted value of a control.

An equilibrium is predicted from those before, corrected, and accepted. Steps halve when the solver fails, go most of
the way to a fold once it is seen ahead, and double when it took few iterations; the tangent bounds their motion;
the way to another value begins at the nearest of the first, the last and the outermost of those asked for. Stepping
fails once steps are small relative to the distance covered, however far the prescribed value: the softest stiffness
falls as √(1 − p / p*) towards a limit load p*, and the last equilibrium, at p* − 2 p* / 1024 or nearer, keeps at most 5
% of it. A step that moves a coordinate outside the range of the tangents at its ends may have snapped over a fold,
where the path turns back: it is halved too, and if that does not help the snap is accepted and counted. Where other
points touch obstacles the tangent changes at once: steps then take up the whole distance again, unless they had to be
halved, and equilibria beyond what looked like a snap, but may be such a kink, are kept until steps come near.

Where an equilibrium is not found at once, fallbacks follow in this order. All of them are bounded by counts, which are
the same on all processes and machines, and not by time:

    fallback                                                   ends after
    1. the tangent's prediction, then the last equilibrium,    one each; where other points touch, the latter at once;
       where a prediction moves too far or inverts elements    ``LoadSteps.failures_inverted``
    2. shifts of the KKT matrix until steps descend            ``PrimalDualNewton.shifts`` an iteration
    3. shorter steps where elements are inverted               its ``halvings_inverted`` an iteration
    4. line search, from the best state so far                 its ``iterations`` and ``factorisations``, with 2 and 3
    5. other least shifts of zero-energy modes; not where      ``LoadSteps.shift_factors``, a solve each, or two that
       links stretch straight and a value has failed, nor      fail alike
       once an equilibrium past a fold is known
    6. steps that turn links (``equilibrium.turning``), 1 to   as these; the kind that led to the last equilibrium
       5, or those that do not; likewise                       comes first
    7. half the step                                           ``LoadSteps.smallest``, ``smallest_snap_step`` once an
                                                               equilibrium past a fold is known, or one of the
                                                               numbers of ``failures``
    8. the nearest equilibrium found past a fold, a snap; or   one; or solves ``snap_iterations`` times as long, one or
       that of a longer solve, or of one for the value asked   two
       for: just past a fold what is not in balance can be
       rounding; or the nearest of those kept under contact
    9. of motors and constant loads: links that strain         halvings down to ``LoadSteps.smallest``, or one that
       beyond a dead centre (``dead_centre``)                  fails after one that did not; then load steps once more
    10. of motors: the path by arc length, which load steps    ``LoadSteps.arc_steps``, or where it turns back
       may have left at a corner
    11. of constant loads: solves from the rigid pose in       ``RestSearch.steps``, and a step of these
       which they balance with springs; first of all where
       these are softer than the rounding of stiff links
    12. of motors and constant loads: descent to an            seven solves, ``LoadSteps.snap_iterations`` times as
       equilibrium after a snap, and load steps from there    long, and as these
    13. of constant loads: the path by arc length from half    ``LoadSteps.arc_steps``
       of those reached, past its turns, to the first
       stable equilibrium under all
    14. of curves that have snapped: load steps from rest to    as these
       the value, whose path may go on where that snapped
       to ends
    15. of forces that nothing resists: links move as rigid    four moves, a solve each, from both
       bodies to where loads balance, as at an obstacle: from
       the rigid pose in which all do, then the last one;
       after ``failures_falling`` where the first force
       prefers no pose
    16. of forces beside large reactions: likewise, where       as these
       motions that deform no link are out of balance; 15
       where they stay so and nothing else resists

Then the last equilibrium and the values without one are reported. The control stays the one that was asked for: under
a dead load the equilibria past a limit point are not those that the mechanism would take.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fenicsmech.collective import agreed
from fenicsmech.continuation.stepper import Predictor, Stepper, TangentPredictor
from fenicsmech.equilibrium import (
    Control,
    EquilibriumPoint,
    EquilibriumSolver,
    InvertedGuess,
    NotConverged,
    State,
    Step,
)
from fenicsmech.errors import not_negative, set_fields, set_options
from fenicsmech.log import logger

_log = logger(__name__)


@dataclass(frozen=True, kw_only=True)
class LoadSteps:
    """Options of load steps; motions are in lengths of the mechanism, or rad.

    Attributes:
        smallest: smallest step, over the distance to the end, or that from the start if it is less.
        motion: largest motion of a step along the tangent (measured).
        failures: steps in a row without equilibrium after which stepping fails: halved as often, a step is 1e-12 of
            itself. Those before an equilibrium that was reached do not count.
        failures_held: likewise where joints and motors hold the point that is to move; and ``failures_hidden`` where
            links can move without deforming.
        failures_falling: likewise where links first move as rigid bodies to where something resists.
        failures_hidden: to one value, in a row or not, after which stepping fails where the rounding of stiff links
            hides what resists; not where the path is seen to turn back, whose load is found as closely as others.
        failures_inverted: steps in a row without equilibrium, of which the last one's prediction inverts elements,
            after which steps to the value begin at the last equilibrium.
        smallest_limited: smallest step that ``motion`` may impose, over the distance to the end; smaller ones arise
            in singular positions, where the tangent is ignored.
        largest_prediction: motion above which a prediction is discarded.
        contact_residual: of a prediction in which other points touch, over that of the last equilibrium, above which
            it is discarded. Between 10 and 100 iterations are the same.
        iterations: after as many or fewer in a step, the next one is twice as long.
        steady: steps of one length after which the next one is as well: iterations may not depend on it.
        deviation: of the rate over a step from the tangents at its ends, over the largest rate, that counts as a snap;
            that of kinks is smaller.
        branching_rate: largest rate of a step off a bifurcation, over the rate at its end.
        smallest_snap: smallest motion that counts as a snap; that at bifurcations is smaller.
        smallest_snap_step: smallest step, measured like ``smallest``, that is halved because of a snap, or where the
            equilibrium beyond one is known.
        fold_growth: growth of the tangent over the last step from which the path counts as turning back.
        fold_ahead: largest distance ahead at which it does, over the last step that failed.
        approach: part of the way to a fold that a step goes at most: three quarters leave half of the motion.
        minimum_shift: least shift of the KKT matrix, in units of links' stiffness, where a mechanism has zero-energy
            modes, which would leave it singular.
        shift_factors: of ``minimum_shift``, tried in order: a shift slows Newton's method down where soft springs or
            forces hold zero-energy modes with a smaller stiffness.
        arc_steps: most arc-length steps of motors, and of constant loads.
        snap_iterations: most iterations of one solve for where a mechanism snaps to, over the solver's: descent leads
            far.

    Raises:
        DescriptionError: a number is not positive, a factor is negative, or the number of iterations not whole.
    """

    smallest: float = 1.0 / 1024.0
    motion: float = 0.2
    failures: int = 40
    failures_held: int = 8
    failures_falling: int = 2
    failures_hidden: int = 3
    failures_inverted: int = 8
    smallest_limited: float = 1e-6
    largest_prediction: float = 1.0
    contact_residual: float = 10.0
    iterations: int = 5
    steady: int = 16
    deviation: float = 0.2
    branching_rate: float = 2.2
    smallest_snap: float = 1e-4
    smallest_snap_step: float = 1.0 / 64.0
    fold_growth: float = 1.1
    fold_ahead: float = 4.0
    approach: float = 0.75
    minimum_shift: float = 1e-10
    shift_factors: tuple[float, ...] = (1.0, 1e-3, 0.0)
    arc_steps: int = 300
    snap_iterations: int = 4

    def __post_init__(self) -> None:
        set_options(
            self,
            "load steps",
            failures=1,
            failures_held=1,
            failures_falling=1,
            failures_hidden=1,
            failures_inverted=1,
            iterations=1,
            steady=1,
            arc_steps=1,
            snap_iterations=1,
        )
        factors = tuple(not_negative("shift factor of load steps", factor) for factor in self.shift_factors)
        set_fields(self, shift_factors=factors)

    def least_shifts(self, largest: float, *, loads_resist: bool = False) -> LeastShifts:
        """Multiples of ``largest`` by ``shift_factors``; smallest first away from the start if ``loads_resist``.

        There the prescribed value itself resists all zero-energy modes, which a shift would hide.
        """
        falling = tuple(factor * largest for factor in self.shift_factors) if largest else (0.0,)
        return LeastShifts(falling, falling[::-1] if loads_resist else falling)


@dataclass(frozen=True)
class LeastShifts:
    """Least shifts of the KKT matrix, in the order in which they are tried, in units of the links' stiffness.

    Attributes:
        at_start: at the value at which steps begin.
        elsewhere: at others.
    """

    at_start: tuple[float, ...]
    elsewhere: tuple[float, ...]


class LoadStepsFailed(Exception):
    """Load stepping ended before the prescribed value.

    Attributes:
        last: the last equilibrium reached, or None.
        reached: its control value.
        reason: the solver's message.
        tried: control values without equilibrium.
        fold: the control value at which the path turns back, None if it does not.
        hidden: whether the rounding of stiff links hides what resists at the last equilibrium.
        straight: whether reactions grow far more than motions over the last step, as where links stretch straight.
    """

    def __init__(
        self,
        last: EquilibriumPoint | None,
        reached: float,
        reason: str,
        tried: tuple[float, ...],
        *,
        fold: float | None = None,
        hidden: bool = False,
        straight: bool = False,
    ) -> None:
        super().__init__(reason)
        self.last, self.reached, self.reason, self.tried = last, reached, reason, tried
        self.fold, self.hidden, self.straight = fold, hidden, straight


@dataclass
class _Way:
    """Load steps on the way to one prescribed value.

    Attributes:
        control: with the value.
        distance: of it from where the way begins.
        step: the next one.
        most: failures in a row after which stepping fails.
        patient: whether a longer solve was tried, or is not to be.
        failed: steps since the last equilibrium.
        tried: values without one.
        inverts: whether predictions invert elements.
        beyond: the nearest equilibrium that was found past a fold.
        aside: under contact, where kinks look like snaps, equilibria beyond, by their values.
        halved: whether steps were.
        steady: steps since one was halved or doubled.
    """

    control: Control
    distance: float
    step: float
    most: int
    patient: bool
    failed: int = 0
    tried: list[float] = field(default_factory=list)
    inverts: bool = False
    beyond: EquilibriumPoint | None = None
    aside: dict[float, EquilibriumPoint] = field(default_factory=dict)
    halved: bool = False
    steady: int = 0


class LoadStepper(Stepper):
    """Follows equilibria as the prescribed value of one control changes.

    Args:
        solver: for the equilibria.
        start: first guess of the equilibrium at which steps begin; the control's value there is the first one.
        control: whose prescribed value changes.
        predictor: of the next equilibrium.
        shifts: for zero-energy modes; by default those of the start's least shift, the largest first.
        steps: options; the default ones if left out.

    Attributes:
        iterations: KKT systems factored and solved so far.
        snaps: number of times the path turned back and an equilibrium on another one was reached.
    """

    def __init__(
        self,
        solver: EquilibriumSolver,
        start: State,
        control: Control,
        *,
        predictor: Predictor,
        shifts: LeastShifts | None = None,
        steps: LoadSteps | None = None,
    ) -> None:
        super().__init__(solver, predictor, start)
        self._steps, self._plain = steps or LoadSteps(), solver
        self._shifts = shifts or self._steps.least_shifts(start.minimum_shift)
        self._value = agreed(solver.system.comm, control.value(solver.system, start))
        self._origin = self._value
        self._rate: Step | None = None  # of the last step, by the control value
        # on the path of the last one: at the start, and at the least and the greatest of the values asked for since
        self._passed: list[EquilibriumPoint] = []
        self.iterations = self.snaps = 0

    def advance(self, control: Control, *, failures: int | None = None) -> EquilibriumPoint:
        """The equilibrium at ``control``'s prescribed value, reached in as many steps as needed.

        Args:
            control: with the value.
            failures: in a row after which stepping fails at once, if fewer than by the options.

        Raises:
            LoadStepsFailed: the smallest step failed, or too many.
            EquilibriumError: a potential does not hold for a step.
        """
        if not self._points:
            self._settle(control.at(self._value))
        self._return_towards(control.prescribed)
        distance = control.prescribed - self._value
        most = self._steps.failures if failures is None else min(failures, self._steps.failures)
        way = _Way(control, distance, step=distance, most=most, patient=failures is not None)
        while True:
            point, snapped = self._next(way)
            if snapped:
                self.snaps += 1
                self._rate, self._passed = None, []
                _log.warning(
                    "between %g and %g the path turns back; the next equilibria are on another one",
                    self._value,
                    point.control.prescribed,
                )
            changed = bool(self._points) and self._others_touch(self._points[-1].touching, point.touching)
            way.step = point.control.prescribed - self._value
            self._accept_at(point, snapped=snapped)
            if self._value == control.prescribed:
                self._remember(point)
                return point
            way.failed, way.beyond, way.steady = 0, None, way.steady + 1
            if changed and not way.halved:
                way.step = control.prescribed - self._value
            elif point.iterations <= self._steps.iterations or way.steady >= self._steps.steady:
                way.step, way.steady = 2.0 * way.step, 0

    def _next(self, way: _Way) -> tuple[EquilibriumPoint, bool]:
        """The next equilibrium on the way, and whether it is beyond a snap.

        Raises:
            LoadStepsFailed: the smallest step failed, or too many.
        """
        while True:
            value = self._value_ahead(way)
            control = way.control.at(value)
            try:
                point = way.aside.pop(value, None) or self._tried(way, control)
                snapped = self._snapped(point)
            except NotConverged as failure:
                if (found := self._after(way, control, failure)) is None:
                    continue
                return found, found is way.beyond or self._snapped(found)
            if not snapped or abs(value - self._value) <= self._steps.smallest_snap_step * self._scale(way.distance):
                return point, snapped
            way.step, way.beyond, way.halved, way.steady = 0.5 * (value - self._value), point, True, 0
            if self.system.contact is not None:
                way.aside[value] = point

    def _value_ahead(self, way: _Way) -> float:
        """The value a step ahead, the prescribed one if that is no farther.

        Once a value has failed, steps go a part of the way to a fold that is seen. The last one, as small as any, ends
        beyond.
        """
        remaining = way.control.prescribed - self._value
        step = self._limited(way.step, way.distance)
        fold = self._fold(self._value + step) if way.tried and way.beyond is None else None
        if fold is not None and abs(fold - self._value) < abs(step):
            least = 1.5 * self._steps.smallest * self._scale(way.distance)  # half of it is none any more
            ahead = max(self._steps.approach * abs(fold - self._value), least)
            step = math.copysign(min(abs(step), ahead), step)
        return way.control.prescribed if abs(step) >= abs(remaining) * (1.0 - 1e-9) else self._value + step

    def _tried(self, way: _Way, control: Control) -> EquilibriumPoint:
        """The equilibrium at the value of ``control``, from a prediction; by one solve where one beyond is known, or
        where links stretch straight and a value has failed."""
        guess = self._last.state if way.inverts and self._last else self._guess(control)
        brief = way.beyond is not None or (self._failed(control.prescribed, way.tried) and self._straight)
        return self._correct(guess, control, brief=brief)

    def _after(self, way: _Way, control: Control, failure: NotConverged) -> EquilibriumPoint | None:
        """The equilibrium taken where the value of ``control`` has none, once steps are not halved any more; else None.

        Raises:
            LoadStepsFailed: there is none.
        """
        steps, step = self._steps, 0.5 * (control.prescribed - self._value)
        way.tried.append(control.prescribed)
        way.failed, way.halved, way.step, way.steady = way.failed + 1, True, step, 0
        way.inverts |= isinstance(failure, InvertedGuess) and way.failed >= steps.failures_inverted
        smallest = steps.smallest if way.beyond is None else steps.smallest_snap_step
        ended = abs(step) <= smallest * self._scale(way.distance) or way.failed >= way.most
        hidden, many = False, len(way.tried) >= steps.failures_hidden and self._fold(control.prescribed) is None
        if many or (ended and way.beyond is None):
            hidden = self._plain.hides(self._last.state if self._last else self._start, control.at(self._value))
        if not (ended or hidden):
            return None
        if way.beyond is not None:
            return way.beyond
        longer, way.patient = not way.patient, True
        try:
            return self._beyond_steps(control, way.control, failure, way.tried, hidden, longer=longer)
        except LoadStepsFailed:
            ahead = [value for value in way.aside if (value - self._value) * step > 0.0]
            if not ahead:
                raise
        way.beyond = way.aside.pop(min(ahead, key=lambda value: abs(value - self._value)))
        return way.beyond

    @property
    def _last(self) -> EquilibriumPoint | None:
        return self._points[-1] if self._points else None

    def _fold(self, tried: float) -> float | None:
        """The value v* at which the path turns back, if it does before ``tried`` or about there.

        Tangents grow towards a fold, |y′| ~ 1 / √(v* − v). From those at the last two points,

            v* = v₁ + (v₁ − v₀) / (g² − 1),     g = |y₁′| / |y₀′|.

        Where links stretch straight nothing turns back.
        """
        growth, stretches = self._growth()
        if growth <= self._steps.fold_growth or stretches:
            return None
        ahead = self._width / (growth**2 - 1.0)
        return self._value + ahead if 0.0 < ahead / (tried - self._value) <= self._steps.fold_ahead else None

    @property
    def _straight(self) -> bool:
        """Whether links stretch straight, beyond which no force gets."""
        growth, stretches = self._growth()
        return stretches and growth > self._steps.fold_growth

    def _failed(self, value: float, tried: Sequence[float]) -> bool:
        """Whether one of the values ``tried`` is at ``value``, or before."""
        return any(abs(own - self._value) <= abs(value - self._value) for own in tried)

    def _growth(self) -> tuple[float, bool]:
        """How the tangent has grown over the last step, g; whether the conjugate's rate has by more than g², as where
        links stretch straight."""
        if len(self._points) < 2:
            return 1.0, False
        before, last = (self.system.size(point.tangent) for point in self._points)
        growth = last / before if before else 1.0
        rates = agreed(self.system.comm, [abs(point.conjugate_rate) for point in self._points])
        return growth, not rates[1] <= growth**2 * rates[0]

    def _settle(self, control: Control) -> None:
        """The equilibrium at the start, whose tangent limits the first step."""
        try:
            point = self._correct(self._start, control)
        except NotConverged:
            return
        self._accept_at(point)
        self._remember(point)

    def _remember(self, point: EquilibriumPoint) -> None:
        """Keeps the equilibrium at a value asked for, at which steps may begin, if it is the first or the outermost."""
        start, *others = [*self._passed, point]
        others.sort(key=lambda other: other.control.prescribed)
        self._passed = [start, *others[:1], *others[1:][-1:]]

    def _return_towards(self, value: float) -> None:
        """Steps begin at the equilibrium nearest to ``value`` of those that the path came through, without a step."""
        if not self._passed:
            return
        nearest = min(self._passed, key=lambda point: abs(point.control.prescribed - value))
        if abs(nearest.control.prescribed - value) < abs(self._value - value):
            self._points, self._value = [nearest], nearest.control.prescribed
            self._width, self._rate = 0.0, None

    def _correct(self, guess: State, control: Control, *, brief: bool = False) -> EquilibriumPoint:
        """The equilibrium near ``guess``, by steps of the kind that led to the last one, else by the other kind;
        ``brief``: by one solve."""
        try:
            return self._shifted(guess, control, brief)
        except InvertedGuess:
            raise
        except NotConverged:
            other = self.solver.turning or self._plain
            if other is self.solver or brief:
                raise
        last, self.solver = self.solver, other
        try:
            return self._shifted(guess, control)
        except NotConverged:
            self.solver = last
            raise

    def _beyond_steps(
        self,
        control: Control,
        asked: Control,
        failure: NotConverged,
        tried: Sequence[float],
        hidden: bool,
        *,
        longer: bool,
    ) -> EquilibriumPoint:
        """The equilibrium that more iterations lead to from the last one, where steps end.

        Args:
            control: at the value of the last step that failed, tried unless what resists is ``hidden``.
            asked: at the end of all steps, tried then and past a fold: just past one what is not in balance can be
                rounding.
            failure, tried, hidden: of these steps, see ``LoadStepsFailed``.
            longer: whether a longer solve is tried.

        Raises:
            LoadStepsFailed: there is none.
        """
        fold = self._fold(tried[-1])
        if longer and self._last is not None:
            plain = fold is None and not hidden
            descending = self.solver if plain else self.solver.turning or self.solver  # turns lead far
            for own in [asked] if hidden else [control] if plain else self._past_fold(control, asked):
                try:
                    point = descending.patient(self._steps.snap_iterations).solve(self._last.state, own)
                except NotConverged as ended:
                    self.iterations += ended.iterations
                else:
                    self.iterations += point.iterations
                    return point
        raise LoadStepsFailed(
            self._last, self._value, failure.reason, tuple(tried), fold=fold, hidden=hidden, straight=self._straight
        ) from failure

    def _past_fold(self, control: Control, asked: Control) -> list[Control]:
        """The controls under which equilibria past a fold are looked for, in turn, see ``_beyond_steps``."""
        return [control] if control.prescribed == asked.prescribed else [control, asked]

    def _shifted(self, guess: State, control: Control, brief: bool = False) -> EquilibriumPoint:
        """The equilibrium near ``guess``, with the first shift for zero-energy modes that leads there; ``brief``: with
        the first one.

        Two that fail alike show that shifts make no difference.
        """
        at_start = control.prescribed == self._origin
        shifts = self._shifts.at_start if at_start else self._shifts.elsewhere
        failed: tuple[str, int] | None = None
        for place, shift in enumerate(shifts):
            try:
                point = self.solver.solve(replace(guess, minimum_shift=shift), control)
            except InvertedGuess:
                raise
            except NotConverged as failure:
                self.iterations += failure.iterations
                before, failed = failed, (failure.reason, failure.iterations)
                if brief or failed == before:
                    break
                continue
            self.iterations += point.iterations
            left = {"at_start" if at_start else "elsewhere": shifts[place:]}  # the others would fail again
            self._shifts = replace(self._shifts, **left)
            return point
        assert failed is not None, "there is a shift"
        raise NotConverged(*failed)

    def _guess(self, control: Control) -> State:
        """The prediction; the last equilibrium where the prediction runs into obstacles, or comes off them."""
        guess = self._predict(control.prescribed - self._value)
        if not self._points:
            return guess
        last = self._points[-1]
        return last.state if self._leaves_contact(last, guess, control) else guess

    def _predict(self, ahead: float) -> State:
        """The prediction; where it moves too far that of the tangent, then the last equilibrium."""
        if not self._points:
            return self._start
        system, last = self.system, self._points[-1].state
        for predictor in (self.predictor, TangentPredictor()):
            guess = predictor.predict(system, self._points, self._width, ahead)
            if system.size(system.difference(guess, last)) <= self._steps.largest_prediction:
                return guess
        return last

    def _leaves_contact(self, last: EquilibriumPoint, guess: State, control: Control) -> bool:
        """Whether other points touch in ``guess`` than in ``last``, and its residual under ``control`` is far larger.

        The tangent holds as long as the same points touch. Elsewhere the first step from the last equilibrium, with
        gaps linearised, is the prediction that keeps links outside obstacles.
        """
        if not self._others_touch(last.touching, self.system.touching(guess)):
            return False
        norms = []
        for state in (control.prepare(last.state), control.prepare(guess)):
            self.system.load(state)
            norms.append(self.system.residual(state, control).norm)
        return not norms[1] <= self._steps.contact_residual * norms[0]  # NaN where elements are inverted

    def _limited(self, step: float, distance: float) -> float:
        """``step``, shortened to the largest ``motion`` unless that would leave too little of the ``distance``."""
        if not self._points:
            return step
        motion = self.system.size(self._points[-1].tangent) * abs(step)
        limited = step * min(1.0, self._steps.motion / max(motion, self._steps.motion))
        return limited if abs(limited) > self._steps.smallest_limited * abs(distance) else step

    def _scale(self, distance: float) -> float:
        """Reference length of steps: the distance from the start, there the first step, whatever the end.

        So a prescribed load a thousand times the limit load locates it as closely as one just beyond it. To a value
        that is the first one but for rounding nothing is covered: no step is as small.
        """
        covered = abs(self._value - self._origin)
        if covered <= 0.5**self._steps.failures * abs(distance):
            covered = abs(self._limited(distance, distance))
        return min(abs(distance), covered)

    def _snapped(self, point: EquilibriumPoint) -> bool:
        """Whether the rate of the step to ``point`` lies outside the range of the tangents at its ends.

        The rate of every coordinate over the step should lie between those at its ends, whatever moves elsewhere:

            r = (y₁ − y₀) / (v₁ − v₀),    |r − [y₀′, y₁′]| > 0.2 max(|y₀′|, |y₁′|)

        A path that bends off at a bifurcation moves as √v and r = 2 y₁′, however short the step; the span includes
        that. Close to a fold y₀′ grows beyond all bounds and is replaced by the rate of the step before. A step over
        which the two differ by a large motion is too long to judge.
        """
        distance = point.control.prescribed - self._value
        if not self._points or distance == 0.0:
            return False
        system, last, steps = self.system, self._points[-1], self._steps
        before = last.tangent if self._rate is None else last.tangent.slower(self._rate)
        rate = system.difference(point.state, last.state).scaled(1.0 / distance)
        beyond = self._beyond(rate, (before, point.tangent, point.tangent.scaled(steps.branching_rate)), point)
        largest = max(system.size(before), system.size(point.tangent))
        grown = system.size(last.tangent + before.scaled(-1.0)) * abs(distance)
        if (
            beyond > max(steps.deviation * largest, steps.smallest_snap / abs(distance))
            or grown > steps.deviation * steps.motion
        ):
            return True
        self._rate = rate
        return False

    def _beyond(self, rate: Step, span: tuple[Step, ...], point: EquilibriumPoint) -> float:
        """Distance of ``rate`` to ``point`` from the ``span`` of others, where the motion is independent."""
        return self.system.size(self.system.independent(rate.beyond(span), point.state))

    def _accept_at(self, point: EquilibriumPoint, *, snapped: bool = False) -> None:
        """Keeps ``point``, at the value of its control, and the one before unless that is on another path."""
        self._accept(point, 0.0 if snapped else point.control.prescribed - self._value)
        self._value = point.control.prescribed
