"""Followed curves: past limit points and folds, with their limit points and bifurcations recorded as events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter

from fenicsmech.continuation import (
    ArcLengthTracer,
    ArcSteps,
    Critical,
    CriticalPoint,
    Finish,
    Sense,
    crossing,
    locate,
    null_space,
)
from fenicsmech.equilibrium import EquilibriumPoint, Iteration, LoadControl, NotConverged, State
from fenicsmech.errors import EquilibriumError
from fenicsmech.model import MechanismModel
from fenicsmech.plot import CurveMark, CurveSeries
from fenicsmech.simulation.buckling import ModeShape, mode_shape
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.request import CurveRequest, Until, quantities
from fenicsmech.simulation.tracing import CurveTracer


@dataclass(frozen=True, eq=False)
class PathEvent:
    """A critical point of a followed curve.

    Attributes:
        kind: limit point of the force, turning point of the displacement or of a motor, or bifurcation.
        frame: the equilibrium; also one of the curve's frames.
        index: which.
        null_space: how the mechanism gives way: at a bifurcation a basis of the tangent's null space, one direction for
            each of the modes that change, else the direction of the path.
        critical: the point of the path that branches start from.
    """

    kind: Critical
    frame: Frame
    index: int
    null_space: tuple[ModeShape, ...] = field(repr=False)
    critical: CriticalPoint = field(repr=False)

    @property
    def mode(self) -> ModeShape:
        """The first of the null space, which is the only one unless several modes become unstable at once."""
        return self.null_space[0]

    @property
    def value(self) -> float:
        """Of the prescribed part, where the tangent is singular; the frame is the nearest equilibrium found."""
        return self.critical.value

    @property
    def modes(self) -> int:
        """By how many the unstable modes change there."""
        return self.critical.modes


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FollowedCurve(Curve):
    """Frames in the order of the path, however often it turns back.

    Attributes:
        events: limit points, turning points and bifurcations, in the order of the path.
    """

    events: tuple[PathEvent, ...] = ()

    @property
    def limit_points(self) -> tuple[PathEvent, ...]:
        """Where a dead load would snap."""
        return self._of(Critical.LIMIT)

    @property
    def turning_points(self) -> tuple[PathEvent, ...]:
        """Where a held displacement would snap."""
        return self._of(Critical.TURNING)

    @property
    def bifurcations(self) -> tuple[PathEvent, ...]:
        """Where other curves cross this one."""
        return self._of(Critical.BIFURCATION)

    def series(self, label: str = "", *, colour: str | None = None, faint: bool = False) -> CurveSeries:
        """The curve as a plot draws it, with its events marked; arguments as those of ``CurveSeries``."""
        marks = tuple(CurveMark(event.frame.displacement, event.frame.force, event.kind.value) for event in self.events)
        return replace(super().series(label, colour=colour, faint=faint), marks=marks)

    def _of(self, kind: Critical) -> tuple[PathEvent, ...]:
        return tuple(event for event in self.events if event.kind is kind)


class CurveFollower:
    """The path of one request.

    Args:
        model: the discretised mechanism.
        solver: for the request's forces.
        request: what is asked for.
        tracer: of the same request.
        until: where the path ends.
        steps: how finely it is followed.

    Attributes:
        frames, events: of the path so far.
    """

    def __init__(
        self,
        model: MechanismModel,
        solver: Iteration,
        request: CurveRequest,
        tracer: CurveTracer,
        *,
        until: Until,
        steps: ArcSteps,
    ) -> None:
        self._model, self._solver, self._request, self._tracer = model, solver, request, tracer
        self._until, self._steps, self._followed = until, steps, tracer.followed
        self.frames: list[Frame] = []
        self.events: list[PathEvent] = []

    def from_rest(self, watch: Callable[[int], None]) -> None:
        """Follows the path from the configuration without the controlled force.

        Raises:
            EquilibriumError: the path ends early; carries the frames before that.
        """
        first = self._tracer.frame(LoadControl(0.0), ())
        self.frames.append(first)
        try:
            path = self._path(first.state)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        start, finishes = path.start, self._finishes(path)
        # towards the first displacement or position that is wanted, or else the first force
        wanted = [*(finish for finish in finishes if finish.target != finish.value(start))][:1]
        if wanted and (wanted[0].target - wanted[0].value(start)) * wanted[0].rate(start) < 0.0:
            start = start.scaled(-1.0)
        self._walk(path, start, watch)

    def from_bifurcation(self, event: PathEvent, mode: ModeShape, sense: Sense, watch: Callable[[int], None]) -> None:
        """Follows the path that crosses another one at ``event`` along ``mode``.

        Raises:
            EquilibriumError: the path is not found, or ends early; carries the frames before that.
        """
        self.frames.append(event.frame)
        rest = self._tracer.frame(LoadControl(0.0), ())  # the tangent at the bifurcation has no scale
        try:
            path = self._path(rest.state)
            first = crossing(path, event.critical, mode.step, sense)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        self.frames.append(self._tracer.record(first))
        self._walk(path, first, watch)

    def _walk(self, path: ArcLengthTracer, start: EquilibriumPoint, watch: Callable[[int], None]) -> None:
        clock = self._model.clock
        stretches = path.follow(start, self._finishes(path), most=self._until.frames - len(self.frames))
        while True:
            began, seconds = perf_counter(), dict(clock.seconds)
            try:
                ends = next(stretches, None)
                if ends is None:
                    return
                for critical in locate(path, *ends):
                    self._record_event(path, critical)
            except NotConverged as failure:
                raise self._ended(failure) from failure
            frame = self._tracer.record(ends[1])
            self.frames.append(replace(frame, seconds=perf_counter() - began, phases=clock.since(seconds)))
            watch(min(len(self.frames), self._until.frames))  # critical points come on top

    def _record_event(self, path: ArcLengthTracer, critical: CriticalPoint) -> None:
        if critical.kind is Critical.BIFURCATION:
            steps = null_space(path, critical)
        else:
            step = critical.point.tangent
            steps = [step.scaled(1.0 / path.system.size(step))]
        frame = self._tracer.record(critical.point)
        modes = tuple(mode_shape(self._model, step) for step in steps)
        self.events.append(PathEvent(critical.kind, frame, len(self.frames), modes, critical))
        self.frames.append(frame)

    def _path(self, state: State) -> ArcLengthTracer:
        """The path through ``state``, in units of what is asked for."""
        until, value, conjugate = self._until, self._followed.value(self._solver.system, state), self._conjugate(state)
        values, conjugates = (until.travel, until.force) if self._followed.displaces else (until.force, until.travel)
        return ArcLengthTracer(
            self._solver,
            self._followed,
            state,
            steps=self._steps,
            value=max((abs(target - value) for target in values), default=0.0),
            conjugate=max((abs(target - conjugate) for target in conjugates), default=0.0),
        )

    def _finishes(self, path: ArcLengthTracer) -> list[Finish]:
        """Displacements or positions first, then forces."""
        value = path.value, path.value_rate
        conjugate = (lambda point: self._conjugate(point.state)), (lambda point: point.conjugate_rate)
        travel, force = (value, conjugate) if self._followed.displaces else (conjugate, value)
        return [
            Finish(*quantity, target, max(map(abs, targets)) or 1.0)
            for quantity, targets in ((travel, self._until.travel), (force, self._until.force))
            for target in targets
        ]

    def _conjugate(self, state: State) -> float:
        """As on curves, displacements from the unloaded configuration."""
        self._solver.system.load(state)
        origin = 0.0 if self._followed.displaces else self._tracer.origin
        return self._followed.conjugate(self._solver.system, state) - origin

    def _ended(self, failure: NotConverged) -> EquilibriumError:
        last, (across, up) = self.frames[-1], quantities(self._request.part)
        return EquilibriumError(
            f"path of {self._request.where}",
            f"it cannot be followed beyond {across} {last.displacement:g} at {up} {last.force:g} ({failure})",
            "End it before, allow smaller steps with ArcSteps(smallest=…), or use a finer mesh",
            last=last,
            frames=self.frames,
        )
