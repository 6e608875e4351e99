"""Safe range of a force: from the first allowable reached in one sense to that in the other.

Along the equilibria from rest under a growing force f, or displacement, the utilisation is the required factor of
safety over that of the frame. The first f is sought at which

    u(f) = S_required / S(f) = 1.

Linear links have a linear u, and the secant through two frames finds the root at once; beyond it regula falsi
(Illinois) closes in. The range ends before where the path loses its stability under the control; there it is followed
to the critical point.

Source: M. Dowell & P. Jarratt (doi:10.1007/BF01934364).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fenicsmech.continuation import ArcSteps, Critical
from fenicsmech.equilibrium import DisplacementControl, LoadControl
from fenicsmech.errors import DescriptionError, EquilibriumError, finite, point_text, set_options
from fenicsmech.mechanism import Force, ForceGroup
from fenicsmech.simulation.curve import axes
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.following import CurveFollower, Until
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.request import CurveRequest
from fenicsmech.simulation.stepping import CurveStepper
from fenicsmech.stress import Safety


@dataclass(frozen=True)
class SafeRangeOptions:
    """Numbers of the search for a safe range.

    Attributes:
        tolerance: of the utilisation at the ends.
        first: displacement of the first frame, in lengths of the mechanism; it gives the force its scale.
        growth: largest ratio of the distances of successive frames from rest.
        frames: largest number in each sense.
    """

    tolerance: float = 1e-4
    first: float = 1e-3
    growth: float = 8.0
    frames: int = 40

    def __post_init__(self) -> None:
        set_options(self, "a safe range", frames=2)


@dataclass(frozen=True)
class SafeLimit:
    """An end of a safe range.

    Attributes:
        reason: "allowable" if the required factor of safety is reached there; else why the range ends before:
            "end of the range", "limit point", "turning point", "bifurcation" or "no equilibrium beyond".
        frame: the equilibrium there.
    """

    reason: str
    frame: Frame

    @property
    def reached(self) -> bool:
        """Whether the required factor of safety is reached."""
        return self.reason == "allowable"

    @property
    def force(self) -> float:
        """Magnitude of the force."""
        return self.frame.force

    @property
    def displacement(self) -> float:
        """Of the force's point."""
        return self.frame.displacement

    @property
    def safety(self) -> Safety:
        """Factor of safety."""
        return self.frame.safety

    @property
    def link(self) -> str:
        """The link nearest to its allowable."""
        return self.safety.link

    @property
    def place(self) -> tuple[float, ...]:
        """Point of that link, unloaded, (dim,)."""
        return self.safety.place


@dataclass(frozen=True)
class SafeRange:
    """Forces and displacements that a mechanism bears; prints as text.

    Attributes:
        part: the force.
        factor: of safety, required.
        lower, upper: the ends, towards negative and positive forces, or displacements where these were prescribed.
        units: of force and length.
    """

    part: Force | ForceGroup
    factor: float
    lower: SafeLimit
    upper: SafeLimit
    units: tuple[str, str]

    def __str__(self) -> str:
        (force, length), lines = self.units, [f"safe range of {self.part.name!r}, factor of safety {self.factor:g}:"]
        for name, end in (("from", self.lower), ("to", self.upper)):
            safety = end.safety
            least = f"{safety.least.allowable.name} of {safety.link!r} at {point_text(safety.place)}"
            why = least if end.reached else f"{end.reason}; factor of safety {safety.factor:.3g}, {least}"
            lines.append(f"  {name} {end.force:.4g} {force}, displacement {end.displacement:.4g} {length}: {why}")
        if unknown := self.upper.safety.unknown:
            lines.append(f"  strength not known of {', '.join(unknown)}")
        return "\n".join(lines)


def read_bounds(
    part: Force | ForceGroup, forces: Sequence[float] | None, displacements: Sequence[float] | None
) -> tuple[float, float]:
    """The ends of the range asked for, of forces or displacements; infinite if none are given."""
    where = f"safe range of {part.name!r}"
    if forces is not None and displacements is not None:
        raise DescriptionError(where, "both forces and displacements are given", "Give one of them")
    given = forces if forces is not None else displacements
    if given is None:
        return -math.inf, math.inf
    try:
        low, high = (finite(f"end of the {where}", value) for value in given)
    except (TypeError, ValueError):
        raise DescriptionError(where, f"{given!r} are not two numbers", "Give its two ends") from None
    if not low <= 0.0 <= high or low == high:
        raise DescriptionError(where, f"it is asked for from {low:g} to {high:g}", "Give ends on both sides of zero")
    return low, high


@dataclass(frozen=True, eq=False)
class _Point:
    """A frame with the prescribed value and the utilisation."""

    x: float
    u: float
    frame: Frame


