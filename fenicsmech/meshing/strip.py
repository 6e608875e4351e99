"""Meshes of strips: constant thickness t along a centreline c(s), with round eyes at the pins.

The sides are the curves c(s) ∓ n(s) t/2, n the unit normal. The link is the union of the strip between them and of a
disc around each pin, whose radius is that of the interface or t/2, whichever is larger. Between the sides the strip
ends flat, at a pin in the round of its eye.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from fenicsmech.errors import MeshingError, point_text
from fenicsmech.mechanism import Centreline, Disc, Rectangle, Strip
from fenicsmech.meshing.cutting import (
    DimTag,
    PlaneDrawing,
    circle_segments,
    gap_refinement,
    in_units_of,
    mesh_planar,
    region_face,
)
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.link_mesher import InterfaceSite, MeshRequest, check_shape, clamp_defect, holds, mesh_shape
from fenicsmech.meshing.session import gmsh
from fenicsmech.polygons import first_crossing

_ON_CENTRELINE = 1e-3  # of the thickness: deviation of rounded coordinates


@mesh_shape.register
def _(shape: Strip, request: MeshRequest) -> LinkMesh:
    strip = in_units_of(shape, request.size)
    return mesh_planar(request, shape.depth, lambda sites: _draw(strip, sites))


@check_shape.register
def _(shape: Strip, request: MeshRequest) -> None:
    centreline, thickness = Centreline(shape.centreline, part=f"centreline of {request.part}"), shape.thickness
    s = centreline.samples(32)
    curvature = np.abs(centreline.curvature(s))
    sharpest = int(np.argmax(curvature))
    if curvature[sharpest] * 0.5 * thickness >= 1.0:
        raise MeshingError(
            request.part,
            f"the centreline bends with radius {1.0 / curvature[sharpest]:g} near "
            f"{point_text(centreline.evaluate(s[sharpest]))}, which is not more than half the thickness {thickness:g}",
            "Make the strip thinner or its centreline smoother",
        )
    right, left = (_parallel(centreline, s, offset * thickness) for offset in (-0.5, 0.5))
    crossing = first_crossing(np.concatenate([right, left[::-1]]))
    if crossing is not None:
        remedy = "Move the centreline's parts away from each other, or make the strip thinner"
        raise MeshingError(request.part, f"the strip crosses itself near {point_text(crossing)}", remedy)
    for site in request.sites:
        station = centreline.closest(site.at[:2])
        away = np.asarray(site.at[:2]) - centreline.evaluate(station)
        beyond, tolerance = abs(away @ centreline.tangent(station)), _ON_CENTRELINE * thickness
        if np.linalg.norm(away) > 0.5 * thickness + tolerance or beyond > tolerance:
            raise MeshingError(
                request.part_at(site),
                f"the point {point_text(site.at[:2])} is not on the link: it is {np.linalg.norm(away):g} away from the "
                f"centreline of a strip of thickness {thickness:g}",
                "Move the joint onto the centreline, or lead the centreline through the joint",
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
    return max([beside, *eyes]) >= -_ON_CENTRELINE * shape.thickness


@clamp_defect.register
def _(shape: Strip, site: InterfaceSite) -> tuple[str, str] | None:
    # a clamp's inner face, where the centreline leaves the rectangle, stands across the strip (to 1°, more than rounded
    # angles miss it by) and is at least as wide
    if not isinstance(site.region, Rectangle) or not site.is_planar:
        return None
    curve, halves = Centreline(shape.centreline), 0.5 * np.array([site.region.length, site.region.width])
    c, s = math.cos(site.region.angle), math.sin(site.region.angle)
    axes, centre = np.array([[c, s], [-s, c]]), site.centre[:2]

    def inside(at: np.ndarray) -> np.ndarray:
        return np.all(np.abs((curve.evaluate(at) - centre) @ axes.T) <= halves, axis=-1)

    samples = curve.samples(64)
    held = inside(samples)
    for k in np.flatnonzero(held[1:] != held[:-1]):
        kept, left = samples[[k, k + 1] if held[k] else [k + 1, k]]
        for _ in range(50):
            middle = 0.5 * (kept + left)
            kept, left = (middle, left) if inside(middle) else (kept, middle)
        place, normal = curve.evaluate(kept), 0.5 * shape.thickness * curve.normal(kept)
        face = int(np.argmax(np.abs(axes @ (place - centre)) / halves))
        turn = math.degrees(math.asin(min(1.0, abs(axes[face] @ normal) / (0.5 * shape.thickness))))
        if turn > 1.0:
            right = math.atan2(*curve.tangent(kept)[::-1]) + (0.5 * math.pi if face else 0.0)
            return (
                f"the face of its {site.region} near {point_text(place)} "
                f"is turned by {turn:.3g}° from across the strip",
                f"Use Mechanism.clamp(…), or angle={right:.6g} (rad, from x)",
            )
        edges = np.array([place + normal, place - normal]) - centre
        if np.abs(edges @ axes[1 - face]).max() < halves[1 - face] * (1.0 + 1e-6):
            continue
        return (
            f"its {site.region} does not cover the width {shape.thickness:g} of the strip near {point_text(place)}",
            "Use Mechanism.clamp(…), or make it wider",
        )
    if not held.any():
        return f"its {site.region} does not reach the centreline of the strip", "Use Mechanism.clamp(…), or move it"
    return None


@dataclass(frozen=True)
class _Pin:
    """A pin in a strip, in units of the element size.

    The site is moved onto the centreline, and its disc to the strip's sides, where it almost meets them.
    """

    site: InterfaceSite
    radius: float  # of the disc that the pin holds
    half_thickness: float  # of the strip
    inward: np.ndarray  # unit vector along the strip, away from its nearer end
    station: float  # parameter of the centreline's point nearest to the pin
    offset: float  # of the pin to the left of the centreline
    to_end: float  # distance from the nearer end of the centreline

    @classmethod
    def place(cls, site: InterfaceSite, radius: float, centreline: Centreline, thickness: float) -> _Pin:
        """The pin at ``site``, which has a disc of ``radius``, in the strip along ``centreline``."""
        half, at = 0.5 * thickness, np.asarray(site.at[:2])
        ends = {end: centreline.evaluate(end) for end in (0.0, centreline.end)}
        nearer = min(ends, key=lambda end: np.linalg.norm(at - ends[end]))
        s = nearer if np.linalg.norm(at - ends[nearer]) <= _ON_CENTRELINE * thickness else centreline.closest(at)
        foot, normal = centreline.evaluate(s), centreline.normal(s)
        offset = float((at - foot) @ normal)
        if abs(offset) <= _ON_CENTRELINE * thickness:
            at, offset = foot, 0.0
        inward = centreline.tangent(s) * (1.0 if nearer == 0.0 else -1.0)
        # the polygon that stands for a circle does not resolve differences of the radius below a chord's height
        # r (1 − cos(π/n)): gaps thinner than that, and than 2 % of the strip, are closed
        height = radius * (1.0 - math.cos(math.pi / circle_segments(radius, 1.0)))
        radius = half if abs(radius - half) <= min(height, 0.02 * half) else radius
        placed = replace(site, at=(*at.tolist(), *site.at[2:]), region=Disc(radius))
        return cls(placed, radius, half, inward, s, offset, float(np.linalg.norm(at - ends[nearer])))

    @property
    def corners(self) -> tuple[float, ...]:
        """Angles (rad) at which the disc's outline has vertices.

        Where the disc touches the sides, which have a vertex there too; only towards the end if it crosses them.
        """
        outward = math.atan2(-self.inward[1], -self.inward[0])
        return tuple(outward + k * 0.5 * math.pi for k in range(1 if self.radius > self.half_thickness else 4))

    @property
    def touches_sides(self) -> bool:
        """Whether the disc, or an eye as wide as the strip, may touch the strip's sides."""
        return self.radius <= self.half_thickness and self.offset == 0.0

    @property
    def rounds_end(self) -> bool:
        """Whether the eye is the round end of the strip, no wider than the strip."""
        return self.radius <= self.half_thickness and self.to_end == 0.0

    @property
    def eye(self) -> InterfaceSite | None:
        """The disc that the eye adds to the strip, if it adds any besides a round end."""
        inside = self.offset == 0.0 and self.to_end >= self.half_thickness
        if self.radius <= self.half_thickness and (self.rounds_end or inside):
            return None
        return replace(self.site, region=Disc(max(self.radius, self.half_thickness)))

    @property
    def refinements(self) -> list[str]:
        """Element sizes, as gmsh expressions, for the narrow places between the disc and the link's edge."""
        around_eye, beside = self.half_thickness - self.radius, self.half_thickness - abs(self.offset) - self.radius
        both_ways = (self.inward, -self.inward)
        gaps: list[tuple[float, tuple[np.ndarray, ...]]] = [(around_eye, ())] if self.eye else []
        gaps.append((beside, both_ways[:1] if self.rounds_end else both_ways))
        at = self.site.at[:2]
        return [gap_refinement(at, gap, self.radius, widening) for gap, widening in gaps if gap > 0.0]


