"""Equilibria of a path that may turn back in load and in displacement, each in a plane across it.

The parameter p is an unknown, and a plane across the path takes its equation's place:

    R(y, p) = 0,    ⟨n, (y, p) − (y, p)_guess⟩ = 0,      KKT x₀ = −R,  KKT x₁ = rate of the control's target,
    x = x₀ + τ x₁,  τ = −⟨n, (y, p) + x₀ − guess⟩ / ⟨n, x₁⟩.

The plane never needs a row of the matrix. KKT holds whichever changes more along the path, p or its conjugate (the
load or the displacement of its point), so that it is regular at limit points of the other. Sources: Riks
(doi:10.1016/0020-7683(79)90081-7), Crisfield (doi:10.1016/0045-7949(81)90108-5), and for the choice of the control
Rheinboldt & Burkardt (doi:10.1145/357456.357460).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fenicsmech.equilibrium.arc_metric import ArcMetric
from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.lead import Heading, Lead
from fenicsmech.equilibrium.solver import Iteration, Linearisation, NotConverged, Solution
from fenicsmech.equilibrium.state import State

_MOST_ITERATIONS = 10
_NEAR = 1e-2  # residual over the forces from which on it should fall
_DIVERGED = 1e3  # growth of the residual
_LARGEST_CHANGE = 0.5  # of the mechanism's length, or rad: of one iteration


@dataclass(frozen=True, eq=False)
class PathPoint:
    """An equilibrium on a path.

    Attributes:
        state: the equilibrium.
        tangent: the path's direction there, of norm one.
        conjugate: rate of the parameter's conjugate along it.
        unstable_modes: directions in which the energy has a maximum while the parameter is held.
        unstable_under_control: the same while the displacement of what leads is held.
        iterations: KKT systems factored on the way.
        residuals: relative residual before each iteration and at the end.
        linearisation: the KKT matrix there.
    """

    state: State
    tangent: Heading
    conjugate: float
    unstable_modes: int
    unstable_under_control: int
    iterations: int
    residuals: tuple[float, ...]
    linearisation: Linearisation

    def reversed(self) -> PathPoint:
        """The same equilibrium, on the way back."""
        return replace(self, tangent=self.tangent.scaled(-1.0), conjugate=-self.conjugate)

    def solution(self) -> Solution:
        """The same as an equilibrium that was asked for, its tangent that of the path."""
        return Solution(
            self.state,
            self.residuals,
            self.iterations,
            self.unstable_modes,
            self.unstable_under_control,
            self.tangent.step,
            self.linearisation,
        )


class PathPoints:
    """The equilibria of a path (all methods are collective).

    Args:
        newton: the solver, whose linear algebra is used; the iteration is the one above.
        lead: the path's parameter.
        metric: what distances are measured in.
    """

    def __init__(self, newton: Iteration, lead: Lead, metric: ArcMetric) -> None:
        self.newton, self.system, self.lead, self.metric = newton, newton.system, lead, metric

    def at(self, state: State) -> PathPoint:
        """The point at a known equilibrium; the parameter grows along its tangent."""
        at = self.newton.linearise(state, self.lead.holding(state))
        point = self._point(at, (self.newton.relative(at.residual),), 0)
        return point if point.tangent.parameter > 0.0 else point.reversed()

    def linearise(self, point: PathPoint, near: PathPoint) -> Linearisation:
        """The tangent at ``point``, held by what is held for corrections near ``near``."""
        return self.newton.linearise(point.state, self._control(point.state, near))

    def correct(self, guess: State, normal: Heading, near: PathPoint) -> PathPoint:
        """The equilibrium in the plane through ``guess`` across ``normal``, its tangent not against that.

        Args:
            guess: a state near it.
            normal: across which the plane stands.
            near: an equilibrium nearby; tells which control leaves the matrix regular.

        Raises:
            NotConverged: there is none near.
        """
        newton, system, metric = self.newton, self.system, self.metric
        state, residuals, before = guess, [], math.inf
        for iteration in range(_MOST_ITERATIONS + 1):
            control = self._control(state, near)
            system.load(state)
            residual = system.residual(state, control)
            residuals.append(newton.relative(residual))
            if iteration > 0 and newton.converged(residual, before):
                point = self._point(newton.linearise(state, control), tuple(residuals), iteration + 1)
                return point if metric.dot(point.tangent, normal) > 0.0 else point.reversed()
            if not math.isfinite(residual.norm):
                raise NotConverged("elements are inverted", iteration)
            if residuals[-1] > _DIVERGED * max(min(residuals), _NEAR):
                break
            before = residual.norm
            at = newton.linearise(state, control)
            correction = self._correction(at)
            rate = self.lead.heading(at.step(at.rate()), control)
            off = self.difference(state, guess) + correction
            change = correction + rate.scaled(-metric.dot(normal, off) / metric.dot(normal, rate))
            if not self.system.size(change.step) <= _LARGEST_CHANGE:
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

    # -- linear algebra ------------------------------------------------------------------------------------

    def _control(self, state: State, near: PathPoint) -> Control:
        """What is held at ``state``: whichever changes more along the path at ``near``."""
        metric, control = self.metric, None
        if abs(near.conjugate) / metric.conjugate > abs(near.tangent.parameter) / metric.parameter:
            control = self.lead.holding_conjugate(self.system, state)
        return control or self.lead.holding(state)

    def _correction(self, at: Linearisation) -> Heading:
        """x₀."""
        x = at.solve(at.residual.vector)
        x.scale(-1.0)
        return Heading(at.step(x), 0.0)

    def _point(self, at: Linearisation, residuals: tuple[float, ...], iterations: int) -> PathPoint:
        """Stability and tangent at an equilibrium."""
        system, state, control, lead = self.system, at.state, at.control, self.lead
        excess = at.inertia().negative - self.newton.expected
        x = at.rate()
        verdict = lead.verdict(system, state, control, x, excess)
        rate = lead.heading(at.step(x), control)
        scale = 1.0 / self.metric.norm(rate)
        return PathPoint(
            state,
            rate.scaled(scale),
            lead.conjugate_rate(system, state, control, x) * scale,
            verdict.unstable_modes,
            verdict.unstable_under_control,
            iterations,
            residuals,
            at,
        )
