"""Arc-length continuation: equilibria along a path that may turn back in load and in displacement.

The parameter p is an unknown, and a plane across the path takes its equation's place:

    R(y, p) = 0,    ⟨n, (y, p) − (y, p)_guess⟩ = 0,      KKT x₀ = −R,  KKT x₁ = rate of the control's target,
    x = x₀ + τ x₁,  τ = −⟨n, (y, p) + x₀ − guess⟩ / ⟨n, x₁⟩.

The plane never needs a row of the matrix. KKT holds whichever changes more along the path, the load or the
displacement of its point, so that it is regular at limit points of the other. Sources: Riks
(doi:10.1016/0020-7683(79)90081-7), Crisfield (doi:10.1016/0045-7949(81)90108-5), and for the choice of the control
Rheinboldt & Burkardt (doi:10.1145/357456.357460).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.lead import Heading, Lead
from fenicsmech.equilibrium.solver import Iteration, NotConverged, Solution
from fenicsmech.equilibrium.state import State
from fenicsmech.equilibrium.system import Balance, EquilibriumSystem
from fenicsmech.errors import DescriptionError
from fenicsmech.log import logger
from fenicsmech.mechanism.checks import positive

_log = logger(__name__)
_TURN = 0.25  # rad between the tangents at both ends of a step that is as long as it should be
_LARGEST_TURN = 0.9  # rad; more is a jump to another branch, or a bend that was cut off
_ITERATIONS = 4  # of a step as long as it should be
_MOST_ITERATIONS = 10
_DIVERGED = 1e3  # growth of the residual
_SMALL_MOTION = 0.01  # in lengths of the mechanism or rad: what is of interest if nothing else is said


@dataclass(frozen=True)
class ArcSteps:
    """How finely a path is followed.

    Attributes:
        first: length of the first step; 1 is as far as ``until`` would be if the mechanism were linear.
        largest: the longest step, likewise, in force and in the displacement of its point.
        smallest: the shortest step, likewise; where even that fails the path ends with an error.
        motion: how far a step may move anything, in lengths of the mechanism or rad.
        tolerance: how closely limit points and bifurcations are located, as a part of the step they lie in.

    Raises:
        DescriptionError: a length is not positive, or the tolerance not between 0 and 1.
    """

    first: float = 0.02
    largest: float = 0.05
    smallest: float = 1e-6
    motion: float = 0.1
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("first", "largest", "smallest", "motion", "tolerance"):
            positive(f"{name} of arc-length steps", getattr(self, name))
        if not self.tolerance < 1.0:
            raise DescriptionError(
                "tolerance of arc-length steps", f"{self.tolerance:g} is not below 1", "Give a part of a step, as 1e-4"
            )


@dataclass(frozen=True)
class ArcMetric:
    """⟨a, b⟩ of headings: mean squares of motion and parameter, each over its reference.

    Attributes:
        system: whose unknowns are compared.
        motion: reference of displacement over the mechanism's length, and of rotation.
        parameter: reference of the path's parameter.
        travel: reference of the displacement of the controlled force's point.
    """

    system: EquilibriumSystem
    motion: float
    parameter: float
    travel: float

    def dot(self, a: Heading, b: Heading) -> float:
        """⟨a, b⟩ (collective)."""
        return mean_product(self.system, a, b) / self.motion**2 + a.parameter * b.parameter / self.parameter**2

    def norm(self, a: Heading) -> float:
        """√⟨a, a⟩ (collective)."""
        return math.sqrt(self.dot(a, a))

    def unit(self, a: Heading) -> Heading:
        """``a`` scaled to norm one (collective)."""
        return a.scaled(1.0 / self.norm(a))


def metric_at(
    newton: Iteration, lead: Lead, state: State, *, floor: float, parameter: float | None, travel: float | None
) -> ArcMetric:
    """The metric in which a linear mechanism would go one unit until it is where the path shall lead (collective).

    Args:
        newton: the solver.
        lead: the path's parameter.
        state: the equilibrium the path starts from.
        floor: least shift of the tangent.
        parameter: change of the parameter that is of interest, or
        travel: change of the displacement of the controlled force's point; of two, the one that is reached first.

    Raises:
        NotConverged: the parameter moves nothing.
    """
    system, control = newton.system, lead.holding(state)
    system.load(state)
    newton.factor(state, control, system.balance(state, control), floor)
    x = newton.solve_linear(control.rate(system, state))
    rate, speed = lead.heading(system.step(x), control), abs(system.force_rate(state).dot(x))
    motion = math.sqrt(mean_product(system, rate, rate))
    if not motion > 0.0 or (parameter is None and not speed > 0.0):
        raise NotConverged("it moves nothing", 0)
    reach = min(abs(parameter) if parameter else math.inf, abs(travel) / speed if travel and speed else math.inf)
    if math.isinf(reach):
        reach = _SMALL_MOTION / motion
    return ArcMetric(system, reach * motion, reach, reach * speed)


def mean_product(system: EquilibriumSystem, a: Heading, b: Heading) -> float:
    """Mean product of two motions of free nodes and bodies, displacements over the mechanism's length (collective)."""
    comm, joints = system.layout.comm, system.joints
    free = system.layout.free[: system.layout.free_displacements]
    own = np.array([float(a.step.u[free] @ b.step.u[free]) / joints.length**2, float(len(free))])
    nodes, count = comm.allreduce(own)
    bodies = float(np.sum(a.step.z * b.step.z / joints.pose_scale**2))
    return nodes / max(count, 1.0) + bodies / max(len(a.step.z), 1)