class SafeRangeSearch:
    """The ends of the safe range of a force, at the present rest shape.

    Args:
        discretisation: of the scene.
        request: the force, the configuration and constant loads.
        displaces: whether displacements are prescribed, else forces.
        factor: of safety, required.
        options: of the search.
    """

    def __init__(
        self,
        discretisation: Discretisation,
        request: CurveRequest,
        *,
        displaces: bool,
        factor: float,
        options: SafeRangeOptions,
    ) -> None:
        self._discretisation, self._request, self._options = discretisation, request, options
        self._displaces, self._factor = displaces, factor
        frame = self._stepper().frame(LoadControl(0.0))
        self._rest = _Point(frame.displacement if displaces else 0.0, self._utilisation(frame), frame)

    def end(self, bound: float) -> SafeLimit:
        """The end between rest and ``bound``, which may be infinite, in whose sense the path is followed."""
        rest, options = self._rest, self._options
        if rest.u >= 1.0:
            return SafeLimit("allowable", rest.frame)
        if not (bound - rest.x) * bound > 0.0:
            return SafeLimit("end of the range", rest.frame)
        sense = math.copysign(1.0, bound)
        before, last, stepper, probe = rest, rest, self._stepper(), self._probe(sense)
        if rest.frame.snapped_through:  # on the way to rest, which is none of the force's snaps
            stepper.frame(LoadControl(0.0))
        # the slope at rest, from the probe
        slope, farthest = (probe.u - rest.u) / abs(probe.x - rest.x), abs(probe.x - rest.x)
        for _ in range(options.frames):
            ahead = (1.0 - last.u) / slope if slope > 0.0 else math.inf
            ahead = min(ahead, options.growth * farthest - abs(last.x - rest.x))
            x = last.x + sense * ahead
            if arrives := abs(x - rest.x) >= abs(bound - rest.x):
                x = bound
            try:
                point = self._at(stepper, x)
            except EquilibriumError:
                return self._before_failure(last, x)
            if self._lost(point.frame):
                return self._before_failure(last, x, beyond=point.frame)
            if abs(point.u - 1.0) <= options.tolerance:
                return SafeLimit("allowable", point.frame)
            if point.u > 1.0:
                return self._root(stepper, last, point)
            if arrives:
                return SafeLimit("end of the range", point.frame)
            before, last, farthest = last, point, abs(point.x - rest.x)
            slope = (last.u - before.u) / abs(last.x - before.x)
        raise EquilibriumError(
            f"safe range of {self._request.where}",
            f"no allowable is reached within {options.frames} frames, at {self._words(last.frame)}",
            "Give forces=(low, high) or displacements=(low, high)",
            last=last.frame,
        )

    def _probe(self, sense: float) -> _Point:
        """A frame close to rest, which scales the steps."""
        length = self._options.first * self._discretisation.model.linkage.length
        frame = self._stepper().frame(DisplacementControl(self._rest.frame.displacement + sense * length))
        x = frame.displacement if self._displaces else sense * abs(frame.force)
        if x == self._rest.x:
            raise EquilibriumError(
                f"safe range of {self._request.where}",
                f"nothing resists its displacement {frame.displacement:g}",
                "Give displacements=(low, high), or hold the mechanism",
                last=frame,
            )
        return _Point(x, self._utilisation(frame), frame)

    def _root(self, stepper: CurveStepper, low: _Point, high: _Point) -> SafeLimit:
        """The end between two frames, one on either side of it."""
        a, b = (low.x, low.u - 1.0), (high.x, high.u - 1.0)
        side = 0
        for _ in range(self._options.frames):
            x = (a[0] * b[1] - b[0] * a[1]) / (b[1] - a[1])
            point = self._at(stepper, x)
            low = point if point.u <= 1.0 else low
            if abs(point.u - 1.0) <= self._options.tolerance:
                return SafeLimit("allowable", point.frame)
            if abs(b[0] - a[0]) <= self._options.tolerance**2 * abs(b[0]):
                break  # it jumps, as where links touch
            if point.u > 1.0:
                b, a, side = (x, point.u - 1.0), (a[0], a[1] * (0.5 if side > 0 else 1.0)), 1
            else:
                a, b, side = (x, point.u - 1.0), (b[0], b[1] * (0.5 if side < 0 else 1.0)), -1
        return SafeLimit("allowable", low.frame)

    def _before_failure(self, last: _Point, x: float, beyond: Frame | None = None) -> SafeLimit:
        """The end before the critical point between a frame and the prescribed value ``x``, at the frame ``beyond``."""
        until = Until(displacement=x) if self._displaces else Until(force=x)
        if beyond is not None and not self._displaces and (beyond.displacement - last.frame.displacement) * x > 0.0:
            until = replace(until, displacement=beyond.displacement)
        kinds = {Critical.BIFURCATION, Critical.TURNING if self._displaces else Critical.LIMIT}
        reason, frames = "no equilibrium beyond", tuple[Frame, ...]()
        try:
            curve = CurveFollower(self._discretisation, self._request, until, ArcSteps()).from_rest(lambda done: None)
            frames = curve.frames
            if event := next((event for event in curve.events if event.kind in kinds), None):
                reason, frames = event.kind.value, frames[: event.index + 1]
        except EquilibriumError as error:
            frames = error.frames
        before = last
        for frame in frames:
            value = frame.displacement if self._displaces else frame.force
            if abs(value - self._rest.x) <= abs(before.x - self._rest.x):
                continue
            point = _Point(value, self._utilisation(frame), frame)
            if point.u >= 1.0:
                return self._root(self._stepper(), before, point)
            before = point
        return SafeLimit(reason, before.frame)

    def _at(self, stepper: CurveStepper, x: float) -> _Point:
        frame = stepper.frame((DisplacementControl if self._displaces else LoadControl)(x))
        stepper.frames.append(frame)
        return _Point(x, self._utilisation(frame), frame)

    def _lost(self, frame: Frame) -> bool:
        """Whether the path has lost its stability under the control on the way to a frame."""
        rest = self._rest.frame
        if self._displaces:
            lost = rest.stable_under_control and not frame.stable_under_control
        else:
            lost = frame.unstable_modes > rest.unstable_modes
        return frame.snapped_through or lost

    def _utilisation(self, frame: Frame) -> float:
        return self._factor / frame.safety.factor

    def _stepper(self) -> CurveStepper:
        return CurveStepper(self._discretisation, replace(self._request, controls=()))

    def _words(self, frame: Frame) -> str:
        across, up = axes(self._request.part, self._discretisation.scene.units)
        return f"{across.quantity} {across(frame.displacement)}, {up.quantity} {up(frame.force)}"
