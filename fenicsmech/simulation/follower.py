"""Follows a load–displacement curve past limit points, recording frames and events."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from fenicsmech.equilibrium import (
    ArcLength,
    ArcSteps,
    Critical,
    CriticalPoint,
    Finish,
    Iteration,
    LoadControl,
    NotConverged,
    PathPoint,
    PathPoints,
    Sense,
    State,
    crossing,
    follow,
    metric_at,
    null_space,
)
from fenicsmech.errors import EquilibriumError
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.buckling import ModeShape, mode_shape
from fenicsmech.simulation.followed import PathEvent
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.leading import leading
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
    ) -> None:
        self._model, self._newton, self._request, self._tracer = model, newton, request, tracer
        self._until, self._steps, self._lead = until, steps, leading(request.part).lead(model.linkage.joints)
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
            start = arc.points.at(first.state)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        finishes = self._finishes()
        # towards the first displacement or position that is wanted, or else the first force
        wanted = [*(finish for finish in finishes if finish.target != finish.value(start))][:1]
        if wanted and (wanted[0].target - wanted[0].value(start)) * wanted[0].rate(start) < 0.0:
            start = start.reversed()
        self._walk(arc, start, finishes, watch)

    def from_bifurcation(self, event: PathEvent, mode: ModeShape, sense: Sense, watch: Callable[[int], None]) -> None:
        """Follows the path that crosses another one at ``event`` along ``mode``.

        Raises:
            EquilibriumError: the path is not found, or ends early; carries the frames before that.
        """
        self.frames.append(event.frame)
        rest = self._tracer.frame(LoadControl(0.0), ())  # the tangent at the bifurcation tells no scale
        try:
            arc = self._arc(rest.state)
            first = crossing(arc, event.critical, mode.step, sense)
        except NotConverged as failure:
            raise self._ended(failure) from failure
        self.frames.append(self._tracer.record(first.solution()))
        self._walk(arc, first, self._finishes(), watch)

    def _walk(self, arc: ArcLength, start: PathPoint, finishes: list[Finish], watch: Callable[[int], None]) -> None:
        clock = self._model.clock
        path = follow(arc, start, finishes, most=self._until.frames - len(self.frames))
        while True:
            began, seconds = perf_counter(), dict(clock.seconds)
            try:
                stretch = next(path, None)
                if stretch is None:
                    return
                for critical in stretch.critical:
                    self._record_event(arc, critical)
            except NotConverged as failure:
                raise self._ended(failure) from failure
            frame = self._tracer.record(stretch.point.solution())
            self.frames.append(replace(frame, seconds=perf_counter() - began, phases=clock.since(seconds)))
            watch(min(len(self.frames), self._until.frames))  # critical points come on top

    def _record_event(self, arc: ArcLength, critical: CriticalPoint) -> None:
        if critical.kind is Critical.BIFURCATION:
            steps = null_space(arc.points, critical)
        else:
            step = critical.point.tangent.step
            steps = [step.scaled(1.0 / arc.points.system.size(step))]
        frame = self._tracer.record(critical.point.solution())
        modes = tuple(mode_shape(self._model, step) for step in steps)
        self.events.append(PathEvent(critical.kind, frame, len(self.frames), modes, critical))
        self.frames.append(frame)

    def _arc(self, state: State) -> ArcLength:
        """The continuation from ``state``, in units of what is asked for."""
        until, lead = self._until, self._lead
        p, q = lead.value(state), self._conjugate(state)
        (of_value, of_conjugate) = (until.travel, until.force) if lead.displaces else (until.force, until.travel)
        parameter = max((abs(target - p) for target in of_value), default=0.0)
        conjugate = max((abs(target - q) for target in of_conjugate), default=0.0)
        metric = metric_at(self._newton, lead, state, parameter=parameter, conjugate=conjugate)
        points = PathPoints(self._newton, lead, metric)
        return ArcLength(points, steps=self._steps, conjugate_reference=conjugate or math.inf)

    def _finishes(self) -> list[Finish]:
        """Displacements or positions first, then forces."""
        lead, until = self._lead, self._until
        value = (lambda point: lead.value(point.state)), (lambda point: point.tangent.parameter)
        conjugate = (lambda point: self._conjugate(point.state)), (lambda point: point.conjugate)
        travel, force = (value, conjugate) if lead.displaces else (conjugate, value)
        return [
            Finish(*quantity, target, max(map(abs, targets)) or 1.0)
            for quantity, targets in ((travel, until.travel), (force, until.force))
            for target in targets
        ]

    def _conjugate(self, state: State) -> float:
        """As on curves, displacements from the unloaded configuration."""
        self._newton.system.load(state)
        origin = 0.0 if self._lead.displaces else self._tracer.origin
        return self._lead.conjugate(self._newton.system, state) - origin

    def _ended(self, failure: NotConverged) -> EquilibriumError:
        last, lead = self.frames[-1], leading(self._request.part)
        return EquilibriumError(
            f"path of {self._request.part.name!r} in configuration {self._request.configuration.name!r}",
            f"it cannot be followed beyond {lead.across} {last.displacement:g} at {lead.up} {last.force:g} ({failure})",
            "End it before, allow smaller steps with ArcSteps(smallest=…), or use a finer mesh",
            last=last,
            frames=self.frames,
        )
