"""What may change about a link, and what is wanted of the mechanism: plain data of a design problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.checks import finite, positive
from fenicsmech.design.link_shape import ShapeRequest
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import WELD
from fenicsmech.mechanism import DRAWN, Centreline, Configuration, FlexibleLink, Force, Mechanism, Strip
from fenicsmech.multibody import Linkage

_RANGE = (1.0 / 3.0, 3.0)  # of thicknesses, in units of the drawn one: 1 … 9 mm for a link of 3 mm


@dataclass(frozen=True)
class SplineDesign:
    """A flexible link whose shape may change: centreline and thickness as cubic Hermite segments.

    Attributes:
        link: the link.
        segments: number of cubic segments; control points beyond the joints go where joints are farthest apart.
        thickness: least and largest thickness in the plane that can be made; a third to three times the drawn one
            by default.
        bend: largest curvature ratio r, the spacing of 500 samples over the radius of curvature.
        centreline: points the centreline runs through; that of a strip by default.

    Raises:
        DescriptionError: a number makes no sense.
    """

    link: FlexibleLink
    segments: int
    thickness: tuple[float, float] | None = None
    bend: float = 0.08
    centreline: Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.link, FlexibleLink):
            raise DescriptionError("spline design", f"{self.link!r} is no flexible link", "Name one of the mechanism's")
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


@dataclass(frozen=True)
class Bounds:
    """Fabrication bounds of a link.

    Attributes:
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio r.
    """

    thickness: tuple[float, float]
    bend: float


def bounds_of(design: SplineDesign, thickness: float) -> Bounds:
    """The bounds of ``design`` for a link drawn with ``thickness``.

    Raises:
        DescriptionError: the drawn thickness is not within them.
    """
    least, most = design.thickness or (_RANGE[0] * thickness, _RANGE[1] * thickness)
    if not least < thickness < most:
        raise DescriptionError(
            f"design of link {design.link.name!r}",
            f"its drawn thickness {thickness:.3g} is not between {least:g} and {most:g}",
            "Draw it within the bounds, or widen them",
        )
    return Bounds((least, most), design.bend)


@dataclass(frozen=True)
class Target:
    """A wanted sample of a load–displacement curve.

    Attributes:
        force_part: the force that acts.
        force: its magnitude.
        displacement: how far its point should move along it.
        configuration: motor positions.
        weight: how much its relative error counts beside those of other targets.

    Raises:
        DescriptionError: a number makes no sense.
    """

    force_part: Force
    force: float
    displacement: float
    configuration: Configuration = DRAWN
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.force_part, Force):
            raise DescriptionError("target", f"{self.force_part!r} is no force", "Give one of the mechanism's")
        finite(f"force of a target for {self.force_part.name!r}", self.force)
        finite(f"displacement of a target for {self.force_part.name!r}", self.displacement)
        positive(f"weight of a target for {self.force_part.name!r}", self.weight)


def shape_request(design: SplineDesign, mechanism: Mechanism, linkage: Linkage) -> ShapeRequest:
    """The handles and spline that ``design`` asks for.

    Raises:
        DescriptionError: no centreline is known, or there are fewer segments than gaps between joints.
    """
    link = design.link
    part = f"design of link {link.name!r}"
    if link not in mechanism.flexible_links:
        raise DescriptionError(part, f"it is not a flexible link of {mechanism.name!r}", "Name one of its links")
    points = design.centreline
    if points is None and not isinstance(link.shape, Strip):
        raise DescriptionError(part, "its shape has no centreline", "Give centreline=…, points along the link")
    centreline = Centreline(link.shape.centreline if points is None else points, part=part)
    bodies = [linkage.bodies[i] for i in linkage.interfaces[link]]
    joints = tuple(body.centre[:2] for body in bodies)
    stations = sorted(centreline.closest(at) for at in joints)
    gaps = np.diff(stations)
    interior = np.zeros(len(gaps), dtype=int)
    if design.segments < len(gaps):
        raise DescriptionError(
            part, f"{design.segments} segment(s) for {len(gaps)} gaps between joints", f"Give at least {len(gaps)}"
        )
    for _ in range(design.segments - len(gaps)):
        interior[int(np.argmax(gaps / (interior + 1)))] += 1
    welded = {joint.at[:2] for joint in mechanism.joints if joint.kind is WELD and link in (joint.a, joint.b)}
    return ShapeRequest(
        link=mechanism.flexible_links.index(link),
        name=link.name,
        centreline=centreline,
        thickness=link.shape.thickness if isinstance(link.shape, Strip) else None,
        joints=joints,
        turns=tuple(at not in welded for at in joints),
        interior=tuple(int(n) for n in interior),
    )
