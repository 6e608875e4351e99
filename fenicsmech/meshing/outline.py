"""Closed curves in the plane (B-splines, straight lines among them, and arcs of circles), and links bounded by them.

A loop is a list of curves, each of which begins where the one before ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from scipy.interpolate import BSpline

from fenicsmech.errors import DescriptionError, MeshingError, counted, point_text
from fenicsmech.mechanism import Arc, Line, Outline, Shape, StepPart, Strip
from fenicsmech.meshing.cutting import PlaneDrawing, in_units_of, mesh_planar
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.link_mesher import LEAST_SEGMENTS, InterfaceSite, MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.meshing.session import gmsh
from fenicsmech.polygons import distance_to, first_crossing, is_inside, signed_area, strip_width

_SAMPLED = 0.02  # of the element size: how far the polygons that checks look at deviate from the outline


@dataclass(frozen=True, eq=False)
class CircleArc:
    """A part of a circle.

    Attributes:
        centre: shape (2,).
        radius: of the circle.
        first: angle (rad) from x at which it begins.
        sweep: angle covered from there, positive if counter-clockwise.
    """

    centre: np.ndarray
    radius: float
    first: float
    sweep: float

    @classmethod
    def through(cls, start: Sequence[float], via: Sequence[float], end: Sequence[float]) -> CircleArc:
        """The arc from ``start`` through ``via`` to ``end``, points (2,) that are not in line."""
        points = np.array([start, via, end], dtype=float)
        # |c − start| = |c − via| = |c − end|
        (a, b), (c, d) = points[1:] - points[0]
        p, q = a * a + b * b, c * c + d * d
        centre = points[0] + np.array([p * d - q * b, q * a - p * c]) / (2.0 * (a * d - b * c))
        first, between, last = (math.atan2(y, x) for x, y in points - centre)
        turn = 2.0 * math.pi
        sweep = (last - first) % turn
        if (between - first) % turn > sweep:
            sweep -= turn
        return cls(centre, math.dist(points[0], centre), first, sweep)

    def at(self, fraction: np.ndarray) -> np.ndarray:
        """The points (k, 2) at the given fractions (k,) of the sweep."""
        angles = self.first + self.sweep * np.asarray(fraction)
        return self.centre + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])


Curve: TypeAlias = BSpline | CircleArc  # a B-spline is clamped to its ends; one of degree 1 is a single straight line


def straight_line(start: Sequence[float], end: Sequence[float]) -> BSpline:
    """The straight line between two points (2,)."""
    return BSpline([0.0, 0.0, 1.0, 1.0], np.array([start, end], dtype=float), 1)


def points_on(curve: Curve, parameters: np.ndarray) -> np.ndarray:
    """The points (k, 2) of a curve at ``parameters`` (k,): fractions of an arc's sweep, else those of the spline."""
    return curve.at(parameters) if isinstance(curve, CircleArc) else curve(parameters)


def start_of(curve: Curve) -> np.ndarray:
    """The point (2,) in which a curve begins."""
    return curve.at(np.zeros(1))[0] if isinstance(curve, CircleArc) else curve.c[0]


def end_of(curve: Curve) -> np.ndarray:
    """The point (2,) in which a curve ends."""
    return curve.at(np.ones(1))[0] if isinstance(curve, CircleArc) else curve.c[-1]


def turned(curve: Curve) -> Curve:
    """A curve from its end to its start."""
    if isinstance(curve, CircleArc):
        return CircleArc(curve.centre, curve.radius, curve.first + curve.sweep, -curve.sweep)
    return BSpline(curve.t[0] + curve.t[-1] - curve.t[::-1], curve.c[::-1], curve.k)


def chained(curves: Sequence[Curve], tolerance: float) -> list[list[Curve]]:
    """The closed loops of curves given in any order and sense, whose ends meet to within ``tolerance``."""
    left, loops = list(curves), []
    while left:
        loop = [left.pop(0)]
        while math.dist(end_of(loop[-1]), start_of(loop[0])) > tolerance:
            here = end_of(loop[-1])
            gaps = [[math.dist(here, end) for end in (start_of(curve), end_of(curve))] for curve in left]
            k, far = min(np.ndindex(len(left), 2), key=lambda place: gaps[place[0]][place[1]])
            curve = left.pop(k)
            loop.append(turned(curve) if far else curve)
        loops.append(loop)
    return loops


