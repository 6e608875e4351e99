"""Meshing closed outlines of lines and arcs."""

from __future__ import annotations

import math
from functools import singledispatch
from itertools import pairwise

import numpy as np

from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import Arc, Line, Outline
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.meshing.plan_view import PlanView, mesh_plan_view
from fenicsmech.meshing.planform import distance, first_crossing, inside
from fenicsmech.meshing.regions import DimTag
from fenicsmech.meshing.scaling import in_units_of

_CLOSED = 1e-8  # in element sizes: ends this near are one point
_WIDEST_ARC = 0.75 * math.pi  # arcs are drawn in pieces below a half turn, whose ends tell on which side they run
_NEAR = 0.1  # of the element size: the outline's arcs are sampled, points this near to it may be on it
_SAMPLES = 16  # of an arc, where crossings are looked for


@mesh_shape.register
def _(shape: Outline, request: MeshRequest) -> LinkMesh:
    path = _path(in_units_of(shape, request.size), request)
    return mesh_plan_view(request, shape.depth, lambda sites: _draw(path, sites))


@check_shape.register
def _(shape: Outline, request: MeshRequest) -> None:
    _check_simple(_path(in_units_of(shape, request.size), request), request)
    for site in request.sites:
        if not holds(shape, request, site.at):
            x, y = site.at[:2]
            raise MeshingError(
                request.part_at(site), f"the point ({x:g}, {y:g}) is not on the link", "Move the joint into the outline"
            )


@holds.register
def _(shape: Outline, request: MeshRequest, at: tuple[float, ...]) -> bool:
    path = _path(in_units_of(shape, request.size), request)
    corners = np.concatenate([_samples(segment, start)[:-1] for start, segment in path]) * request.size
    return bool(inside(corners, np.asarray(at[:2])) or distance(corners, np.asarray(at[:2])) <= _NEAR * request.size)


# A path is a list of (start, segment): closed, without empty segments, in units of the element size.
Path = list[tuple[tuple[float, ...], Line | Arc]]


def _path(outline: Outline, request: MeshRequest) -> Path:
    """The segments with their starts, closed by a straight line if they do not end where they began.

    Raises:
        MeshingError: fewer than two segments are left, or an arc's three points are in line.
    """
    segments = [*outline.segments, Line(outline.start)]
    starts = [outline.start, *(segment.end for segment in segments[:-1])]
    path = [
        (start, segment)
        for start, segment in zip(starts, segments, strict=True)
        if isinstance(segment, Arc) or math.dist(start, segment.end) > _CLOSED
    ]
    if len(path) < 2:
        raise MeshingError(
            request.part, f"an outline of {len(path)} segment(s) encloses nothing", "Give at least two segments"
        )
    for start, segment in path:
        _check(segment, start, request)
    return path


@singledispatch
def _check(segment: Line | Arc, start: tuple[float, ...], request: MeshRequest) -> None:
    """Refuse segments that cannot be drawn."""


@_check.register
def _(segment: Arc, start: tuple[float, ...], request: MeshRequest) -> None:
    a, b = np.subtract(segment.via, start), np.subtract(segment.end, start)
    if abs(a[0] * b[1] - a[1] * b[0]) <= 1e-9 * np.hypot(*a) * np.hypot(*b):
        shown = [tuple(round(c * request.size, 9) for c in p) for p in (start, segment.via, segment.end)]
        raise MeshingError(
            request.part,
            f"the arc from {shown[0]} through {shown[1]} to {shown[2]} has its three points in line",
            "Use a line, or move the point in between",
        )


def _check_simple(path: Path, request: MeshRequest) -> None:
    corners = [_samples(segment, start)[:-1] for start, segment in path]
    crossing = first_crossing(np.concatenate(corners))
    if crossing is not None:
        x, y = crossing * request.size
        raise MeshingError(
            request.part, f"the outline crosses itself near ({x:g}, {y:g})", "Lead its segments apart there"
        )


@singledispatch
def _samples(segment: Line | Arc, start: tuple[float, ...]) -> np.ndarray:
    """Points along a segment, from its start to its end."""
    raise TypeError(f"{type(segment).__name__} is not a segment of an outline")


@_samples.register
def _(segment: Line, start: tuple[float, ...]) -> np.ndarray:
    return np.array([start, segment.end])


@_samples.register
def _(segment: Arc, start: tuple[float, ...]) -> np.ndarray:
    centre, radius, first, sweep = _circle(segment, start)
    angles = first + sweep * np.linspace(0.0, 1.0, _SAMPLES + 1)
    return centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _circle(arc: Arc, start: tuple[float, ...]) -> tuple[np.ndarray, float, float, float]:
    """Centre, radius, angle of the start, and angle swept (positive to the left) of an arc."""
    p, q, r = (np.array(point) for point in (start, arc.via, arc.end))
    # |c − p| = |c − q| = |c − r|
    centre = p + np.linalg.solve(2.0 * np.array([q - p, r - p]), [(q - p) @ (q - p), (r - p) @ (r - p)])
    first, via, last = (math.atan2(*(point - centre)[::-1]) for point in (p, q, r))
    to_via, to_last = (via - first) % (2.0 * math.pi), (last - first) % (2.0 * math.pi)
    sweep = to_last if to_via < to_last else to_last - 2.0 * math.pi
    return centre, float(np.linalg.norm(p - centre)), first, sweep


@singledispatch
def _curves(segment: Line | Arc, start: tuple[float, ...], points: tuple[int, int]) -> list[int]:
    """The curves that draw a segment between two points of the model."""
    raise TypeError(f"{type(segment).__name__} is not a segment of an outline")


@_curves.register
def _(segment: Line, start: tuple[float, ...], points: tuple[int, int]) -> list[int]:
    return [gmsh.model.occ.addLine(*points)]


@_curves.register
def _(segment: Arc, start: tuple[float, ...], points: tuple[int, int]) -> list[int]:
    occ = gmsh.model.occ
    (x, y), radius, first, sweep = _circle(segment, start)
    pieces = math.ceil(abs(sweep) / _WIDEST_ARC)
    angles = first + sweep * np.arange(1, pieces) / pieces
    inner = [occ.addPoint(x + radius * math.cos(a), y + radius * math.sin(a), 0.0) for a in angles]
    middle = occ.addPoint(x, y, 0.0)
    return [occ.addCircleArc(a, middle, b) for a, b in pairwise([points[0], *inner, points[1]])]


def _draw(path: Path, sites: tuple[InterfaceSite, ...]) -> PlanView:
    return PlanView(faces=[_face(path)], sites=sites, corners=((0.0,),) * len(sites))


def _face(path: Path) -> DimTag:
    occ = gmsh.model.occ
    points = [occ.addPoint(*start, 0.0) for start, _ in path]
    ends = zip(points, [*points[1:], points[0]], strict=True)
    curves = [
        curve for (start, segment), pair in zip(path, ends, strict=True) for curve in _curves(segment, start, pair)
    ]
    return 2, occ.addPlaneSurface([occ.addCurveLoop(curves)])
