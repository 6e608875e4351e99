"""Follows a load–displacement curve past limit points, recording frames and events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from fenicsmech.equilibrium import (
    IDLE_STIFFNESS,
    ArcLength,
    ArcSteps,
    Critical,
    CriticalPoint,
    ForceLead,
    Goal,
    Iteration,
    LoadControl,
    NotConverged,
    PathPoint,
    Sense,
    State,
    crossing,
    follow,
    metric_at,
    null_vector,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.simulation.followed import PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.mode_shape import mode_shape
from fenicsmech.simulation.model import MechanismModel
from fenicsmech.simulation.request import CurveRequest
from fenicsmech.simulation.tracer import Tracer
from fenicsmech.simulation.until import Until


class Follower:
    """The path of one request (all methods are collective).

    Args:
        model: the discretised mechanism.
        newton: the solver for the request's forces.
        request: what is asked for.
        tracer: of the same request.
        until: where the path ends.
        steps: how finely it is followed.
        idle: whether the mechanism has freedoms without stiffness.
    """

    def __init__(
        self,
        model: MechanismModel,
        newton: Iteration,
        request: CurveRequest,
        tracer: Tracer,
        *,
        until: Until,
        steps: ArcSteps,
        idle: bool,
    ) -> None:
        self._model, self._newton, self._request, self._tracer = model, newton, request, tracer
        self._until, self._steps, self._lead = until, steps, ForceLead()
        self._floor = IDLE_STIFFNESS if idle else 0.0
        self.frames: list[Frame] = []
        self.events: list[PathEvent] = []

    def from_rest(self, watch: Callable[[int], None]) -> None:
        """Follows the path from the configuration without the force that leads.

        Raises:
            EquilibriumError: the path ends early; carries the frames before that.
        """
        first = self._tracer.frame(LoadControl(0.0), ())
        self.frames.append(first)
        try:
            arc = self._arc(first.state)
            start = arc.start(first.state)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        goals = self._goals()
        # towards the first displacement that is wanted, or else the first force
        wanted = [*(goal for goal in goals if goal.target != goal.value(start))][:1]
        if wanted and (wanted[0].target - wanted[0].value(start)) * wanted[0].rate(start) < 0.0:
            start = start.reversed()
        self._walk(arc, start, goals, watch)

    def from_bifurcation(self, event: PathEvent, sense: Sense, watch: Callable[[int], None]) -> None:
        """Follows the path that crosses another one at ``event``.

        Raises:
            EquilibriumError: the path is not found, or ends early; carries the frames before that.
        """
        self.frames.append(event.frame)
        rest = self._tracer.frame(LoadControl(0.0), ())  # the tangent at the bifurcation tells no scale
        try:
            arc = self._arc(rest.state)
            first = crossing(arc, event.critical, event.mode.step, sense)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        self.frames.append(self._tracer.record(first.solution()))
        self._walk(arc, first, self._goals(), watch)

    def _walk(self, arc: ArcLength, start: PathPoint, goals: list[Goal], watch: Callable[[int], None]) -> None:
        clock = self._model.clock
        path = follow(arc, start, goals, most=self._until.frames - len(self.frames))
        while True:
            began, seconds = perf_counter(), dict(clock.seconds)
            try:
                stretch = next(path, None)
            except NotConverged as failure:
                raise self._ended(failure) from failure
            if stretch is None:
                return
            for critical in stretch.critical:
                self._record_event(arc, critical)
            frame = self._tracer.record(stretch.point.solution())
            self.frames.append(replace(frame, seconds=perf_counter() - began, phases=clock.since(seconds)))
            watch(len(self.frames))

    def _record_event(self, arc: ArcLength, critical: CriticalPoint) -> None:
        if critical.kind is Critical.BIFURCATION:
            step = null_vector(arc, critical)
        else:
            step = critical.point.tangent.step
            step = step.scaled(1.0 / arc.system.size(step))
        frame = self._tracer.record(critical.point.solution())
        mode = mode_shape(self._model, step)
        self.events.append(PathEvent(critical.kind, frame, len(self.frames), mode, critical))
        self.frames.append(frame)

    def _arc(self, state: State) -> ArcLength:
        """The continuation, in units of what is asked for."""
        forces = [abs(force) for force in self._until.force if force]
        travels = [abs(displacement) for displacement in self._until.displacement if displacement]
        metric = metric_at(
            self._newton,
            self._lead,
            state,
            floor=self._floor,
            parameter=max(forces, default=None),
            travel=max(travels, default=None),
        )
        return ArcLength(
            self._newton,
            self._lead,
            metric,
            steps=self._steps,
            floor=self._floor,
            travel_reference=max(travels, default=float("inf")),
        )

    def _goals(self) -> list[Goal]:
        lengths = [abs(displacement) for displacement in self._until.displacement]
        forces = [abs(force) for force in self._until.force]
        return [
            Goal(self._displacement, lambda point: point.travel, target, max(lengths) or 1.0)
            for target in self._until.displacement
        ] + [
            Goal(lambda point: point.state.force, lambda point: point.tangent.parameter, target, max(forces) or 1.0)
            for target in self._until.force
        ]

    def _displacement(self, point: PathPoint) -> float:
        """As on curves: from the unloaded configuration."""
        self._newton.system.load(point.state)
        return self._newton.system.load_displacement(point.state) - self._tracer.origin

    def _ended(self, failure: NotConverged) -> EquilibriumError:
        last = self.frames[-1]
        return EquilibriumError(
            f"path of {self._request.force.name!r} in configuration {self._request.configuration.name!r}",
            f"it cannot be followed beyond displacement {last.displacement:g} at force {last.force:g} ({failure})",
            "End it before, allow smaller steps with ArcSteps(smallest=…), or use a finer mesh",
            last=last,
            frames=self.frames,
        )
