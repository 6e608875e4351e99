"""Meshing strips: constant thickness along a centreline, with round eyes at the pins."""

from __future__ import annotations

import math

import numpy as np

from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import Disc, Strip
from fenicsmech.meshing.centreline import Centreline
from fenicsmech.meshing.gmsh_session import gmsh
from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.mesh_request import MeshRequest, check_shape, holds, mesh_shape
from fenicsmech.meshing.plan_view import PlanView, mesh_plan_view
from fenicsmech.meshing.regions import DimTag, region_face
from fenicsmech.meshing.scaling import in_units_of
from fenicsmech.meshing.strip_outline import Side, check_sides, strip_sides
from fenicsmech.meshing.strip_pins import ON_CENTRELINE, StripPin


@mesh_shape.register
def _(shape: Strip, request: MeshRequest) -> LinkMesh:
    strip = in_units_of(shape, request.size)
    return mesh_plan_view(request, shape.depth, lambda sites: _draw(strip, sites))


@check_shape.register
def _(shape: Strip, request: MeshRequest) -> None:
    centreline = Centreline(shape.centreline, part=f"centreline of {request.part}")
    check_sides(request.part, centreline, shape.thickness)
    for site in request.sites:
        _check_on_strip(centreline, shape.thickness, site, request)
        if isinstance(site.region, Disc) and shape.thickness < (1.0 - ON_CENTRELINE) * site.region.radius:
            raise MeshingError(
                request.part_at(site),
                f"the strip is thinner ({shape.thickness:g}) than its pin: the interface has radius "
                f"{site.region.radius:g}, twice that of a pin",
                "Make the strip at least as thick as the radius, or the radius smaller",
            )


@holds.register
def _(shape: Strip, request: MeshRequest, at: tuple[float, ...]) -> bool:
    centreline = Centreline(shape.centreline)
    eyes = [
        max(site.region.radius, 0.5 * shape.thickness) - math.dist(site.at[:2], at[:2])
        for site in request.sites
        if isinstance(site.region, Disc)
    ]
    beside = 0.5 * shape.thickness - math.dist(centreline.evaluate(centreline.closest(at[:2])), at[:2])
    return max([beside, *eyes]) >= -ON_CENTRELINE * shape.thickness


def _check_on_strip(centreline: Centreline, thickness: float, site: InterfaceSite, request: MeshRequest) -> None:
    """Refuse a joint off the strip, before its eye hides that it is.

    Raises:
        MeshingError: it lies farther than half the thickness from the centreline, or beyond an end.
    """
    tolerance = ON_CENTRELINE * thickness
    s = centreline.closest(site.at[:2])
    away = np.asarray(site.at[:2]) - centreline.evaluate(s)
    beyond = abs(away @ centreline.tangent(s))
    if np.linalg.norm(away) > 0.5 * thickness + tolerance or beyond > tolerance:
        x, y = site.at[:2]
        raise MeshingError(
            request.part_at(site),
            f"the point ({x:g}, {y:g}) is not on the link: it is {np.linalg.norm(away):g} away from the "
            f"centreline of a strip of thickness {thickness:g}",
            "Move the joint onto the centreline, or lead the centreline through the joint",
        )


def _draw(strip: Strip, sites: tuple[InterfaceSite, ...]) -> PlanView:
    """The strip and its eyes, all in units of the element size."""
    centreline = Centreline(strip.centreline)
    pins = {
        number: StripPin.place(site, centreline, strip.thickness)
        for number, site in enumerate(sites)
        if isinstance(site.region, Disc) and site.is_planar
    }
    sides = strip_sides(centreline, strip.thickness, [pin.station for pin in pins.values() if pin.touches_sides])
    rounded = {pin.station for pin in pins.values() if pin.rounds_end}
    face = _face(centreline, *sides, rounded)
    eyes = [region_face(pin.eye, corners=pin.corners) for pin in pins.values() if pin.eye]
    return PlanView(
        faces=gmsh.model.occ.fuse([face], eyes)[0] if eyes else [face],
        sites=tuple(pins[number].site if number in pins else site for number, site in enumerate(sites)),
        corners=tuple(pins[number].corners if number in pins else (0.0,) for number in range(len(sites))),
        refinements=tuple(expression for pin in pins.values() for expression in pin.refinements),
    )


def _face(centreline: Centreline, right: Side, left: Side, rounded: set[float]) -> DimTag:
    """The strip between its sides, with round ends at the parameters ``rounded`` and flat ends elsewhere."""
    rights, lefts = _points(right), _points(left)
    end = _end(centreline, centreline.end, right[-1][-1], (rights[-1][-1], lefts[-1][-1]), rounded)
    start = _end(centreline, 0.0, left[0][0], (lefts[0][0], rights[0][0]), rounded)
    up = [_curve(points) for points in rights]
    down = [_curve(points[::-1]) for points in lefts[::-1]]
    occ = gmsh.model.occ
    return 2, occ.addPlaneSurface([occ.addCurveLoop([*up, *end, *down, *start])])


def _points(side: Side) -> list[list[int]]:
    """The points of a side in the model, piece by piece; neighbouring pieces share one."""
    pieces: list[list[int]] = []
    for piece in side:
        shared = pieces[-1][-1:] if pieces else []
        pieces.append(shared + [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in piece[len(shared) :]])
    return pieces


def _curve(points: list[int]) -> int:
    """The line through two points, or the interpolating spline through more."""
    return gmsh.model.occ.addLine(*points) if len(points) == 2 else gmsh.model.occ.addSpline(points)


def _end(
    centreline: Centreline, station: float, corner: np.ndarray, points: tuple[int, int], rounded: set[float]
) -> list[int]:
    """Curves of one end of the strip, from the first of its corner ``points``, at ``corner``, to the second."""
    occ = gmsh.model.occ
    if station not in rounded:
        return [occ.addLine(*points)]
    middle = centreline.evaluate(station)
    x, y = corner - middle
    # two quarter turns to the left: the ends of a half circle do not tell on which side it runs
    tip, centre = occ.addPoint(*(middle + (-y, x)), 0.0), occ.addPoint(*middle, 0.0)
    return [occ.addCircleArc(points[0], centre, tip), occ.addCircleArc(tip, centre, points[1])]