def _draw(strip: Strip, sites: tuple[InterfaceSite, ...]) -> PlaneDrawing:
    """The strip and its eyes, all in units of the element size."""
    centreline = Centreline(strip.centreline)
    pins = {
        number: _Pin.place(site, site.region.radius, centreline, strip.thickness)
        for number, site in enumerate(sites)
        if isinstance(site.region, Disc) and site.is_planar
    }
    breaks = [pin.station for pin in pins.values() if pin.touches_sides]
    rounded = {pin.station for pin in pins.values() if pin.rounds_end}
    face = _face(centreline, strip.thickness, breaks, rounded)
    eyes = [region_face(pin.eye, corners=pin.corners) for pin in pins.values() if pin.eye]
    return PlaneDrawing(
        faces=gmsh.model.occ.fuse([face], eyes)[0] if eyes else [face],
        sites=tuple(pins[number].site if number in pins else site for number, site in enumerate(sites)),
        corners=tuple(pins[number].corners if number in pins else (0.0,) for number in range(len(sites))),
        refinements=tuple(expression for pin in pins.values() for expression in pin.refinements),
    )


def _face(centreline: Centreline, thickness: float, breaks: Sequence[float], rounded: set[float]) -> DimTag:
    """The strip as a face, its sides divided at the parameters ``breaks``, its ends round at those of ``rounded``."""
    stations = np.unique(np.clip([0.0, *breaks, centreline.end], 0.0, centreline.end))
    stations = stations[np.append(True, np.diff(stations) > 1e-6 * thickness)]
    right, left = (_side(centreline, offset * thickness, stations) for offset in (-0.5, 0.5))
    rights, lefts = _points(right), _points(left)
    end = _end(centreline, centreline.end, right[-1][-1], (rights[-1][-1], lefts[-1][-1]), rounded)
    start = _end(centreline, 0.0, left[0][0], (lefts[0][0], rights[0][0]), rounded)
    occ = gmsh.model.occ
    # two points give a line, more the interpolating spline
    up, down = (
        [occ.addLine(*points) if len(points) == 2 else occ.addSpline(points) for points in side]
        for side in (rights, [points[::-1] for points in lefts[::-1]])
    )
    return 2, occ.addPlaneSurface([occ.addCurveLoop([*up, *end, *down, *start])])


