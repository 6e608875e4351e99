"""Messages between the page, the server and the solver process: plain data as JSON, one schema each.

Page to server, one WebSocket message each, at most ``LARGEST`` bytes. ``kind`` is one of

    edit     changes    of the project: {kind: set | insert | remove, path: [keys and indices], value}
             settled    false while a gesture lasts: it is solved, and joined with what follows into one step of undo
             fit        optional; whether the design follows its targets now; by default as the project's "fit" says,
                        and not where the changes set the design itself
    cancel              of a gesture that lasts: the project as it was before it; nothing if none lasts
    undo, redo, reset   steps of the history; reset goes back to what was opened last
    open     project    replaces the project
    example  name       replaces it by one that comes with the page
    push     curve, force   the equilibrium under a force of the curve that the pointer exerts; the project stays
             at, by         optional: what the pointer holds, {link, place: [x, y] under the curve's force}, and the
                            force by [x, y] that it exerts there beside that of the curve
    release             the pointer exerts none; the solver goes on with what the push had interrupted
    fit                 the design follows its targets once, a step of the history
    stop                ends what the solver does
    solve solid  curve  solves a curve in space, in a process of its own beside the solver
    stop solid          ends that

Server to page, each with ``heard``, how many messages of the page came before: an event that is older than the page's
last edit knows nothing of it. ``event`` is one of

    project     project, undo and redo (whether there are steps), opened (which of those opened it is made of),
                    examples, materials, constants: {material: {E, nu, density}}, most: {curves, targets, bytes}
    first       curves of the project as it was opened: [{force, positions, others, held, ratios, largest,
                    points: [[displacement, force]]}]
    solver      state: starting, busy, idle or failed, of task; seconds that it took, where it is done
    refused     place, problem: of the last message, which changed nothing
    solid       state: solving (done, of: frames), failed (part, problem, remedy), cancelled, or solved with
                    curve, project (of the solid), remarks, failed, seconds, errors (of displacements; null if failed),
                    triangles (base64 of uint32, of the surface), and points, one a frame:
                        force, displacement, stable, snapped, peak {value, error, point (number)},
                        places (base64 of float32, [x, y, z] a point), von_mises (likewise, one a point),
                        rigid [[[x, y]] a rigid link]
    and the results of the solver below, of the present task alone

Server to solver, a line each, {task: number, kind} with

    solve     project, fit, longest (seconds that it may take)
    push      project, curve, force, at, by, longest
    nothing   ends the task at work

Solver to server, a line each, with the number of their task:

    ready     alone has no number
    began
    mesh      width (of the drawing), flexible: [{name, triangles, loops}], rigid: [{name, fixed}], welded: [bool]
    iterate   number, design, values (corrected, of all targets), misfits (relative, of all targets)
    curve     curve, iterate (null of the final one), remarks, failed, and points, one a frame:
                  force, displacement, stable, snapped, stress (largest von Mises),
                  nodes [[[x, y]] a flexible link], von_mises [[one a node] a flexible link],
                  rigid [[[x, y]] a rigid link: its joints, forces and outputs], pins [[x, y]]
    errors    curve, errors: estimated discretisation errors of the displacements of its points, or of the forces where
                  displacements are held, to be added; peak of the stress at its end, outside of singular places:
                  {value, error, link}, null if there is none
    responses curve, end: rates of its last point with the force, {nodes, rigid, pins} as points have them, null where
                  there are none; motors: {name: rates of its first point with the position of the motor}
    fitted    design, misfits, iterations, missed: {problem, remedy} of targets out of reach or an early end, null if
              all is well
    linear    the linear preview at a design, Q(p + s) ≈ Q + e + J s, R ≈ ∂R/∂p s + ½ sᵀ ∂²R/∂p² s:
                  design, lengths (typical change of each parameter), curves: [{at (forces, or displacements that are
                  held), values (displacements, or forces), errors, jacobian}], empty for forces that grow together,
                  gradient, curvature, active (bounds that hold it back), whole (not cut where a curve snaps),
                  links: [{name, controls [[[x, y, δ], tangent]], entries (parameter of each, −1 none), thickness,
                  follows (rates of controls with each of "moves")}],
                  moves: what follows the parameters in s and the columns of each jacobian: {kind: joint, joints
                  (numbers of those at one place), axis (0: x, 1: y)}, {kind: motor, name}, {kind: direction, name} of a
                  curve's force, in rad, or {kind: force, name, axis} of its point;
                  positions: of motors, of each curve
    required  values of the project's requirements, with their estimated errors: [[component]]; empty if failed
    pushed    curve, at, by, point, rates: of the point with the curve's force, or with those of what the pointer holds
                  along x and y; none where they are not unique
    done      seconds
    cancelled
    failed    part, problem, remedy

A design is {offsets: parameters less those drawn, handles: positions of handles on the links}.
"""

from __future__ import annotations

import json
from typing import Any

from fenicsmech.live.project import LARGEST_PROJECT, MOST_CURVES
from fenicsmech.live.schema import (
    FLAG,
    LONGEST_NAME,
    Anything,
    ByKind,
    Choice,
    Many,
    Number,
    Record,
    Refused,
    Schema,
    Text,
)

LARGEST = 2 * LARGEST_PROJECT
"""Bytes of a message from the page: a project with its design, and numbers as JavaScript writes them."""

PER_SECOND = 120
"""Messages of a page in a second, above the rate of its screen; more are refused."""


class _Step(Schema):
    """A key or an index."""

    def check(self, value, place=""):
        (Text(LONGEST_NAME) if isinstance(value, str) else Number(0, 10_000, whole=True)).check(value, place)


_PATH = Many(_Step(), 1, 8)
_CHANGE = ByKind(
    {
        "set": Record({"path": _PATH, "value": Anything()}),
        "insert": Record({"path": _PATH, "value": Anything()}),
        "remove": Record({"path": _PATH}),
    }
)

_CURVE = Number(0, MOST_CURVES - 1, whole=True)
_FORCE = Number(-1e6, 1e6)
_PLACE = Many(Number(-1e5, 1e5), 2, 2)

PAGE = ByKind(
    {
        "edit": Record({"changes": Many(_CHANGE, 1, 60), "settled": FLAG}, {"fit": FLAG}),
        "cancel": Record({}),
        "undo": Record({}),
        "redo": Record({}),
        "reset": Record({}),
        "open": Record({"project": Anything()}),
        "example": Record({"name": Text(60)}),
        "push": Record(
            {"curve": _CURVE, "force": _FORCE},
            {"at": Record({"link": Text(LONGEST_NAME), "place": _PLACE}), "by": Many(_FORCE, 2, 2)},
        ),
        "release": Record({}),
        "fit": Record({}),
        "stop": Record({}),
        "solve solid": Record({"curve": _CURVE}),
        "stop solid": Record({}),
    }
)
"""Messages from the page."""

EXPORTS = Choice(("project", "script", "step", "stl", "dxf", "png", "animation"))
"""Files that the page downloads."""


def read_message(text: str | bytes) -> dict[str, Any]:
    """A message from the page.

    Raises:
        Refused: it is none.
    """
    if len(text) > LARGEST:
        raise Refused("", f"a message of {len(text)} bytes, not at most {LARGEST}")
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        raise Refused("", "not JSON") from None
    PAGE.check(message)
    return message
