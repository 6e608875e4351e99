"""Arc-length continuation: steps along a path that may turn back in load and in displacement.

An equilibrium is predicted along the tangent y′ and its curvature, corrected in the plane ⟨y₁′, y₂ − y⟩ = 0 through the
prediction y, and accepted if the path turns little enough; steps are as long as its curvature allows. The fallback is
half the step, as long as that is not the shortest one, with plain steps and then, from there on, with those that turn
links. A try is one solve, and one for each of the ``bisections`` if it may go round a corner or jump.

Where other points come to touch an obstacle, the stiffness jumps and the path has a corner. What tells it from a bend
and from a jump to another branch is the step bisected towards the larger turn: a bend turns less in each half, and the
ends of a jump stay apart, while a corner keeps its angle however near its ends are. Both tangents then point along the
chord across it. A path may turn back at a corner, as where a link that only an obstacle holds comes off it: no
equilibrium lies ahead then, however short the step, and the path goes on along the rate against which it would come
back.

Sources: Riks (doi:10.1016/0020-7683(79)90081-7), Crisfield (doi:10.1016/0045-7949(81)90108-5).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from fenicsmech.collective import agreed
from fenicsmech.continuation.stepper import ParabolaPredictor, Stepper, on_cubic
from fenicsmech.equilibrium import (
    ArcLengthControl,
    ArcMetric,
    DisplacementControl,
    EquilibriumPoint,
    EquilibriumSolver,
    FollowedControl,
    LoadFactorControl,
    MotorControl,
    NotConverged,
    State,
    Step,
)
from fenicsmech.errors import DescriptionError, set_options
from fenicsmech.log import logger

_log = logger(__name__)
_AT_END = 1e-10  # of a finish's scale, that counts as its end


@dataclass(frozen=True)
class ArcSteps:
    """Options of arc-length continuation.

    Attributes:
        first: length of the first step; 1 reaches ``until`` if the mechanism is linear.
        largest: the longest step, likewise, in force and in the displacement of its point; where the followed value is
            beyond that linear reach, over its present size: links that come to touch, or to be pulled straight, may
            stiffen a mechanism by orders of magnitude.
        smallest: the shortest step, likewise; if even that fails, the path ends with an error.
        motion: largest motion of a step, in lengths of the mechanism or rad.
        tolerance: of the location of limit points and bifurcations, over the step they lie in.
        turn: angle between the tangents at both ends of a step that step sizes aim at, rad.
        largest_turn: angle above which a step is repeated with a smaller length, unless that is the angle of a corner:
            it jumps to another branch, or cuts off a bend. At most π/2, across which steps cannot be bisected.
        largest_corner: angle, likewise, of a corner where other points come to touch an obstacle.
        gap: between two paths that pass each other, over the step, from which the step is repeated with a smaller
            length; closer ones count as one bifurcation. Between the ends of a corner, likewise.
        bisections: of a step in which the stability changes and the path turns, to tell that gap, and of one with a
            corner.
        first_load: force at which a path starts where nothing but loads holds the mechanism, over that at which a
            linear one is at its end.
        iterations: number per step that step sizes aim at; the last one only determines the stability, and one that
            only shows rounding does not count.
        contact_iterations: the same where other points touch at the end of a step: it hardly depends on its length.

    Raises:
        DescriptionError: a number is not positive, the tolerance not below 1, the largest turn or corner above π/2, or
            the number of iterations not whole.
    """

    first: float = 0.02
    largest: float = 0.05
    smallest: float = 1e-6
    motion: float = 0.1
    tolerance: float = 1e-4
    turn: float = 0.25
    largest_turn: float = 0.9
    largest_corner: float = 0.5 * math.pi
    gap: float = 0.2
    bisections: int = 5
    first_load: float = 1e-3
    iterations: int = 5
    contact_iterations: int = 7

    def __post_init__(self) -> None:
        set_options(
            self, "arc-length steps", below_one=("tolerance",), bisections=1, iterations=1, contact_iterations=1
        )
        for name in ("largest_turn", "largest_corner"):
            if (angle := getattr(self, name)) > 0.5 * math.pi:
                raise DescriptionError(f"{name} of arc-length steps", f"{angle:g} rad is above π/2", "Give π/2 or less")


@dataclass(frozen=True)
class Finish:
    """A quantity that ends a path at ``end``: its value at a point, its rate along the path, its scale, and the
    control that prescribes the end; None if there is none."""

    value: Callable[[EquilibriumPoint], float]
    rate: Callable[[EquilibriumPoint], float]
    end: float
    scale: float
    control: FollowedControl | DisplacementControl | None = None

    def passed(self, before: EquilibriumPoint, after: EquilibriumPoint) -> bool:
        """Whether the end lies between two neighbouring points, or at the second one."""
        a, b, near = self.value(before) - self.end, self.value(after) - self.end, _AT_END * self.scale
        # a path that goes on from an end begins within the tolerance of its location
        return abs(a) > near and (a * b < 0.0 or abs(b) <= near)


def equilibrium_at(solver: EquilibriumSolver, followed: FollowedControl, state: State) -> EquilibriumPoint:
    """The point at an equilibrium, with its tangent by the followed value.

    Raises:
        NotConverged: the KKT matrix is singular.
    """
    at = solver.linearise(state, followed.at(followed.value(solver.system, state)))
    point = at.point((solver.relative(at.residual),), 0)
    return replace(point, tangent=solver.system.settled(point.tangent, state))


def linear_reach(point: EquilibriumPoint, *, value: float | None, conjugate: float | None) -> float:
    """Change of the followed value with which a linear mechanism reaches the first of two changes; infinite if none."""
    speed = abs(point.conjugate_rate)
    return min(abs(value) if value else math.inf, abs(conjugate) / speed if conjugate and speed else math.inf)


def follow_to(
    solver: EquilibriumSolver,
    start: State,
    control: MotorControl | LoadFactorControl,
    steps: ArcSteps,
    *,
    most: int,
    past_turns: bool = False,
) -> tuple[EquilibriumPoint, int, bool]:
    """The equilibrium at the prescribed value, on the path from ``start``, the iterations on the way, and whether the
    path turns back on it.

    Args:
        solver: for the equilibria.
        start: an equilibrium.
        control: of the motors, or of constant loads.
        steps: options of the steps.
        most: number of them.
        past_turns: whether the path may turn back on the way; then the equilibrium is the first stable one.

    Raises:
        NotConverged: the path ends or, unless it may, turns back before, or the steps do not suffice.
    """
    ahead, iterations = control.prescribed - agreed(solver.system.comm, control.value(solver.system, start)), 0
    if not ahead:
        raise NotConverged("the path starts where it is to end", iterations)
    path = ArcLengthStepper(solver, control, start, steps=steps, value=abs(ahead), conjugate=None)
    finish = Finish(path.value, path.value_rate, control.prescribed, abs(ahead))
    begun, turned = path.start.scaled(math.copysign(1.0, ahead)), False
    while most > 0:
        for before, last in path.follow(begun, [finish], most=most):
            iterations, most = iterations + last.iterations, most - 1
            turns = path.value_rate(last) * ahead <= 0.0 or (path.value(last) - path.value(before)) * ahead <= 0.0
            if turns and not past_turns:
                raise NotConverged(f"the path turns back near {path.value(before):.6g}", iterations)
            turned = turned or turns
        if abs(path.value(last) - control.prescribed) > 1e-6 * abs(ahead):
            break
        found = solver.solve(last.state, control)
        iterations += found.iterations
        if not (past_turns and found.unstable_modes):
            return found, iterations, turned
        begun = last
    raise NotConverged(f"the path got to {path.value(last):.6g} in as many steps as it may", iterations)


class ArcLengthStepper(Stepper):
    """Steps along the path through one equilibrium.

    Distances are in units of the arc on which a linear mechanism reaches ``value`` or ``conjugate``.

    Args:
        solver: for the equilibria.
        followed: the control whose value the path is followed by.
        state: an equilibrium that sets the units.
        steps: options of the steps.
        value, conjugate: changes of the followed value and of its conjugate that set the unit of distance; if both are
            given, the one reached first does.

    Attributes:
        start: the point at ``state``; the followed value grows along its tangent.
        metric: of distances.
        length: of the next step.

    Raises:
        NotConverged: the followed value moves nothing, or the KKT matrix is singular.
    """

    def __init__(
        self,
        solver: EquilibriumSolver,
        followed: FollowedControl,
        state: State,
        *,
        steps: ArcSteps,
        value: float | None,
        conjugate: float | None,
    ) -> None:
        system, self.followed, self.steps, self.length = solver.system, followed, steps, steps.first
        self._conjugate_reference = conjugate or math.inf
        point = equilibrium_at(solver, followed, state)
        speed, motion = abs(point.conjugate_rate), math.sqrt(system.mean_product(point.tangent, point.tangent))
        if not followed.moves(system, point.tangent) or not (followed.displaces or value or speed > 0.0):
            raise NotConverged("it moves nothing")
        reach = linear_reach(point, value=value, conjugate=conjugate)
        if math.isinf(reach):
            reach = 0.01 / motion  # neither sets a unit: a motion of 1 % of the mechanism's length, or 0.01 rad, does
        self.metric = ArcMetric(system, followed, reach * motion, reach, reach * speed or math.inf)
        self.start = point.scaled(1.0 / self.metric.norm(point.tangent))
        super().__init__(solver, ParabolaPredictor(self.metric, steps.turn), state)

    # -- points ------------------------------------------------------------------------------------------------

    def value(self, point: EquilibriumPoint) -> float:
        """The followed value, the same on all processes."""
        return agreed(self.system.comm, self.followed.value(self.system, point.state))

    def value_rate(self, point: EquilibriumPoint) -> float:
        """Rate of the followed value along the path."""
        return self.followed.change(point.tangent)

    def correct(self, guess: State, normal: Step, near: EquilibriumPoint) -> EquilibriumPoint:
        """The equilibrium in the plane through ``guess`` across ``normal``, its tangent oriented along that.

        The local parameter is that at ``near``, a nearby equilibrium.
        """
        return self.solver.solve(guess, ArcLengthControl(0.0, self.metric, guess, normal, self.local_parameter(near)))

    def local_parameter(self, near: EquilibriumPoint) -> FollowedControl | DisplacementControl:
        """The control that leaves K regular: of the value or its conjugate, whichever changes more along the path."""
        conjugate = abs(near.conjugate_rate) / self.metric.conjugate
        if self.followed.opposite and conjugate > abs(self.value_rate(near)) / self.metric.value:
            return self.followed.opposite
        return self.followed

    def chord(self, start: EquilibriumPoint, end: EquilibriumPoint) -> Step:
        """Change of state from ``start`` to ``end``, without the turns of links that spin loosely."""
        return self.system.settled_difference(end.state, start.state)

    def along(self, start: EquilibriumPoint, end: EquilibriumPoint) -> float:
        """Distance of ``end`` ahead of ``start`` along the tangent there."""
        return self.metric.dot(start.tangent, self.chord(start, end))

    def between(self, start: EquilibriumPoint, end: EquilibriumPoint, distance: float) -> EquilibriumPoint:
        """The equilibrium ``distance`` ahead of ``start``, predicted on the cubic from there to ``end``."""
        width = self.along(start, end)
        # the rate of the end by the distance along the start's tangent
        rate = end.tangent.scaled(1.0 / self.metric.dot(start.tangent, end.tangent))
        guess = on_cubic(self.system, (start.state, end.state), (start.tangent, rate), width, distance / width)
        return self.correct(guess, start.tangent, start)

    # -- steps -------------------------------------------------------------------------------------------------

    def follow(
        self, start: EquilibriumPoint, finishes: Sequence[Finish], *, most: int
    ) -> Iterator[tuple[EquilibriumPoint, EquilibriumPoint]]:
        """Both ends of each step from ``start`` until a finish is passed, or of ``most`` steps."""
        self._points = [start]
        for _ in range(most):
            point, following = self._points[-1], self._advance()
            ends = [self._end(point, following, finish) for finish in finishes if finish.passed(point, following)]
            if ends:
                following = min(ends, key=lambda end: self.along(point, end))
            yield point, following
            if ends:
                return

    def _advance(self) -> EquilibriumPoint:
        """The next point of the path, as far ahead as its curvature allows."""
        steps, point = self.steps, self._points[-1]
        longest = self._longest(point)
        self.length = min(self.length, longest)
        while True:
            reason = "the path bends too sharply, or another one is too near"
            try:
                found = self.correct(self._predict(self.length), point.tangent, point)
                turn = self._turn(point, found)
                _log.debug("arc %.2e: turn %.2f, %d iterations", self.length, turn, found.iterations)
                touched = self._others_touch(point.touching, found.touching)
                if self._stays_on_path(point, found, turn, touched):
                    iterations = steps.contact_iterations if touched else steps.iterations
                    growth = min(steps.turn / max(turn, 1e-12), math.sqrt(iterations / found.contractions))
                    self.length *= min(max(growth, 0.5), 2.0)
                    self._accept(found, self.metric.norm(self.chord(point, found)))
                    return found
            except NotConverged as failure:
                reason = str(failure)
            self.length *= 0.5
            if self.length < steps.smallest * min(longest / steps.largest, 1.0):
                if (beyond := self._back_from_corner(steps.tolerance * longest)) is not None:
                    self._accept(beyond, self.metric.norm(self.chord(point, beyond)))
                    self.length = steps.first
                    return beyond
                if not self._turn_links():
                    raise NotConverged(reason)
                self.length = longest

    def _turn_links(self) -> bool:
        """Lets steps turn links from now on instead of straining them; whether they did not before."""
        turning = self.solver.turning
        if turning is None:
            return False
        self.solver = turning
        return True

    def _stays_on_path(self, start: EquilibriumPoint, end: EquilibriumPoint, turn: float, touched: bool) -> bool:
        """Whether the path through ``start`` leads to ``end``, with a ``turn`` that steps may have; ``touched`` is
        whether other points touch there."""
        steps = self.steps
        if not turn <= steps.largest_turn:  # NaN where the tangent is lost
            return touched and turn < steps.largest_corner and self._is_corner(start, end)
        # a straight path that goes on straight is the same one
        return turn <= 0.1 * steps.gap or not self._jumps(start, end)

    def _is_corner(self, start: EquilibriumPoint, end: EquilibriumPoint) -> bool:
        """Whether the path turns by more than ``largest_turn`` at one point of the step, at which it is continuous."""
        steps, low, high = self.steps, start, end
        near, far = 0.0, self.along(start, end)
        part = far * 0.5**steps.bisections
        while far - near > 1.5 * part:
            middle = 0.5 * (near + far)
            found = self.between(start, end, middle)
            if self._turn(low, found) > self._turn(found, high):
                high, far = found, middle
            else:
                low, near = found, middle
        apart = self.metric.norm(self.chord(low, high)) / self.metric.norm(self.chord(start, end))
        return steps.largest_turn < self._turn(low, high) < steps.largest_corner and apart <= steps.gap

    def _back_from_corner(self, length: float) -> EquilibriumPoint | None:
        """The point ``length`` beyond a corner just ahead at which the path turns by more than π/2; None if none is.

        Nothing lies ahead of such a corner. With the points that touch beyond it the path would go on along some y′
        there, which leads back among those that touch before it: so it goes on along −y′.
        """
        point = self._points[-1]
        ahead = self.system.moved(point.state, point.tangent.scaled(length))
        if not self._others_touch(point.touching, self.system.touching(ahead)):
            return None
        plane = ArcLengthControl(0.0, self.metric, ahead, point.tangent, self.local_parameter(point))
        try:
            back = self.metric.unit(self.solver.linearise(ahead, plane).point((0.0,), 0).tangent).scaled(-1.0)
            found = self.correct(self.system.moved(point.state, back.scaled(length)), back, point)
        except NotConverged:
            return None
        straight = self.metric.dot(back, found.tangent) >= math.cos(self.steps.turn)
        return found if straight and self._others_touch(point.touching, found.touching) else None

    def _jumps(self, start: EquilibriumPoint, end: EquilibriumPoint) -> bool:
        """Whether another path that comes near, as beside an imperfect bifurcation, is taken in the step.

        The number of unstable modes differs then, and the part of the step in which it changes, bisected, remains as
        long as the gap between the paths, far longer than its part of the tangent. Gaps far below the step are those of
        a mesh that is not quite symmetric; such steps go on along the path that would be straight without them.
        """
        if start.unstable_modes == end.unstable_modes or self.followed.displaces:
            return False
        if self.value_rate(start) * self.value_rate(end) < 0.0:
            return False  # a limit point
        low, high = start, end
        near, far = 0.0, self.along(start, end)
        part = far * 0.5**self.steps.bisections
        while far - near > 1.5 * part:
            middle = 0.5 * (near + far)
            found = self.between(start, end, middle)
            if found.unstable_modes == start.unstable_modes:
                low, near = found, middle
            else:
                high, far = found, middle
        return self.metric.norm(self.chord(low, high)) > self.steps.gap * self.metric.norm(self.chord(start, end))

    def _longest(self, point: EquilibriumPoint) -> float:
        """The longest arc within the limits on the value, its conjugate and motions."""
        size = max(self.metric.value, abs(self.value(point)))
        rates = (
            abs(self.value_rate(point)) / (self.steps.largest * size),
            abs(point.conjugate_rate) / (self.steps.largest * self._conjugate_reference),
            self.system.size(point.tangent) / self.steps.motion,
        )
        return 1.0 / max(rates)

    def _turn(self, a: EquilibriumPoint, b: EquilibriumPoint) -> float:
        """Largest angle between the tangents at both points and the chord."""
        chord, dot = self.metric.unit(self.chord(a, b)), self.metric.dot
        cosine = min(dot(a.tangent, b.tangent), dot(a.tangent, chord), dot(chord, b.tangent))
        return math.acos(min(max(cosine, -1.0), 1.0))

    def _end(self, before: EquilibriumPoint, after: EquilibriumPoint, finish: Finish) -> EquilibriumPoint:
        """The point with the finish's value, or the nearest found, by Newton's method within the step.

        Tolerance: within 1e-10 of the finish's scale and 1e-8 of the change over the step. Where rounding scatters
        points by more than that, the value is prescribed.
        """
        width = self.along(before, after)
        low, high = 0.0, width
        change = finish.value(after) - finish.value(before)
        near, rising = min(_AT_END * finish.scale, 1e-8 * abs(change)), change > 0.0
        distance, best = width, after
        for _ in range(30):
            gap = finish.value(best) - finish.end
            if abs(gap) <= near:
                break
            low, high = (low, distance) if (gap > 0.0) == rising else (distance, high)
            if not low < high:  # just short of the end
                break
            slope = finish.rate(best) / self.metric.dot(before.tangent, best.tangent)
            wanted = distance - gap / slope if slope else low
            distance = wanted if low < wanted < high else 0.5 * (low + high)
            try:
                best = self.between(before, after, distance)
            except NotConverged:
                break
        if abs(finish.value(best) - finish.end) > near:
            best = self._prescribed(before, best, finish, self.steps.gap * width)
        reached = finish.value(best)
        if abs(reached - finish.end) > 1e-6 * abs(change):
            _log.warning("the path ends at %g, not at %g: no equilibrium was found there", reached, finish.end)
        return best

    def _prescribed(
        self, before: EquilibriumPoint, near: EquilibriumPoint, finish: Finish, farthest: float
    ) -> EquilibriumPoint:
        """The point at which the finish's control prescribes its end; ``near`` if there is none, or only ``farthest``
        away."""
        if finish.control is None:
            return near
        try:
            found = self.solver.solve(near.state, finish.control)
            if self.metric.norm(self.chord(near, found)) > farthest:
                return near
            plane = ArcLengthControl(0.0, self.metric, found.state, before.tangent, self.local_parameter(near))
            return self.solver.linearise(found.state, plane).point(found.residuals, found.iterations)
        except NotConverged:
            return near
