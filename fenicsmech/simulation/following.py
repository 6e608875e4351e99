"""Followed curves: past limit points and folds until an end, with limit points and bifurcations recorded as events."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from fenicsmech.collective import agreed
from fenicsmech.continuation import (
    ArcLengthStepper,
    ArcSteps,
    Critical,
    CriticalPoint,
    Finish,
    Sense,
    crossing,
    equilibrium_at,
    linear_reach,
    locate,
    null_space,
)
from fenicsmech.equilibrium import DisplacementControl, EquilibriumPoint, LoadControl, NotConverged, State, Unknown
from fenicsmech.errors import DescriptionError, EquilibriumError, finite, set_fields, whole
from fenicsmech.mechanism import Configuration, Drive, Force, ForceGroup, Mechanism, Motor, PrescribedPart
from fenicsmech.multibody import RestSearch
from fenicsmech.plot import CurveMark, CurveSeries
from fenicsmech.simulation.curve import Curve, axes
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.frame import Frame, ModeShape, mode_shape
from fenicsmech.simulation.request import CurveRequest, check_force, check_motors, read_others
from fenicsmech.simulation.stepping import CurveStepper

_FELT = 10.0  # first force over the least one, where rounding hides what that moves


@dataclass(frozen=True)
class Until:
    """A path ends exactly at the first of these values that it passes, or after a number of frames.

    Args:
        displacement: of the prescribed force's point along its direction, counted as on curves; one value or several.
        position: of the prescribed motors, rad or length, counted from the drawing; one value or several.
        force: magnitude of the prescribed force, or torque or force of the motors; one value or several.
        frames: maximum number of frames, not counting critical points; the path ends there without error.

    Raises:
        DescriptionError: no end is given, both a displacement and a position are given, or a number is invalid.
    """

    displacement: float | tuple[float, ...] = ()
    force: float | tuple[float, ...] = ()
    position: float | tuple[float, ...] = ()
    frames: int = 500

    def __post_init__(self) -> None:
        for name in ("displacement", "force", "position"):
            values = _several(getattr(self, name))
            set_fields(self, **{name: tuple(finite(f"{name} where a path ends", value) for value in values)})
        if not (self.displacement or self.force or self.position):
            raise DescriptionError("end of a path", "no displacement, position or force is given", "Give one of them")
        if self.displacement and self.position:
            remedy = "Give displacement for a force, position for a motor"
            raise DescriptionError("end of a path", "a displacement and a position are given", remedy)
        whole("frames until the end of a path", self.frames, least=2)

    @property
    def displacements(self) -> tuple[float, ...]:
        """Displacements or positions, whichever are given."""
        return _several(self.displacement or self.position)

    @property
    def forces(self) -> tuple[float, ...]:
        """Magnitudes of the force."""
        return _several(self.force)


def _several(given: float | Iterable[float]) -> tuple[float, ...]:
    return tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)


def read_path(
    mechanism: Mechanism,
    part: PrescribedPart,
    until: object,
    configuration: Configuration,
    others: Mapping[Force, float] | None,
) -> CurveRequest:
    """The request for a curve that is followed, if it makes sense for ``mechanism``."""
    if isinstance(part, Motor | Drive):
        check_motors(mechanism, f"{part.name!r}", part.ratios, "Add it with motor()")
    else:
        check_force(mechanism, part)
    constant = read_others(mechanism, part, configuration, others)
    check_until(until, part)
    return CurveRequest(part, (), configuration, constant)


def check_until(until: object, part: PrescribedPart) -> None:
    """Refuses an end that the path of ``part`` does not have."""
    has, lacks = ("displacement", "position") if isinstance(part, Force | ForceGroup) else ("position", "displacement")
    if not isinstance(until, Until):
        raise DescriptionError("end of a path", f"{until!r} does not say where it ends", f"Give until=Until({has}=…)")
    if getattr(until, lacks):
        raise DescriptionError(
            "end of a path", f"{part.name!r} is prescribed, which has no {lacks}", f"Give its {has}=…"
        )


@dataclass(frozen=True, eq=False)
class PathEvent:
    """A critical point of a followed curve.

    Attributes:
        kind: limit point of the force, turning point of the displacement or of a motor, or bifurcation.
        frame: the equilibrium, which is also one of the curve's frames.
        index: of that frame.
        null_space: at a bifurcation a basis of the KKT matrix's null space, one direction for each of the modes that
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
        """Value of the prescribed part where the KKT matrix is singular; the frame is the nearest equilibrium found."""
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
        """Limit points: under a dead load the mechanism snaps there."""
        return self._of(Critical.LIMIT)

    @property
    def turning_points(self) -> tuple[PathEvent, ...]:
        """Turning points: under a prescribed displacement the mechanism snaps there."""
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


