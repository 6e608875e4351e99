"""A project solved in space, in a process of its own that can be ended: its progress, and the surface with its stress.

Half of the depth is meshed, and mirrored where it is shown. Arrays are little-endian, as texts in base64.
"""

from __future__ import annotations

import base64
import json
import os
import sys
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np

from fenicsmech.errors import DescriptionError, EquilibriumError, FenicsmechError
from fenicsmech.live.build import draw, placement
from fenicsmech.live.problems import explained, remarks
from fenicsmech.live.project import Project, forces_of
from fenicsmech.simulation import Frame, MechanismPlotter, Simulation, gather, outer_surface
from fenicsmech.stress import von_mises

_PARTS = 2  # of each side of a face: bending varies within cells
_MOST = 1_000_000  # points of all frames, some 20 MB as a message


def solve_solid(project: Project, number: int, emit: Callable[[dict[str, Any]], None]) -> None:
    """Solves a curve of a project in space.

    Args:
        project: with its design.
        number: of the curve.
        emit: called with each event, as ``messages`` describes it.
    """
    began = perf_counter()
    try:
        if project["simulation"]["space"] not in ("plane-stress", "plane-strain"):
            reason = "this mechanism does not exist in the plane, and its curves are those in space already"
            raise DescriptionError("solid", reason, "Look at the curves of the page")
        drawing = draw({**project, "simulation": {**project["simulation"], "space": "3d-symmetric"}})
        problem = drawing.along_curves(project)
        at = placement(project, problem)
        simulation = drawing.simulation
        if problem is not None and at is not None:
            simulation = simulation.with_design(problem.rest_shape(at))
        forces = forces_of(project, number)

        _check_size(simulation, len(forces))

        def watch(done: int) -> None:
            emit({"event": "solid", "state": "solving", "done": done, "of": len(forces)})

        watch(0)
        failure, curve = None, None
        try:
            curve = simulation.compute(drawing.request(project, number, forces), watch=watch)
            frames = curve.frames
        except EquilibriumError as error:
            failure, frames = error, error.frames
        errors = None if curve is None else [float(error) for error in curve.error_estimates()]
        emit(
            {
                "event": "solid",
                "state": "solved",
                "curve": number,
                "project": project,
                "remarks": [] if curve is None else remarks(curve),
                "failed": failure and explained(failure),
                "errors": errors,
                "seconds": round(perf_counter() - began, 2),
                **(_surface(simulation, frames) if frames else {"triangles": "", "points": []}),
            }
        )
    except FenicsmechError as error:
        emit({"event": "solid", "state": "failed", **explained(error)})


def _check_size(simulation: Simulation, frames: int) -> None:
    """Refuses what is too much for a page, before it is solved."""
    model = simulation.model
    points = 2 * (int(outer_surface(model, model.mesh.cells, _PARTS).numbers.max()) + 1)
    if points * frames > _MOST:
        problem = f"its surface has {points} points in each of {frames} frames"
        raise DescriptionError("solid", problem, "Choose larger elements, or fewer frames")


def _surface(simulation: Simulation, frames: tuple[Frame, ...]) -> dict[str, Any]:
    """Triangles of the surface, and its points with their von Mises stress in each frame."""
    model = simulation.model
    first = gather(model, frames[0])
    assert first is not None, "there is one process"
    surface, plotter = outer_surface(model, first.cells, _PARTS), MechanismPlotter(model)
    numbers = surface.numbers.ravel()
    half = int(numbers.max()) + 1
    triangles = numbers[surface.triangles]
    places = surface.cells, surface.corners
    points = []
    for frame in frames:
        snapshot = gather(model, frame)
        recovered = frame.stresses.at(frame.state, frame.design, lambda _: places)
        assert snapshot is not None and recovered is not None, "there is one process"
        rest, moved, stress = np.zeros((half, 3)), np.zeros((half, 3)), np.zeros(half)
        rest[numbers], moved[numbers] = (own.reshape(-1, 3) for own in snapshot.places(*places))
        np.maximum.at(stress, numbers, von_mises(recovered.stress).ravel())  # zero in cells that joints hold rigid
        place = np.array([*frame.peak.place[:2], abs(frame.peak.place[2])])
        points.append(
            {
                "force": float(frame.force),
                "displacement": float(frame.displacement),
                "stable": frame.stable,
                "snapped": frame.snapped_through,
                "peak": {
                    "value": frame.peak.value,
                    "error": frame.peak.error,
                    "point": int(np.argmin(np.linalg.norm(rest - place, axis=1))),
                },
                "places": _packed(np.concatenate([moved, moved * [1.0, 1.0, -1.0]]), "<f4"),
                "von_mises": _packed(np.concatenate([stress, stress]), "<f4"),
                "rigid": [at.tolist() for at in plotter.rigid_points(snapshot)],
            }
        )
    mirrored = triangles[:, [0, 2, 1]] + half
    return {"triangles": _packed(np.concatenate([triangles, mirrored]), "<u4"), "points": points}


def _packed(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


def main() -> None:
    """Reads {project, curve} from standard input; writes events to standard output, a line of JSON each."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # libraries print where they like
    task: Mapping[str, Any] = json.load(sys.stdin)

    def emit(event: dict[str, Any]) -> None:
        out.write(json.dumps(event, allow_nan=False) + "\n")
        out.flush()

    solve_solid(task["project"], task["curve"], emit)