def outermost(loops: Sequence[list[Curve]], tolerance: float) -> list[Curve]:
    """The loop that encloses the largest area."""
    return max(loops, key=lambda loop: abs(signed_area(sampled(loop, tolerance))))


def sampled(loop: Sequence[Curve], tolerance: float) -> np.ndarray:
    """The closed polygon (m, 2) with vertices on ``loop``, from which it deviates by at most ``tolerance``."""
    return np.concatenate([points_on(curve, sample_parameters(curve, tolerance)[:-1]) for curve in loop])


def sample_parameters(curve: Curve, tolerance: float) -> np.ndarray:
    """Parameters (k,) from the start of a curve to its end; lines through their points deviate by ``tolerance``."""
    if isinstance(curve, CircleArc):
        # a chord over the angle 2 φ misses the arc by r (1 − cos φ)
        widest = max(math.cos(math.pi / LEAST_SEGMENTS), 1.0 - tolerance / curve.radius)
        parts = math.ceil(abs(curve.sweep) / (2.0 * math.acos(widest)))
        return np.linspace(0.0, 1.0, parts + 1)
    knots = np.unique(curve.t)
    # the chord over a piece of length h in the parameter misses the curve by at most h² max|C''| / 8
    second = np.linalg.norm(curve(knots, 2), axis=1) if curve.k > 1 else np.zeros(len(knots))
    most = np.maximum(second[:-1], second[1:])
    counts = np.maximum(1, np.ceil(np.diff(knots) * np.sqrt(most / (8.0 * tolerance)))).astype(int)
    pieces = zip(knots[:-1], knots[1:], counts, strict=True)
    return np.concatenate([*(np.linspace(a, b, n, endpoint=False) for a, b, n in pieces), knots[-1:]])


def draw_loop(loop: Sequence[Curve], height: float = 0.0) -> int:
    """The tag of ``loop`` as a curve loop of the plane z = ``height`` in the current gmsh model.

    A single curve is a whole circle.
    """
    if len(loop) == 1:
        circle = gmsh.model.occ.addCircle(*loop[0].centre, height, loop[0].radius)
        return gmsh.model.occ.addCurveLoop([circle])
    starts = [gmsh.model.occ.addPoint(*start_of(curve), height) for curve in loop]
    ends = zip(starts, [*starts[1:], starts[0]], strict=True)
    edges = [edge for curve, pair in zip(loop, ends, strict=True) for edge in _draw(curve, pair, height)]
    return gmsh.model.occ.addCurveLoop(edges)


def _draw(curve: Curve, ends: tuple[int, int], height: float) -> list[int]:
    """The edges that draw a curve between two points of the current gmsh model."""
    occ = gmsh.model.occ
    if isinstance(curve, CircleArc):
        # in pieces below a half turn, whose ends determine on which side they run
        pieces = math.ceil(abs(curve.sweep) / (0.75 * math.pi))
        between = [occ.addPoint(*at, height) for at in curve.at(np.arange(1, pieces) / pieces)]
        helpers = [occ.addPoint(*curve.centre, height)]
        edges = [occ.addCircleArc(a, helpers[0], b) for a, b in pairwise([ends[0], *between, ends[1]])]
    elif curve.k == 1:
        return [occ.addLine(*ends)]
    else:
        helpers = [occ.addPoint(*at, height) for at in curve.c[1:-1]]
        knots, repeats = (a.tolist() for a in np.unique(curve.t, return_counts=True))
        edges = [occ.addBSpline([ends[0], *helpers, ends[1]], degree=curve.k, knots=knots, multiplicities=repeats)]
    # points that no edge begins or ends in would go into files
    occ.remove([(0, at) for at in helpers])
    return edges


@singledispatch
def outer_loop(shape: object, request: MeshRequest) -> list[Curve]:
    """The closed curve around ``shape`` in the plane, its holes filled; each kind of shape registers its own."""
    raise TypeError(f"{type(shape).__name__} has no outline of curves")


def link_outline(name: str, shape: Shape, *, dim: int) -> list[Curve]:
    """The curves around a link in the plane, as they were drawn: those of its section where it is a solid.

    Holes are filled. Curves of a STEP file that are neither lines nor circles are interpolated to 1e-8 of the link's
    extent; a mesh file has the polygon of its boundary.

    Args:
        name: the link's name, for messages.
        shape: an outline, or a link from a file.
        dim: 2 or 3, of the mesh in a mesh file.

    Raises:
        MeshingError: a file cannot be read, or has no such section.
    """
    size = strip_width(_corners(shape)) if isinstance(shape, Outline) else 1.0
    request = MeshRequest(name, (), dim, size)
    check_shape(shape, request)
    return outer_loop(shape, request)