def _side(centreline: Centreline, offset: float, stations: np.ndarray) -> list[np.ndarray]:
    """Points of the curve parallel to a centreline, in pieces between the parameters ``stations``.

    A straight piece has its two ends, a curved one as many points as the interpolating cubic spline through them needs
    to follow the curve between them to 1e-6 of the thickness. Pieces share their end points.
    """
    straight = np.abs(centreline.curvature(centreline.samples(32))).max() * centreline.end < 1e-9  # but for rounding
    pieces = []
    for start, end in pairwise(stations):
        knots, margin = centreline.knots, 1e-6 * (end - start)
        ends = np.concatenate([[start], knots[(knots > start + margin) & (knots < end - margin)], [end]])
        spans = len(ends) - 1
        points = _parallel(centreline, np.array([start, end]), offset)
        for parts in () if straight else (8, 16, 32, 64, 128):  # between two knots
            s = np.interp(np.arange(2 * parts * spans + 1) / (2 * parts), np.arange(spans + 1), ends)
            fine = _parallel(centreline, s, offset)
            points, between = fine[::2], fine[1::2]
            if np.linalg.norm(CubicSpline(s[::2], points)(s[1::2]) - between, axis=1).max() <= 2e-6 * abs(offset):
                break
        pieces.append(points)
    return pieces


def _parallel(centreline: Centreline, s: np.ndarray, offset: float) -> np.ndarray:
    """Points to the left of those at the parameters ``s`` by ``offset``."""
    return centreline.evaluate(s) + offset * centreline.normal(s)


def _points(side: Sequence[np.ndarray]) -> list[list[int]]:
    """The points of a side in the model, piece by piece; neighbouring pieces have one in common."""
    pieces: list[list[int]] = []
    for piece in side:
        shared = pieces[-1][-1:] if pieces else []
        pieces.append(shared + [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in piece[len(shared) :]])
    return pieces


def _end(
    centreline: Centreline, station: float, corner: np.ndarray, points: tuple[int, int], rounded: set[float]
) -> list[int]:
    """Curves of one end of the strip, from the first of its corner ``points``, at ``corner``, to the second."""
    occ = gmsh.model.occ
    if station not in rounded:
        return [occ.addLine(*points)]
    middle = centreline.evaluate(station)
    x, y = corner - middle
    # two quarter turns to the left: the ends of a half circle do not determine on which side it runs
    tip, centre = occ.addPoint(*(middle + (-y, x)), 0.0), occ.addPoint(*middle, 0.0)
    return [occ.addCircleArc(points[0], centre, tip), occ.addCircleArc(tip, centre, points[1])]
