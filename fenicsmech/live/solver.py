"""The solver process of the live page: tasks come as lines of JSON on standard input, results go to standard output.

A task holds the whole project, so that a process that was ended loses nothing. A new task cancels the one at work, at
the next iteration of Newton's method or the next factor (``cancel``), and so does the end of its time.
``messages`` describes tasks and results.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from itertools import takewhile
from time import perf_counter
from typing import Any, TextIO

import numpy as np

from fenicsmech.design import DesignIterate, DesignLinearisation, DesignProblem, HandlePlacement, LevenbergMarquardt
from fenicsmech.equilibrium import PrimalDualNewton
from fenicsmech.errors import DescriptionError, EquilibriumError, FenicsmechError
from fenicsmech.live.build import Drawing, draw, placement
from fenicsmech.live.cancel import Cancellable, Cancelled, TooLong
from fenicsmech.live.grip import Grip
from fenicsmech.live.problems import explained, missed, remarks, too_long
from fenicsmech.live.project import Project, drawing, forces_of
from fenicsmech.live.responses import (
    LoadChange,
    Outlines,
    by_force,
    by_motor,
    curve_slopes,
    displacement,
    responses,
    shifted,
    turned,
)
from fenicsmech.mechanism import Force
from fenicsmech.plot import MechanismShape
from fenicsmech.polygons import edge_loops
from fenicsmech.quantities import NumberKind
from fenicsmech.simulation import Curve, Frame, MechanismPlotter, Simulation, gather
from fenicsmech.stress import von_mises

Emit = Callable[[dict[str, Any]], None]

# the last per cents of the objective belong to the closeness to the drawing, which nobody sees
OPTIMISER = LevenbergMarquardt(tolerance=0.05)

_SHIFT = 1e-3  # of the size of elements: how far points of forces are moved for derivatives, within what is on a link


class Solver:
    """What the process keeps from task to task: the last drawing, meshed, and its problems.

    Args:
        emit: sends a result.
        cancelled: whether another task has come.
    """

    def __init__(self, emit: Emit, cancelled: Callable[[], bool] = lambda: False) -> None:
        self._emit, self._cancelled = emit, cancelled
        self._method = PrimalDualNewton(linear=Cancellable(self.check))
        self._end = math.inf  # of the time of the task at work
        self._drawn: tuple[str, Drawing] | None = None
        self._problems: dict[str, DesignProblem | None] = {}
        self._grip: tuple[str, Grip] | None = None

    def run(self, task: Mapping[str, Any]) -> None:
        """Does a task, whose results carry its number."""
        began, number, longest = perf_counter(), task["task"], task.get("longest", math.inf)
        self._end = began + longest

        def emit(event: dict[str, Any]) -> None:
            self._emit({**event, "task": number})

        emit({"event": "began"})
        try:
            if task["kind"] == "solve":
                self.let_go()
                Work(self, emit, task).solve()
            elif task["kind"] == "push":
                Work(self, emit, task).push()
            emit({"event": "done", "seconds": round(perf_counter() - began, 3)})
        except Cancelled:
            emit({"event": "cancelled"})
        except TooLong:
            emit({"event": "failed", **too_long(longest)})
        except FenicsmechError as error:
            emit({"event": "failed", **explained(error)})
        except Exception as error:  # whatever happens here, the next gesture is answered
            reason = f"{type(error).__name__}: {error}"
            emit({"event": "failed", "part": "solver", "problem": reason[:400], "remedy": "Undo the last change"})

    def check(self) -> None:
        """Raises Cancelled if another task has come, and TooLong if the time of this one is over."""
        if self._cancelled():
            raise Cancelled
        if perf_counter() > self._end:
            raise TooLong

    def drawing(self, project: Project) -> Drawing:
        """The drawing of a project, made when it is new."""
        text = drawing(project)
        if self._drawn is None or self._drawn[0] != text:
            self._drawn, self._problems, self._grip = None, {}, None
            self._drawn = text, draw(project, self._method)
        return self._drawn[1]

    def grip(self, key: str, make: Callable[[], Grip]) -> Grip:
        """What the pointer holds, made when it is new; the one before is released."""
        if self._grip is None or self._grip[0] != key:
            self.let_go()
            self._grip = key, make()
        return self._grip[1]

    def let_go(self) -> None:
        """Releases what the pointer held."""
        if self._grip is not None:
            self._grip[1].release()
        self._grip = None

    def problem(
        self, sort: str, project: Project, make: Callable[[Project], DesignProblem | None]
    ) -> DesignProblem | None:
        """A problem of the present drawing, made when its curves, targets or requirements are new."""
        asked = [project["curves"], project["targets"], project.get("requirements")]
        key = f"{sort} {json.dumps(asked, sort_keys=True)}"
        if key not in self._problems:
            if len(self._problems) > 3:  # those of earlier gestures
                self._problems.clear()
            self._problems[key] = make(project)
        return self._problems[key]


class Work:
    """One task.

    Args:
        solver: with the drawings and problems of the tasks before.
        emit: sends a result of this task.
        task: as ``messages`` describes it.
    """

    def __init__(self, solver: Solver, emit: Emit, task: Mapping[str, Any]) -> None:
        self._solver, self._emit, self._task = solver, emit, task
        self._project: Project = task["project"]
        self._drawing = solver.drawing(self._project)
        solver.check()  # what follows meshes
        self._along: DesignProblem | None = solver.problem("curves", self._project, self._drawing.along_curves)
        # bending varies within cells
        self._plotter = MechanismPlotter(self._drawing.simulation.model, parts=2)
        solver.check()
        self._meshed, self._shown = False, np.zeros(0)
        self._steady: dict[int, list[float]] = {}  # values of each curve, up to where it snaps or is unstable
        self._solved: dict[int, tuple[Curve | None, list[Frame]]] = {}  # each curve, with the frames of these values

    def solve(self) -> None:
        """The curves of the project's design; before that its optimisation where wanted; derivatives at the end."""
        at, problem = placement(self._project, self._along), None
        if self._task["fit"]:
            problem = self._solver.problem("targets", self._project, self._drawing.problem)
        if problem is not None:
            own = problem
            equal = all(target.relation == "equals" for target in own.targets)
            optimiser = OPTIMISER if equal else None
            result = own.optimise(start=at, surrogate=None, optimiser=optimiser, watch=lambda it: self._show(own, it))
            at = own.placement(result)
            self._emit(
                {
                    "event": "fitted",
                    "design": _design(own, at),
                    "misfits": _rounded([target.error for target in result.targets]),
                    "missed": missed(result),
                    "iterations": result.iterations,
                }
            )
        self._curves(self._drawing.simulation if at is None else self._designed(at))
        self._linearise(at)
        if self._project.get("requirements"):
            self._require(at)

    def push(self) -> None:
        """The equilibrium under the force of a curve and that of the pointer at a point, with its linear responses."""
        at, number, task = placement(self._project, self._along), self._task["curve"], self._task
        simulation = self._drawing.simulation if at is None else self._designed(at)
        request = self._drawing.request(self._project, number, [task["force"]], pushed=True)
        held, by = task["at"], task["by"]
        part = self._drawing.forces[self._project["curves"][number]["force"]]
        forces: Sequence[Force] = [part]
        if held is None:
            curve = simulation.compute(request)
        else:

            def grip() -> Grip:
                link, start = self._drawing.links[held["link"]], simulation.compute(request)
                return Grip(simulation, self._plotter, start, link, held["place"])

            own = self._solver.grip(json.dumps([self._project, number, task["force"], held]), grip)
            curve = simulation.compute(own.pulled(request, by)) if any(by) else own.start
            forces = own.forces
        frame, model = curve.frames[-1], simulation.model
        solver = simulation.solver(curve.part, [force for force, _ in curve.others])
        rates = responses(model, self._plotter, solver, frame, [by_force(model, force) for force in forces])
        moved = displacement(model, part, frame, curve.unloaded)
        self._emit(
            {
                "event": "pushed",
                "curve": number,
                "at": held,
                "by": by,
                "point": {**self._point(frame), "force": task["force"], "displacement": _number(moved)},
                "rates": [_rates(own) for own in rates],
            }
        )

    # -- parts of tasks ------------------------------------------------------------------------------------------

    def _designed(self, at: HandlePlacement) -> Simulation:
        assert self._along is not None, "a project with a design has links that change"
        return self._drawing.simulation.with_design(self._along.rest_shape(at))

    def _show(self, problem: DesignProblem, found: DesignIterate) -> None:
        """An iterate as it comes: its design and values first, then its curves."""
        self._solver.check()
        self._emit(
            {
                "event": "iterate",
                "number": found.number,
                "design": _design(problem, found.placement),
                "values": _rounded(found.values),
                "misfits": _rounded(found.errors),
            }
        )
        if found.number and not np.array_equal(found.placement.p, self._shown):
            self._shown = found.placement.p
            simulation = self._drawing.simulation.with_design(problem.rest_shape(found.placement))
            self._curves(simulation, iterate=found.number)

    def _curves(self, simulation: Simulation, iterate: int | None = None) -> None:
        """All curves; those of no ``iterate`` with estimated errors."""
        for number in range(len(self._project["curves"])):
            forces = forces_of(self._project, number, coarse=iterate is not None)
            request, failure, curve = self._drawing.request(self._project, number, forces), None, None
            try:
                curve = simulation.compute(request)
                frames = curve.frames
            except EquilibriumError as error:
                failure, frames = error, error.frames
            self._emit(
                {
                    "event": "curve",
                    "curve": number,
                    "iterate": iterate,
                    "points": [self._point(own) for own in frames],
                    "remarks": [] if curve is None else remarks(curve),
                    "failed": failure and explained(failure),
                }
            )
            if iterate is None:
                held = self._project["curves"][number].get("held", False)
                stable = [own.stable_under_control if held else own.stable for own in frames]
                good = [own and not frame.snapped_through for own, frame in zip(stable, frames, strict=True)]
                pairs = zip(forces, frames, good, strict=False)  # fewer frames where it failed
                steady = [(value, frame) for value, frame, _ in takewhile(lambda pair: pair[2], pairs) if value]
                self._steady[number] = [value for value, _ in steady]
                self._solved[number] = curve, [frame for _, frame in steady]
            if curve is not None and iterate is None:
                self._respond(number, curve)
                peak = curve.frames[-1].peak
                own = peak and {"value": _number(peak.value), "error": _number(peak.error), "link": peak.link}
                errors = _rounded(curve.error_estimates())
                self._emit({"event": "errors", "curve": number, "errors": errors, "peak": own})

    def _respond(self, number: int, curve: Curve) -> None:
        """How the picture changes with the force at the end of a curve, and with each motor at its begin; not of forces
        that grow together, nor of displacements that are held."""
        model, part, first, last = self._drawing.simulation.model, curve.part, curve.frames[0], curve.frames[-1]
        if not isinstance(part, Force) or self._project["curves"][number].get("held"):
            return
        solver = self._drawing.simulation.solver(part, [force for force, _ in curve.others])
        motors = self._drawing.motors
        turned = [by_motor(model, own) for own in motors.values()]
        ends = responses(model, self._plotter, solver, last, [by_force(model, part)])
        begins = responses(model, self._plotter, solver, first, turned) if turned else []
        self._emit(
            {
                "event": "responses",
                "curve": number,
                "end": next((_rates(own) for own in ends), None),
                "motors": {name: _rates(own) for name, own in zip(motors, begins, strict=False)},
            }
        )

    def _linearise(self, at: HandlePlacement | None) -> None:
        """What the page's linear preview needs."""
        along = self._along
        if along is None:
            return
        numbers = range(len(self._project["curves"]))
        reached = [[force for force in forces_of(self._project, number) if force] for number in numbers]
        whole = [self._steady[number] for number in numbers] == reached
        if not whole:  # a curve has no derivatives where it snaps: up to there
            reached = [self._steady[number] for number in numbers]
            along = self._drawing.along_curves(self._project, reached) if all(reached) else None
            if along is None:
                return
        try:
            movable, found = self._with_moves(along, along.initial if at is None else at)
        except EquilibriumError:
            return  # the curve that ends early is reported already
        self._solver.check()
        loads, by_loads = self._with_loads()
        rows, curves = 0, []
        for values, curve, slopes in zip(reached, self._project["curves"], by_loads, strict=True):
            mine = slice(rows, rows + len(values))
            rows += len(values)
            if "ratios" in curve:  # no displacements of one force under it
                values, mine, slopes = [], slice(0), slopes[:0]
            slopes = np.hstack([found.jacobian[mine], found.by_numbers[mine], slopes])
            own = {"values": found.values[mine], "errors": found.errors[mine], "jacobian": slopes}
            curves.append({"at": values, **{key: _rounded(value) for key, value in own.items()}})
        drawn = {own["name"]: own["shape"] for own in self._project["links"] if own["kind"] == "flexible"}
        self._emit(
            {
                "event": "linear",
                "design": _design(along, found.placement),
                "lengths": _rounded(found.lengths),
                "moves": [own for own, _ in movable] + loads,
                "positions": [own["positions"] for own in self._project["curves"]],
                "curves": curves,
                "gradient": _rounded(found.regulariser.gradient),
                "curvature": _rounded(found.regulariser.curvature),
                "active": list(found.active),
                "whole": whole,
                "links": [
                    {
                        "name": link.name,
                        "controls": _rounded(link.controls),
                        "entries": entries.tolist(),
                        "follows": _rounded(np.pad(follows, [(0, 0)] * 3 + [(0, len(loads))])),
                        "thickness": drawn[link.name].get("thickness"),
                    }
                    for link, entries, follows in zip(
                        found.links, found.entries, found.controls_by_numbers, strict=True
                    )
                ],
            }
        )

    def _with_loads(self) -> tuple[list[dict[str, Any]], list[np.ndarray]]:
        """Directions and points of the forces of curves, as the page names them, and the derivatives of each curve by
        these, (values, loads); none where a curve ends early or is at a bifurcation.

        A force over a region acts at no single point.
        """
        names: list[dict[str, Any]] = []
        changes: list[LoadChange] = []
        for name in dict.fromkeys(curve["force"] for curve in self._project["curves"]):
            force = self._drawing.forces[name]
            names.append({"kind": "direction", "name": name})
            changes.append(turned(force))
            for axis in range(2 if force.region is None else 0):
                names.append({"kind": "force", "name": name, "axis": axis})
                changes.append(shifted(force, axis, _SHIFT * self._project["simulation"]["size"]))
        found = []
        for number, curve in enumerate(self._project["curves"]):
            solved, frames = self._solved[number]
            if "ratios" in curve:
                found.append(np.zeros((len(frames), len(names))))
                continue
            if solved is None:
                return [], [np.zeros((len(own), 0)) for _, own in self._solved.values()]
            simulation, held = self._drawing.simulation, curve.get("held", False)
            solver = simulation.solver(solved.part, [force for force, _ in solved.others])
            slopes = curve_slopes(simulation.model, solver, solved, frames, changes, held=held)
            self._solver.check()
            if slopes is None:
                return [], [np.zeros((len(own), 0)) for _, own in self._solved.values()]
            found.append(slopes)
        return names, found

    def _require(self, at: HandlePlacement | None) -> None:
        """Values of what is required beside the targets on curves."""
        problem = self._solver.problem("targets", self._project, self._drawing.problem)
        if problem is None:
            return
        try:
            found = problem.linearise(problem.initial if at is None else at)
        except EquilibriumError as error:
            self._emit({"event": "required", "values": [], "failed": explained(error)})
            return
        rows = np.split(found.values + found.errors, np.cumsum([target.size for target in problem.targets])[:-1])
        wanted = rows[len(self._project["targets"]) :]
        self._emit({"event": "required", "values": [_rounded(own) for own in wanted], "failed": None})

    def _with_moves(
        self, along: DesignProblem, at: HandlePlacement | np.ndarray
    ) -> tuple[list[tuple[dict[str, Any], NumberKind]], DesignLinearisation]:
        """The derivatives at a design, and what they are taken by beside it: motors alone where links cannot follow."""
        movable = self._drawing.movable(self._project)
        for own in (movable, [(name, kind) for name, kind in movable if name["kind"] == "motor"]):
            try:
                return own, along.linearise(at, numbers=[kind for _, kind in own])
            except DescriptionError:
                continue
        return [], along.linearise(at)

    def _point(self, frame: Frame) -> dict[str, Any]:
        """A frame as the page draws it, its mesh sent once before."""
        self._solver.check()
        plotter, snapshot = self._plotter, gather(self._drawing.simulation.model, frame)
        assert snapshot is not None, "there is one process"
        recovered = frame.stresses.at(frame.state, frame.design, lambda _: plotter.places(snapshot))
        assert recovered is not None, "there is one process"
        shape, stress = plotter.shape(snapshot, von_mises(recovered.stress)), []
        for own in shape.flexible:
            assert own.values is not None, "stresses are given"
            at_nodes = np.zeros(len(own.points))
            at_nodes[own.triangles] = own.values
            stress.append(at_nodes)
        if not self._meshed:
            self._meshed = True
            self._emit({"event": "mesh", "width": plotter.width, **_topology(shape)})
        return {
            "force": _number(frame.force),
            "displacement": _number(frame.displacement),
            "stable": frame.stable,
            "snapped": frame.snapped_through,
            "stress": _number(max((float(own.max()) for own in stress), default=0.0)),
            "nodes": [_rounded(own.points, 5) for own in shape.flexible],
            "von_mises": [_rounded(own, 3) for own in stress],
            "rigid": [_rounded(points, 5) for points in plotter.rigid_points(snapshot)],
            "pins": _rounded([pin.at for pin in shape.pins], 5),
        }