def link_thickness(name: str, shape: Shape) -> float:
    """The thickness of a strip, or t = 2 A / P of the long strip with the area A and the perimeter P of an outline.

    Raises:
        DescriptionError: the link is a mesh, whose elements are given.
        MeshingError: a file cannot be read, or has no such section.
    """
    match shape:
        case Strip():
            return shape.thickness
        case Outline():
            return strip_width(_corners(shape))
        case StepPart():
            curves = link_outline(name, shape, dim=2)
            return strip_width(sampled(curves, 1e-3 * float(np.ptp(sampled(curves, math.inf), axis=0).max())))
    problem = "its shape comes from a file, so its thickness is not known"
    raise DescriptionError(f"link {name!r}", problem, "Give size=… for it")


def _corners(outline: Outline) -> np.ndarray:
    """The polygon of an outline, (n, 2); arcs count as the two chords that they are given by."""
    corners = [outline.start]
    for segment in outline.segments:
        corners += [segment.via, segment.end] if isinstance(segment, Arc) else [segment.end]
    return np.array(corners)


@mesh_shape.register
def _(shape: Outline, request: MeshRequest) -> LinkMesh:
    loop = _loop(shape, request)

    def draw(sites: tuple[InterfaceSite, ...]) -> PlaneDrawing:
        face = 2, gmsh.model.occ.addPlaneSurface([draw_loop(loop)])
        return PlaneDrawing([face], sites, corners=((0.0,),) * len(sites))

    return mesh_planar(request, shape.depth, draw)


@check_shape.register
def _(shape: Outline, request: MeshRequest) -> None:
    crossing = first_crossing(sampled(_loop(shape, request), _SAMPLED))
    if crossing is not None:
        problem = f"the outline crosses itself near {point_text(crossing * request.size)}"
        raise MeshingError(request.part, problem, "Move its segments apart there")
    for site in request.sites:
        if not holds(shape, request, site.at):
            problem = f"the point {point_text(site.at[:2])} is not on the link"
            raise MeshingError(request.part_at(site), problem, "Move the joint into the outline")


@holds.register
def _(shape: Outline, request: MeshRequest, at: tuple[float, ...]) -> bool:
    polygon, place = sampled(_loop(shape, request), _SAMPLED), np.asarray(at[:2]) / request.size
    # a joint on the very edge may be off the polygon, by rounding too
    return is_inside(polygon, place) or distance_to(polygon, place) <= 0.1


@outer_loop.register
def _(shape: Outline, request: MeshRequest) -> list[Curve]:
    return [_scaled(curve, request.size) for curve in _loop(shape, request)]


def _scaled(curve: Curve, factor: float) -> Curve:
    if isinstance(curve, CircleArc):
        return CircleArc(factor * curve.centre, factor * curve.radius, curve.first, curve.sweep)
    return BSpline(curve.t, factor * curve.c, curve.k)


def _loop(outline: Outline, request: MeshRequest) -> list[Curve]:
    """The curves of an outline, closed by a line if they do not end where they began, in units of the element size."""
    scaled, loop = in_units_of(outline, request.size), []
    start = scaled.start
    for segment in (*scaled.segments, Line(scaled.start)):
        if isinstance(segment, Arc):
            (a, b), (c, d) = np.subtract(segment.via, start), np.subtract(segment.end, start)
            if abs(a * d - b * c) <= 1e-9 * math.hypot(a, b) * math.hypot(c, d):
                places = (start, segment.via, segment.end)
                first, via, last = (tuple(round(x * request.size, 9) for x in place) for place in places)
                problem = f"the arc from {first} through {via} to {last} has its three points in line"
                raise MeshingError(request.part, problem, "Use a line, or move the point in between")
            loop.append(CircleArc.through(start, segment.via, segment.end))
        elif math.dist(start, segment.end) > 1e-8:  # ends this near are one point
            loop.append(straight_line(start, segment.end))
        start = segment.end
    if len(loop) < 2:
        problem = f"an outline of {counted(len(loop), 'segment')} encloses no area"
        raise MeshingError(request.part, problem, "Give at least two segments")
    return loop
