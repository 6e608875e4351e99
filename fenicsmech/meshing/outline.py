"""Meshes of closed outlines of lines and arcs."""

from __future__ import annotations

import math

import numpy as np

from fenicsmech.checks import point_text
from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import Arc, Line, Outline
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.planar import PlaneDrawing, in_units_of, mesh_planar
from fenicsmech.meshing.plane_curves import CircleArc, Curve, draw_loop, sampled, straight_line
from fenicsmech.meshing.request import InterfaceSite, MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.polygons import distance_to, first_crossing, is_inside

_SAMPLED = 0.02  # of the element size: how far the polygons that checks look at deviate from the outline


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
        raise MeshingError(
            request.part,
            f"the outline crosses itself near {point_text(crossing * request.size)}",
            "Lead its segments apart there",
        )
    for site in request.sites:
        if not holds(shape, request, site.at):
            raise MeshingError(
                request.part_at(site),
                f"the point {point_text(site.at[:2])} is not on the link",
                "Move the joint into the outline",
            )


@holds.register
def _(shape: Outline, request: MeshRequest, at: tuple[float, ...]) -> bool:
    polygon, place = sampled(_loop(shape, request), _SAMPLED), np.asarray(at[:2]) / request.size
    # a joint on the very edge may be off the polygon, by rounding too
    return is_inside(polygon, place) or distance_to(polygon, place) <= 0.1


def _loop(outline: Outline, request: MeshRequest) -> list[Curve]:
    """The curves of an outline, closed by a line if they do not end where they began, in units of the element size.

    Raises:
        MeshingError: fewer than two segments are left, or an arc's three points are in line.
    """
    scaled, loop = in_units_of(outline, request.size), []
    start = scaled.start
    for segment in (*scaled.segments, Line(scaled.start)):
        if isinstance(segment, Arc):
            loop.append(_arc(start, segment, request))
        elif math.dist(start, segment.end) > 1e-8:  # ends this near are one point
            loop.append(straight_line(start, segment.end))
        start = segment.end
    if len(loop) < 2:
        raise MeshingError(
            request.part, f"an outline of {len(loop)} segment(s) encloses nothing", "Give at least two segments"
        )
    return loop


def _arc(start: tuple[float, ...], arc: Arc, request: MeshRequest) -> CircleArc:
    a, b = np.subtract(arc.via, start), np.subtract(arc.end, start)
    if abs(a[0] * b[1] - a[1] * b[0]) <= 1e-9 * np.hypot(*a) * np.hypot(*b):
        first, via, last = (tuple(round(c * request.size, 9) for c in p) for p in (start, arc.via, arc.end))
        raise MeshingError(
            request.part,
            f"the arc from {first} through {via} to {last} has its three points in line",
            "Use a line, or move the point in between",
        )
    return CircleArc.through(start, arc.via, arc.end)