def _topology(shape: MechanismShape) -> dict[str, Any]:
    """What all frames of a drawing share."""
    return {
        "flexible": [
            {
                "name": own.name,
                "triangles": own.triangles.tolist(),
                "loops": [loop.tolist() for loop in edge_loops(_turned(own.points, own.triangles))],
            }
            for own in shape.flexible
        ],
        "rigid": [{"name": own.name, "fixed": own.fixed} for own in shape.rigid],
        "welded": [pin.welded for pin in shape.pins],
    }


def _turned(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, all counter-clockwise."""
    (ax, ay), (bx, by) = (points[triangles[:, k]].T - points[triangles[:, 0]].T for k in (1, 2))
    return np.where((ax * by < ay * bx)[:, None], triangles[:, [0, 2, 1]], triangles)


def _design(problem: DesignProblem, at: HandlePlacement) -> dict[str, list[float]]:
    return {"offsets": (at.p - problem.initial).tolist(), "handles": at.theta.tolist()}


def _rates(found: Outlines) -> dict[str, Any]:
    """Rates of what is drawn, as the page draws them."""
    nodes, rigid = ([_rounded(points, 5) for points in own] for own in (found.nodes, found.rigid))
    return {"nodes": nodes, "rigid": rigid, "pins": _rounded(found.pins, 5)}


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _rounded(values: Any, digits: int = 6) -> Any:
    """Values with some significant digits, as nested lists."""
    array = np.asarray(values, dtype=float)
    sizes = np.abs(np.where(np.isfinite(array) & (array != 0.0), array, 1.0))
    scale = 10.0 ** (digits - 1 - np.floor(np.log10(sizes)))
    return np.where(np.isfinite(array), np.round(array * scale) / scale, array).tolist()


# -- the process ---


class Inbox:
    """Tasks from a stream of lines, of which only the newest counts."""

    def __init__(self, lines: TextIO) -> None:
        self._lines, self._newest, self._closed = lines, None, False
        self._arrived = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._lines:
            with self._arrived:
                self._newest = json.loads(line)
                self._arrived.notify()
        with self._arrived:
            self._closed = True
            self._arrived.notify()

    def waiting(self) -> bool:
        """Whether there is a task that was not taken, or none will come."""
        return self._newest is not None or self._closed

    def take(self) -> dict[str, Any] | None:
        """The newest task, waited for; None at the end."""
        with self._arrived:
            self._arrived.wait_for(self.waiting)
            task, self._newest = self._newest, None
            return task


def main() -> None:
    """Does tasks until standard input ends."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # libraries print where they like
    inbox = Inbox(sys.stdin)

    def emit(event: dict[str, Any]) -> None:
        out.write(json.dumps(event, allow_nan=False) + "\n")
        out.flush()

    solver = Solver(emit, inbox.waiting)
    emit({"event": "ready"})
    while (task := inbox.take()) is not None:
        solver.run(task)
