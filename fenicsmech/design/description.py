"""Links that may change, as plain data, and their checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fenicsmech.design.shape.shape_map import ShapeRequest
from fenicsmech.design.shape.spline import lay_out
from fenicsmech.errors import DescriptionError, finite, positive
from fenicsmech.mechanism import Centreline, Disc, FlexibleLink, Mechanism, Rectangle, Strip
from fenicsmech.multibody import Body, Linkage


@dataclass(frozen=True)
class Bounds:
    """Fabrication bounds of a link.

    Attributes:
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio r.
    """

    thickness: tuple[float, float]
    bend: float


@dataclass(frozen=True)
class SplineDesign:
    """A flexible link whose shape may change: centreline and thickness as cubic Hermite segments.

    Attributes:
        link: the link.
        segments: number of cubic segments; control points beyond those at joints and free ends go where these are
            farthest apart.
        thickness: least and largest thickness in the plane that can be made; a third to three times the drawn one
            by default.
        bend: largest curvature ratio r, the spacing of 500 samples over the radius of curvature.
        centreline: points the centreline runs through; that of a strip by default.
        ends_move: whether free ends, to which the centreline runs on beyond the last joint, may move; otherwise they
            stay where they are drawn, as a finger tip that has to reach a place.

    Raises:
        DescriptionError: a number makes no sense.
    """

    link: FlexibleLink
    segments: int
    thickness: tuple[float, float] | None = None
    bend: float = 0.08
    centreline: Sequence[Sequence[float]] | None = None
    ends_move: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.link, FlexibleLink):
            raise DescriptionError(
                "spline design", f"{self.link!r} is not a flexible link", "Name a flexible link of the mechanism"
            )
        part = f"design of link {self.link.name!r}"
        if not isinstance(self.segments, int) or self.segments < 1:
            raise DescriptionError(part, f"{self.segments!r} segments", "Give a whole number of at least 1")
        positive(f"curvature bound of the {part}", self.bend)
        if self.thickness is not None:
            if not isinstance(self.thickness, Sequence) or len(self.thickness) != 2:
                raise DescriptionError(part, f"thickness {self.thickness!r}", "Give the least and the largest one")
            least, most = self.thickness
            positive(f"least thickness of the {part}", least)
            finite(f"largest thickness of the {part}", most)
            if not least < most:
                raise DescriptionError(part, f"thickness from {least:g} to {most:g}", "Give the smaller one first")

    def bounds(self, thickness: float) -> Bounds:
        """The bounds for a link drawn with ``thickness``.

        Raises:
            DescriptionError: the drawn thickness is not within them.
        """
        least, most = self.thickness or (thickness / 3.0, 3.0 * thickness)
        if not least < thickness < most:
            raise DescriptionError(
                f"design of link {self.link.name!r}",
                f"its drawn thickness {thickness:.3g} is not between {least:g} and {most:g}",
                "Draw it within the bounds, or widen them",
            )
        return Bounds((least, most), self.bend)


def shape_request(design: SplineDesign, mechanism: Mechanism, linkage: Linkage) -> ShapeRequest:
    """The handles and spline of ``design``.

    Raises:
        DescriptionError: no centreline is known, the link has one joint and no free end, or there are fewer segments
            than gaps between joints and free ends.
    """
    link = design.link
    part = f"design of link {link.name!r}"
    if link not in mechanism.flexible_links:
        raise DescriptionError(part, f"it is not a flexible link of {mechanism.name!r}", "Name one of its links")
    points = design.centreline
    if points is None:
        if not isinstance(link.shape, Strip):
            raise DescriptionError(part, "its shape has no centreline", "Give centreline=…, points along the link")
        points = link.shape.centreline
    centreline = Centreline(points, part=part)
    bodies = [linkage.bodies[i] for i in linkage.interfaces[link]]
    request = ShapeRequest(
        link=mechanism.flexible_links.index(link),
        name=link.name,
        joints=tuple((body.centre[0], body.centre[1]) for body in bodies),
        turns=tuple(linkage.turns_about_z(body) for body in linkage.interfaces[link]),
        reach=tuple(_reach(body) for body in bodies),
        segments=design.segments,
        centreline=centreline,
        ends_move=design.ends_move,
        thickness=link.shape.thickness if isinstance(link.shape, Strip) else None,
    )
    lay_out(centreline, request.joints, request.reach, request.segments, part=part)  # refused before it is meshed
    return request


def _reach(interface: Body) -> float:
    """Radius of the smallest circle about a joint that contains its interface."""
    match interface.region:
        case Disc(radius=radius):
            return radius
        case Rectangle(length=length, width=width):
            return 0.5 * math.hypot(length, width)
    return 0.0


def check_designs(designs: Sequence[SplineDesign]) -> None:
    """Refuses designs of no link, and two of one link, with a DescriptionError."""
    if not designs:
        raise DescriptionError("design problem", "no link may change", "Name links with SplineDesign(…)")
    for design in designs:
        if not isinstance(design, SplineDesign):
            raise DescriptionError("design problem", f"{design!r} is not a design of a link", "Give SplineDesign(…)")
    names = [design.link.name for design in designs]
    for name in names:
        if names.count(name) > 1:
            raise DescriptionError(f"design of link {name!r}", "it is given twice", "Give each link once")
