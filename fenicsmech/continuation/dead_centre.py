"""Load steps past dead centres, where the slack of joints ends and links must strain.

Motors, and springs that constant loads wind up, may go beyond a dead centre. Towards it a coordinate x moves ever
faster while the links are free of strain: close by, in units of x,

    C = b + ½ x² − e = 0,     E = ½ k e²,     λ = k e,     x λ = 0,

e the strain and b how far these are beyond the dead centre. Before it (b < 0) joints close by x alone, x = √(−2b)
and λ = 0; beyond it x = 0 and λ = k b. Newton's method does not get from one to the other: as long as λ = 0 the energy
is not curved along x, every step closes the joints by x alone, x ← ½ x − b / x, and for b > 0 these oscillate without
end. From a state in which links strain instead, it converges, with λ as the curvature. Such states lie along the rate
with x held:

    K ẏ = r,     K w = n,     ẏ ← ẏ − w (n · ẏ) / (n · w),     n the motion in ẏ, which is all x near the dead centre.
"""

from __future__ import annotations

from fenicsmech.continuation.load_steps import LoadStepper, LoadStepsFailed
from fenicsmech.equilibrium import Control, EquilibriumPoint, NotConverged, Step
from fenicsmech.log import logger

_log = logger(__name__)


class DeadCentreStepper(LoadStepper):
    """Load steps of motors or constant loads, also past a dead centre that the mechanism reaches without strain."""

    def advance(self, control: Control, *, failures: int | None = None) -> EquilibriumPoint:
        try:
            return super().advance(control, failures=failures)
        except LoadStepsFailed as failure:
            last = None if failure.hidden else failure.last
            if last is None or not self._pass_dead_centre(last, failure.tried[-1], control):
                raise
        return super().advance(control, failures=failures)

    def _past_fold(self, control: Control, asked: Control) -> list[Control]:
        """Only the nearer one: a dead centre looks like a fold, and what lies behind it is reached by its path."""
        return [control]

    def _pass_dead_centre(self, last: EquilibriumPoint, tried: float, control: Control) -> bool:
        """Continues from the ``last`` equilibrium by straining links, past a dead centre before the value that was
        ``tried``; whether this succeeded."""
        system, steps, distance = self.system, self._steps, control.prescribed - self._value
        closing = 2.0 * system.size(last.tangent) * abs(tried - self._value)
        try:
            rate = self._straining_rate(last, control.at(self._value))
        except NotConverged:
            return False
        step = distance * min(1.0, steps.motion / max(system.size(rate) * abs(distance), steps.motion))
        found = False  # an equilibrium, farther off
        while abs(step) > steps.smallest * self._scale(distance):
            guess = system.moved(last.state, rate.scaled(step))
            try:
                point = self._shifted(guess, control.at(self._value + step))
            except NotConverged:
                if found:  # nearer by it would be too
                    return False
            else:
                found = True
                if not self._left_path(last, rate, step, point, closing):
                    _log.info("links strain beyond a dead centre near %g", self._value)
                    self._rate, self._points, self._start = None, [], last.state
                    self._accept_at(point)
                    return True
            step *= 0.5
        return False

    def _left_path(
        self, last: EquilibriumPoint, straining: Step, step: float, point: EquilibriumPoint, closing: float
    ) -> bool:
        """Whether a coordinate's rate over ``step`` lies outside the range of the ``straining`` one and the tangent at
        its end by more than joints move while they are ``closing``.

        x = √(2 (p − v)) before a dead centre at p has the rate x′ = −1 / x and closes by x = 2 |x′| (p − v).
        """
        rate = self.system.difference(point.state, last.state).scaled(1.0 / step)
        largest = max(self.system.size(straining), self.system.size(point.tangent))
        beyond = self._beyond(rate, (straining, point.tangent), point)
        return beyond > self._steps.deviation * largest + closing / abs(step)

    def _straining_rate(self, last: EquilibriumPoint, control: Control) -> Step:
        """Rate of the state with the value of ``control`` that strains links instead of the dominant motion x.

        Raises:
            NotConverged: the KKT matrix cannot be factored or solved with, or is not positive along the motion.
        """
        at = self.solver.linearise(last.state, control)
        rate = at.rate()
        motion = rate.duplicate()
        motion.pointwiseMult(self.system.unknowns.coordinates_mask(), rate)
        motion.normalize()
        strain = at.solve(motion)
        compliance = motion.dot(strain)
        if not compliance > 0.0:
            raise NotConverged("nothing resists the motion towards a dead centre")
        rate.axpy(-motion.dot(rate) / compliance, strain)
        return at.step(rate)