@dataclass(frozen=True)
class PathPoint:
    """An equilibrium on a path.

    Attributes:
        state: the equilibrium.
        tangent: the path's direction there, of norm one.
        travel: rate of the controlled point's displacement along it.
        unstable_modes: directions in which the energy has a maximum while the parameter is held.
        unstable_under_control: the same while the displacement of the controlled point is held.
        iterations: KKT systems factored on the way.
        residuals: relative residual before each iteration and at the end.
    """

    state: State
    tangent: Heading
    travel: float
    unstable_modes: int
    unstable_under_control: int
    iterations: int
    residuals: tuple[float, ...]

    def reversed(self) -> PathPoint:
        """The same equilibrium, on the way back."""
        return replace(self, tangent=self.tangent.scaled(-1.0), travel=-self.travel)

    def solution(self) -> Solution:
        """The same as an equilibrium that was asked for."""
        return Solution(
            self.state,
            self.residuals,
            self.iterations,
            self.unstable_modes,
            self.unstable_under_control,
            self.tangent.step,
        )


class ArcLength:
    """Follows one path (all methods are collective).

    Args:
        newton: the solver.
        lead: the path's parameter.
        metric: what steps are measured in.
        steps: how finely.
        floor: least shift of the tangent, for mechanisms with idle freedoms.
        travel_reference: displacement of the point that is of interest; infinite if it is not.

    Attributes:
        length: of the next step, to begin with.
    """

    def __init__(
        self,
        newton: Iteration,
        lead: Lead,
        metric: ArcMetric,
        *,
        steps: ArcSteps,
        floor: float,
        travel_reference: float,
    ) -> None:
        self.newton, self.system, self.lead, self.metric = newton, newton.system, lead, metric
        self.steps, self.floor, self._travel_reference = steps, floor, travel_reference
        self.length = steps.first
        self._before: PathPoint | None = None

    # -- points --------------------------------------------------------------------------------------------

    def start(self, state: State) -> PathPoint:
        """The point at a known equilibrium; the parameter grows along its tangent."""
        control = self.lead.holding(state)
        balance = self._balance(state, control)
        point = self._point(state, balance, control, (self.newton.relative(balance),), 0)
        return point if point.tangent.parameter > 0.0 else point.reversed()

    def correct(self, guess: State, normal: Heading, near: PathPoint) -> PathPoint:
        """The equilibrium in the plane through ``guess`` across ``normal``, its tangent not against that.

        Args:
            guess: a state near it.
            normal: across which the plane stands.
            near: an equilibrium nearby; tells which control leaves the matrix regular.

        Raises:
            NotConverged: there is none near.
        """
        newton, metric = self.newton, self.metric
        held = abs(near.travel) / metric.travel > abs(near.tangent.parameter) / metric.parameter
        state, residuals, before = guess, [], math.inf
        for iteration in range(_MOST_ITERATIONS + 1):
            control = self.lead.holding_travel(self.system, state) if held else None
            control = control or self.lead.holding(state)
            balance = self._balance(state, control)
            residuals.append(newton.relative(balance))
            if iteration > 0 and newton.converged(balance, before):
                point = self._point(state, balance, control, tuple(residuals), iteration + 1)
                return point if metric.dot(point.tangent, normal) > 0.0 else point.reversed()
            if not math.isfinite(balance.norm):
                raise NotConverged("elements are inverted", iteration)
            if residuals[-1] > _DIVERGED * max(min(residuals), newton.options.near):
                break
            before = balance.norm
            newton.factor(state, control, balance, self.floor)
            correction = self._correction(balance)
            rate = self._rate(state, control)
            off = self.difference(state, guess) + correction
            change = correction + rate.scaled(-metric.dot(normal, off) / metric.dot(normal, rate))
            size = self.system.size(change.step)
            if not size <= newton.options.largest_turn:
                break
            state = self.lead.moved(self.system, state, change)
        raise NotConverged(f"the residual is {residuals[-1]:.1e} of the forces", len(residuals))

    def difference(self, later: State, earlier: State) -> Heading:
        """``later`` − ``earlier``."""
        return Heading(self.system.difference(later, earlier), self.lead.value(later) - self.lead.value(earlier))

    def along(self, start: PathPoint, end: PathPoint) -> float:
        """How far ``end`` lies ahead of ``start`` along the tangent there."""
        return self.metric.dot(start.tangent, self.difference(end.state, start.state))

    def between(self, start: PathPoint, end: PathPoint, distance: float) -> PathPoint:
        """The equilibrium ``distance`` ahead of ``start``, which lies before ``end`` on the same piece of the path.

        Raises:
            NotConverged: the cubic through both ends does not lead there.
        """
        width = self.along(start, end)
        t = distance / width
        slope = self.metric.dot(start.tangent, end.tangent)
        chord = self.difference(end.state, start.state)
        # the cubic with the rates by the distance:
        # y = y₀ + t² (3 − 2 t) (y₁ − y₀) + w t (1 − t)² y₀′ − w t² (1 − t) y₁′
        ahead = (
            chord.scaled(t * t * (3.0 - 2.0 * t))
            + start.tangent.scaled(width * t * (1.0 - t) ** 2)
            + end.tangent.scaled(-width * t * t * (1.0 - t) / slope)
        )
        guess = self.lead.moved(self.system, start.state, ahead)
        return self.correct(guess, start.tangent, start)

    # -- steps ---------------------------------------------------------------------------------------------

    def advance(self, point: PathPoint) -> PathPoint:
        """The next point of the path, as far ahead as its curvature allows.

        Raises:
            NotConverged: not even the shortest step succeeded.
        """
        tangent = point.tangent
        longest = self._longest(point)
        self.length = min(self.length, longest)
        while True:
            reason = "the path bends too sharply, or another one is too near"
            try:
                guess = self._guess(point)
                if not math.isfinite(self.system.elastic_energy()):
                    raise NotConverged("elements are inverted in the predicted state", 0)
                found = self.correct(guess, tangent, point)
                turn = self._turn(point, found)
                _log.debug("arc %.2e: turn %.2f, %d iterations", self.length, turn, found.iterations)
                if turn <= _LARGEST_TURN:
                    ease = min(_TURN / max(turn, 1e-12), math.sqrt(_ITERATIONS / found.iterations))
                    self.length *= min(max(ease, 0.5), 2.0)
                    self._before = point
                    return found
            except NotConverged as failure:
                reason = str(failure)
            self.length *= 0.5
            if self.length < self.steps.smallest * min(longest / self.steps.largest, 1.0):
                raise NotConverged(reason, 0)

    def _guess(self, point: PathPoint) -> State:
        """Along the tangent, and along the curvature if the last two tangents tell it.

        y = y₁ + h y₁′ + ½ h² (y₁′ − y₀′) / |y₁ − y₀|
        """
        ahead, before = point.tangent.scaled(self.length), self._before
        if before is not None:
            width = self.metric.norm(self.difference(point.state, before.state))
            bend = point.tangent + before.tangent.scaled(-1.0)
            if width > 0.0 and self.length * self.metric.norm(bend) <= 2.0 * _TURN * width:
                ahead = ahead + bend.scaled(0.5 * self.length**2 / width)
        return self.lead.moved(self.system, point.state, ahead)

    def _longest(self, point: PathPoint) -> float:
        """The arc that changes neither parameter nor displacement nor anything's place too much."""
        steps, tangent = self.steps, point.tangent
        rates = (
            abs(tangent.parameter) / (steps.largest * self.metric.parameter),
            abs(point.travel) / (steps.largest * self._travel_reference),
            self.system.size(tangent.step) / steps.motion,
        )
        return 1.0 / max(rates)

    def _turn(self, a: PathPoint, b: PathPoint) -> float:
        """Largest angle between the tangents at both points and the chord."""
        chord = self.metric.unit(self.difference(b.state, a.state))
        cosines = (
            self.metric.dot(a.tangent, b.tangent),
            self.metric.dot(a.tangent, chord),
            self.metric.dot(chord, b.tangent),
        )
        return math.acos(min(max(min(cosines), -1.0), 1.0))

    # -- linear algebra ------------------------------------------------------------------------------------

    def _balance(self, state: State, control: Control) -> Balance:
        self.system.load(state)
        return self.system.balance(state, control)

    def _correction(self, balance: Balance) -> Heading:
        """x₀."""
        x = self.newton.solve_linear(balance.vector)
        x.scale(-1.0)
        return Heading(self.system.step(x), 0.0)

    def _rate(self, state: State, control: Control) -> Heading:
        """x₁."""
        x = self.newton.solve_linear(control.rate(self.system, state))
        return self.lead.heading(self.system.step(x), control)

    def _point(
        self, state: State, balance: Balance, control: Control, residuals: tuple[float, ...], iterations: int
    ) -> PathPoint:
        """Stability and tangent at the loaded equilibrium."""
        system, newton = self.system, self.newton
        newton.factor(state, control, balance, self.floor)
        excess = newton.inertia().negative - newton.expected
        rate = self._rate(state, control)
        x = newton.solve_linear(system.control_row() if control.constrained else system.force_rate(state))
        if control.constrained:
            # Schur complement of the control row: negative exactly if removing the row leaves stability as it is
            under_control, travel = excess, 1.0
            unstable = excess + 1 - int(x.dot(system.control_row()) < 0.0)
        else:
            gradient = system.force_rate(state)
            travel = gradient.dot(newton.solve_linear(control.rate(system, state)))
            unstable, under_control = excess, excess - int(gradient.dot(x) < 0.0)
        scale = 1.0 / self.metric.norm(rate)
        return PathPoint(
            state, rate.scaled(scale), travel * scale, max(unstable, 0), max(under_control, 0), iterations, residuals
        )