def branches(
    curve: FollowedCurve, event: PathEvent, until: Until, steps: ArcSteps, mode: ModeShape | None
) -> tuple[FollowedCurve, FollowedCurve]:
    """The curve that crosses another one, in both directions, like ``Simulation.branches``."""
    check_until(until, curve.part)
    if event not in curve.bifurcations:
        raise DescriptionError(
            "branches", "the event is not a bifurcation of the curve", "Choose from its bifurcations"
        )
    if mode is None and event.modes != 1:
        raise DescriptionError(
            "branches",
            f"{event.modes} modes become unstable at once: {', '.join(shape.link for shape in event.null_space)}",
            "Choose one with mode=event.null_space[…], or break the symmetry slightly",
        )
    if mode is not None and mode not in event.null_space:
        raise DescriptionError("branches", "the mode does not belong to the event", "Choose from its null_space")
    request = CurveRequest(curve.part, (), curve.configuration, curve.others)

    def branch(sense: Sense) -> FollowedCurve:
        follower = CurveFollower(curve.discretisation, request, until, steps)
        return follower.from_bifurcation(event, mode or event.mode, sense)

    with curve.discretisation.model.shaped(event.frame.design):
        return branch(Sense.ALONG), branch(Sense.AGAINST)


class CurveFollower:
    """The path of one request, until an end."""

    def __init__(self, discretisation: Discretisation, request: CurveRequest, until: Until, steps: ArcSteps) -> None:
        self._stepper, self._until, self._steps = CurveStepper(discretisation, request), until, steps
        self._followed, self._system = self._stepper.followed, self._stepper.solver.system
        self._frames, self._events = self._stepper.frames, list[PathEvent]()

    def from_rest(self, watch: Callable[[int], None]) -> FollowedCurve:
        """The curve from the configuration without the controlled force; ``watch`` gets the number of frames so far."""
        rest = self._stepper.frame(LoadControl(0.0))
        self._frames.append(rest)
        try:
            state = rest.state
            if self._drifts:
                state = self._stepper.start(LoadControl(self._sense(rest))).state
                if not (free := self._within(self._conjugate(state), rest)):
                    self._frames.append(self._first_loaded(state, rest))
                    state = self._frames[-1].state
                    free = self._within(self._frames[-1].displacement, rest)
                if free:
                    return self._moved_freely(free, rest, watch)
            path = self._path(state)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        start, finishes = path.start, self._finishes(path)
        # towards the first displacement or position that is wanted, or else the first force
        wanted = next((finish for finish in finishes if finish.end != finish.value(start)), None)
        if wanted and (wanted.end - wanted.value(start)) * wanted.rate(start) < 0.0:
            start = start.scaled(-1.0)
        return self._follow(path, start, watch)

    @property
    def _drifts(self) -> bool:
        """Whether nothing but loads holds the mechanism, and a force is followed."""
        return self._stepper.adrift and not self._followed.displaces

    def _sense(self, rest: Frame) -> float:
        """Sign of the force from ``rest`` towards the first displacement that is wanted, or else the first force."""
        ways = (end - rest.displacement for end in self._until.displacements if end)
        return next((end for end in (*ways, *self._until.forces) if end), 1.0)

    def _within(self, travel: float, rest: Frame) -> tuple[float, ...]:
        """The wanted displacements that the point reaches without a force, which moves freely from ``rest`` as far as
        ``travel``: constant loads that have taken it there would resist on the way back."""
        way = travel - rest.displacement
        free = abs(way) + RestSearch().near * self._system.joints.length
        ends = ((end, end - rest.displacement) for end in self._until.displacements)
        return tuple(end for end, ahead in ends if ahead * way > 0.0 and abs(ahead) <= free)

    def _moved_freely(self, ends: Sequence[float], rest: Frame, watch: Callable[[int], None]) -> FollowedCurve:
        """The curve from ``rest`` on which nothing resists, until the first of ``ends``."""
        stepper, begin = self._stepper, rest.displacement
        first = min(ends, key=lambda end: abs(end - begin))
        controls = (DisplacementControl(begin), DisplacementControl(first))
        moved = CurveStepper(stepper.discretisation, replace(stepper.request, controls=controls))
        return self._curve(moved.curve(watch).frames)

    def _first_loaded(self, state: State, rest: Frame) -> Frame:
        """An equilibrium near ``state``, under a small part of the force at the path's end; ``rest`` is without it."""
        reach, conjugate = self._changes(state)
        if conjugate:
            point = equilibrium_at(self._stepper.solver, self._followed, state)
            # of the point itself: rounding turns what nothing holds yet
            rate = agreed(self._system.comm, abs(point.conjugate_rate)) / self._system.joints.length
            moves = rate > self._system.ideal_compliance
            reach = linear_reach(point, value=reach, conjugate=conjugate) if moves else 0.0
        if not 0.0 < reach < math.inf:
            raise NotConverged(f"it moves nothing beyond displacement {self._conjugate(state):g}, where travel ends")
        least = math.copysign(self._steps.first_load * reach, self._sense(rest))
        try:
            return self._stepper.frame(LoadControl(least))
        except EquilibriumError as lost:  # in rounding
            try:
                return self._stepper.frame(LoadControl(_FELT * least))
            except EquilibriumError:
                raise lost from None

    def from_bifurcation(self, event: PathEvent, mode: ModeShape, sense: Sense) -> FollowedCurve:
        """The curve that crosses another one at ``event`` along ``mode``."""
        rest = self._stepper.frame(LoadControl(0.0))  # the tangent at the bifurcation has no scale
        self._frames.append(event.frame)
        try:
            if self._drifts:
                rest = self._first_loaded(self._stepper.start(LoadControl(self._sense(rest))).state, rest)
            path = self._path(rest.state)
            first = crossing(path, event.critical, mode.step, sense)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        self._frames.append(self._stepper.recorder.frame(first))
        return self._follow(path, first, lambda done: None)

    def _follow(self, path: ArcLengthStepper, start: EquilibriumPoint, watch: Callable[[int], None]) -> FollowedCurve:
        stepper, clock = self._stepper, self._stepper.discretisation.clock
        steps = path.follow(start, self._finishes(path), most=self._until.frames - len(self._frames))
        while True:
            began, seconds = perf_counter(), dict(clock.seconds)
            try:
                with stepper.keeping_frames():
                    if (ends := next(steps, None)) is None:
                        break
                for critical in locate(path, *ends):
                    self._record_event(path, critical)
            except NotConverged as failure:
                raise self._ended(failure) from failure
            frame = stepper.recorder.frame(ends[1])
            self._frames.append(replace(frame, seconds=perf_counter() - began, phases=clock.since(seconds)))
            watch(min(len(self._frames), self._until.frames))  # critical points are additional frames
        return self._curve(self._frames)

    def _curve(self, frames: Sequence[Frame]) -> FollowedCurve:
        """The curve of ``frames``, with the events so far."""
        stepper, request = self._stepper, self._stepper.request
        return FollowedCurve(
            request.part,
            request.configuration,
            stepper.freedom,
            tuple(frames),
            stepper.discretisation,
            stepper.unloaded,
            others=request.others,
            # loads have limit points, where no displacement belongs to a slightly larger one
            unknown=Unknown.FORCE,
            events=tuple(self._events),
        )

    def _record_event(self, path: ArcLengthStepper, critical: CriticalPoint) -> None:
        if critical.kind is Critical.BIFURCATION:
            steps = null_space(path, critical)
        else:
            step = critical.point.tangent
            steps = [step.scaled(1.0 / path.system.size(step))]
        frame = self._stepper.recorder.frame(critical.point)
        modes = tuple(mode_shape(self._stepper.discretisation.model, step) for step in steps)
        self._events.append(PathEvent(critical.kind, frame, len(self._frames), modes, critical))
        self._frames.append(frame)

    def _path(self, state: State) -> ArcLengthStepper:
        """The path through ``state``, in units of its ends."""
        value, conjugate = self._changes(state)
        solver, steps = self._stepper.solver, self._steps
        return ArcLengthStepper(solver, self._followed, state, steps=steps, value=value, conjugate=conjugate)

    def _changes(self, state: State) -> tuple[float, float]:
        """Largest changes from ``state`` to wanted values of the followed control, and of its conjugate; 0 if none is
        wanted."""
        until, conjugate = self._until, self._conjugate(state)
        value = agreed(self._system.comm, self._followed.value(self._system, state))
        values, conjugates = until.displacements, until.forces
        if not self._followed.displaces:
            values, conjugates = conjugates, values
        farthest = max((abs(end - value) for end in values), default=0.0)
        return farthest, max((abs(end - conjugate) for end in conjugates), default=0.0)

    def _finishes(self, path: ArcLengthStepper) -> list[Finish]:
        """Displacements or positions first, then forces."""
        origin, opposite = self._stepper.recorder.origin, self._followed.opposite
        followed = path.value, path.value_rate, self._followed.at

        def prescribed(end: float) -> DisplacementControl | None:
            return opposite.at(end + origin) if opposite else None

        conjugate = (lambda point: self._conjugate(point.state)), (lambda point: point.conjugate_rate), prescribed
        displacement, force = (followed, conjugate) if self._followed.displaces else (conjugate, followed)
        return [
            Finish(value, rate, end, max(map(abs, ends)) or 1.0, control(end))
            for (value, rate, control), ends in ((displacement, self._until.displacements), (force, self._until.forces))
            for end in ends
        ]

    def _conjugate(self, state: State) -> float:
        """The conjugate of the followed value, the same on all processes; displacements count from the unloaded
        configuration."""
        self._system.load(state)
        origin = 0.0 if self._followed.displaces else self._stepper.recorder.origin
        return agreed(self._system.comm, self._followed.conjugate(self._system, state) - origin)

    def _ended(self, failure: NotConverged) -> EquilibriumError:
        stepper, last = self._stepper, self._frames[-1]
        across, up = axes(stepper.request.part, stepper.discretisation.scene.units)
        return stepper.error(
            f"path of {stepper.request.where}",
            f"it cannot be followed beyond {across.quantity} {across(last.displacement, 6)} at {up.quantity} "
            f"{up(last.force, 6)} ({failure})",
            last,
            otherwise="End it earlier, allow smaller steps with ArcSteps(smallest=…), or use a finer mesh",
        )
