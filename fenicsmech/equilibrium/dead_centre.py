"""Motors led past a dead centre, where the slack of the joints ends and links must strain.

On the way there a coordinate x swings ever faster while the links do as they like: close by, in units of x,

    C = b + ½ x² − e = 0,     E = ½ k e²,     λ = k e,     x λ = 0,

e the strain and b how far the motors are beyond the dead centre. Before it (b < 0) joints close by x alone, x = √(−2b)
and λ = 0; beyond it x = 0 and λ = k b. Newton's method does not get from one to the other: as long as λ = 0 the energy
is not curved along x, every step closes the joints by x alone, x ← ½ x − b / x, and for b > 0 these jump about for
ever. From a state that strains instead it converges, λ being the curvature. Such states lie along the rate with x held:

    K ẏ = r,     K w = n,     ẏ ← ẏ − w (n · ẏ) / (n · w),     n the motion in ẏ, which is all x near the dead centre.
"""

from __future__ import annotations

from dataclasses import replace

from fenicsmech.equilibrium.control import Control
from fenicsmech.equilibrium.path import BEYOND, SMALLEST, STRIDE, Path, PathFailed
from fenicsmech.equilibrium.predictor import Anchor
from fenicsmech.equilibrium.solver import NotConverged, Solution
from fenicsmech.equilibrium.state import Step
from fenicsmech.log import logger

_log = logger(__name__)


class MotorPath(Path):
    """Equilibria as motors move, past the dead centre of an unloaded mechanism too."""

    def advance(self, control: Control) -> Solution:
        try:
            return super().advance(control)
        except PathFailed as failure:
            if failure.last is None or not self._strain(failure.last, control):
                raise
        return super().advance(control)

    def _strain(self, last: Solution, control: Control) -> bool:
        """Goes on from the ``last`` equilibrium by straining links; whether that led to another one (collective)."""
        system, distance = self._newton.system, control.target - self._value
        try:
            rate = self._held_rate(last, control.at(self._value))
        except NotConverged:
            return False
        step = distance * min(1.0, STRIDE / max(system.size(rate) * abs(distance), STRIDE))
        while abs(step) > SMALLEST * self._scale(distance):
            value = self._value + step
            try:
                solution = self._solve(system.moved(last.state, rate.scaled(step)), control.at(value))
            except NotConverged:
                solution = None
            if solution is None or self._strayed(last, rate, step, solution):
                step *= 0.5
                continue
            _log.info("links strain beyond a dead centre near %g", self._value)
            self._last, self._rate, self._anchors = solution, None, []
            self._remember(Anchor(value, solution.state, solution.tangent))
            return True
        return False

    def _strayed(self, last: Solution, held: Step, step: float, solution: Solution) -> bool:
        """Whether a coordinate moved otherwise than at a rate between the ``held`` one, x's before and that after."""
        system = self._newton.system
        rate = system.difference(solution.state, last.state).scaled(1.0 / step)
        beyond = system.size(system.independent(rate.beyond((held, last.tangent, solution.tangent))))
        return beyond > BEYOND * max(system.size(held), system.size(solution.tangent))

    def _held_rate(self, last: Solution, control: Control) -> Step:
        """Rate of the state with the target of ``control``, the motion that runs away held (collective).

        Raises:
            NotConverged: the tangent cannot be factored, or solved with, or has a maximum of the energy in it.
        """
        newton, system = self._newton, self._newton.system
        at = newton.linearise(replace(last.state, minimum_shift=self._shifts[0]), control)
        rate = at.rate()
        motion = rate.duplicate()
        motion.pointwiseMult(system.unknowns.coordinates_mask(), rate)
        motion.normalize()
        strain = at.solve(motion)
        compliance = motion.dot(strain)
        if not compliance > 0.0:
            raise NotConverged("nothing resists the motion towards a dead centre", 0)
        rate.axpy(-motion.dot(rate) / compliance, strain)
        return system.unknowns.step(rate)
