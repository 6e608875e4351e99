"""Followed curves: past limit points and folds, with their limit points and bifurcations recorded as events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from fenicsmech.equilibrium import EquilibriumPoint, LoadControl, NotConverged, Quantity, State
from fenicsmech.errors import DescriptionError, EquilibriumError
from fenicsmech.plot import CurveMark, CurveSeries
from fenicsmech.simulation.buckling import ModeShape, mode_shape
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.request import CurveRequest, Until, quantities
from fenicsmech.simulation.tracing import CurveTracer


@dataclass(frozen=True, eq=False)
class PathEvent:
    """A critical point of a followed curve.

    Attributes:
        kind: limit point of the force, turning point of the displacement or of a motor, or bifurcation.
        frame: the equilibrium; also one of the curve's frames.
        index: of that frame.
        null_space: at a bifurcation a basis of the tangent's null space, one direction for each of the modes that
            change; else the direction of the path.
        critical: the point of the path that branches start from.
    """

    kind: Critical
    frame: Frame
    index: int
    null_space: tuple[ModeShape, ...]
    critical: CriticalPoint

    def __repr__(self) -> str:
        return f"<PathEvent: {self.kind.value} at frame {self.index}, value {self.value:.6g}, {self.frame!r}>"

    @property
    def mode(self) -> ModeShape:
        """The first of the null space, which is the only one unless several modes become unstable at once."""
        return self.null_space[0]

    @property
    def value(self) -> float:
        """Value of the prescribed part at the singular tangent; the frame is the nearest equilibrium found."""
        return self.critical.value

    @property
    def modes(self) -> int:
        """Number of modes that change their stability there."""
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
        """Limit points: a dead load snaps there."""
        return self._of(Critical.LIMIT)

    @property
    def turning_points(self) -> tuple[PathEvent, ...]:
        """Turning points: a held displacement snaps there."""
        return self._of(Critical.TURNING)

    @property
    def bifurcations(self) -> tuple[PathEvent, ...]:
        """Bifurcations: other curves cross this one there."""
        return self._of(Critical.BIFURCATION)

    def series(self, label: str = "", *, colour: str | None = None, faint: bool = False) -> CurveSeries:
        """The curve as a plot draws it, with its events marked; arguments as those of ``CurveSeries``."""
        marks = tuple(CurveMark(event.frame.displacement, event.frame.force, event.kind.value) for event in self.events)
        return replace(super().series(label, colour=colour, faint=faint), marks=marks)

    def _of(self, kind: Critical) -> tuple[PathEvent, ...]:
        return tuple(event for event in self.events if event.kind is kind)


def follow(
    discretisation: Discretisation,
    request: CurveRequest,
    until: Until,
    steps: ArcSteps,
    watch: Callable[[int], None],
) -> FollowedCurve:
    """The curve of a request from its configuration without the controlled force.

    Args:
        discretisation: of the scene, at its present rest shape.
        request: of the curve.
        until: where the curve ends.
        steps: options of the continuation.
        watch: called with the number of frames so far.

    Raises:
        AssemblyError: the configuration does not assemble.
        EquilibriumError: the curve ends early; carries the frames before that.
    """
    follower = CurveFollower(CurveTracer(discretisation, request), until, steps)
    follower.from_rest(watch)
    return follower.curve()


def branches(
    curve: FollowedCurve, event: PathEvent, until: Until, steps: ArcSteps, mode: ModeShape | None
) -> tuple[FollowedCurve, FollowedCurve]:
    """The curve that crosses another one, in both senses.

    Args:
        curve, event: a followed curve and one of its bifurcations.
        until, steps: as in ``follow``.
        mode: one of the event's ``null_space``, if several modes become unstable at once.

    Raises:
        DescriptionError: the event is not a bifurcation of the curve, the mode is missing or none of its.
        EquilibriumError: the curve is not found, or ends early; carries the frames before that.
    """
    if event not in curve.bifurcations:
        raise DescriptionError(
            "branches", "the event is not a bifurcation of the curve", "Choose from its bifurcations"
        )
    if mode is None and event.modes != 1:
        raise DescriptionError(
            "branches",
            f"{event.modes} modes become unstable at once: {', '.join(shape.link for shape in event.null_space)}",
            "Say which with mode=event.null_space[…], or break the symmetry a little",
        )
    if mode is not None and mode not in event.null_space:
        raise DescriptionError("branches", "the mode is none of the event's", "Choose from its null_space")
    request, found = CurveRequest(curve.part, (), curve.configuration, curve.others), []
    with curve.discretisation.model.shaped(event.frame.design):
        for sense in Sense:
            follower = CurveFollower(CurveTracer(curve.discretisation, request), until, steps)
            follower.from_bifurcation(event, mode or event.mode, sense)
            found.append(follower.curve())
    return found[0], found[1]


class CurveFollower:
    """The path of one request.

    Args:
        tracer: of the request.
        until: where the path ends.
        steps: how finely it is followed.
    """

    def __init__(self, tracer: CurveTracer, until: Until, steps: ArcSteps) -> None:
        self._tracer, self._until, self._steps = tracer, until, steps
        self._followed, self._system = tracer.followed, tracer.solver.system
        self._frames: list[Frame] = []
        self._events: list[PathEvent] = []

    def curve(self) -> FollowedCurve:
        """The frames and events found."""
        tracer, request = self._tracer, self._tracer.request
        return FollowedCurve(
            request.part,
            request.configuration,
            tracer.freedom,
            tuple(self._frames),
            tracer.discretisation,
            others=request.others,
            # loads have limit points, where no displacement belongs to a slightly larger one
            quantity=Quantity.FORCE,
            events=tuple(self._events),
        )

    def from_rest(self, watch: Callable[[int], None]) -> None:
        """Follows the path from the configuration without the controlled force.

        Raises:
            EquilibriumError: the path ends early; carries the frames before that.
        """
        first = self._tracer.frame(LoadControl(0.0), ())
        self._frames.append(first)
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

    def from_bifurcation(self, event: PathEvent, mode: ModeShape, sense: Sense) -> None:
        """Follows the path that crosses another one at ``event`` along ``mode``.

        Raises:
            EquilibriumError: the path is not found, or ends early; carries the frames before that.
        """
        self._frames.append(event.frame)
        rest = self._tracer.frame(LoadControl(0.0), ())  # the tangent at the bifurcation has no scale
        try:
            path = self._path(rest.state)
            first = crossing(path, event.critical, mode.step, sense)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        self._frames.append(self._tracer.record(first))
        self._walk(path, first, lambda done: None)

    def _walk(self, path: ArcLengthTracer, start: EquilibriumPoint, watch: Callable[[int], None]) -> None:
        clock = self._tracer.discretisation.clock
        stretches = path.follow(start, self._finishes(path), most=self._until.frames - len(self._frames))
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
            self._frames.append(replace(frame, seconds=perf_counter() - began, phases=clock.since(seconds)))
            watch(min(len(self._frames), self._until.frames))  # critical points come on top

    def _record_event(self, path: ArcLengthTracer, critical: CriticalPoint) -> None:
        if critical.kind is Critical.BIFURCATION:
            steps = null_space(path, critical)
        else:
            step = critical.point.tangent
            steps = [step.scaled(1.0 / path.system.size(step))]
        frame = self._tracer.record(critical.point)
        modes = tuple(mode_shape(self._tracer.discretisation.model, step) for step in steps)
        self._events.append(PathEvent(critical.kind, frame, len(self._frames), modes, critical))
        self._frames.append(frame)

    def _path(self, state: State) -> ArcLengthTracer:
        """The path through ``state``, in units of its ends."""
        until, value, conjugate = self._until, self._followed.value(self._system, state), self._conjugate(state)
        values, conjugates = until.travels, until.forces
        if not self._followed.displaces:
            values, conjugates = conjugates, values
        return ArcLengthTracer(
            self._tracer.solver,
            self._followed,
            state,
            steps=self._steps,
            value=max((abs(target - value) for target in values), default=0.0),
            conjugate=max((abs(target - conjugate) for target in conjugates), default=0.0),
        )

    def _finishes(self, path: ArcLengthTracer) -> list[Finish]:
        """Displacements or positions first, then forces."""
        followed = path.value, path.value_rate
        conjugate = (lambda point: self._conjugate(point.state)), (lambda point: point.conjugate_rate)
        travel, force = (followed, conjugate) if self._followed.displaces else (conjugate, followed)
        return [
            Finish(value, rate, target, max(map(abs, targets)) or 1.0)
            for (value, rate), targets in ((travel, self._until.travels), (force, self._until.forces))
            for target in targets
        ]

    def _conjugate(self, state: State) -> float:
        """The conjugate of the followed value; displacements count from the unloaded configuration."""
        self._system.load(state)
        origin = 0.0 if self._followed.displaces else self._tracer.origin
        return self._followed.conjugate(self._system, state) - origin

    def _ended(self, failure: NotConverged) -> EquilibriumError:
        last, (across, up) = self._frames[-1], quantities(self._tracer.request.part)
        return EquilibriumError(
            f"path of {self._tracer.request.where}",
            f"it cannot be followed beyond {across} {last.displacement:g} at {up} {last.force:g} ({failure})",
            "End it before, allow smaller steps with ArcSteps(smallest=…), or use a finer mesh",
            last=last,
            frames=self._frames,
        )
