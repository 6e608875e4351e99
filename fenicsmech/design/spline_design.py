"""What may change about a link, and what is wanted of the mechanism: plain data of a design problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.design.link_shape import ShapeRequest
from fenicsmech.errors import DescriptionError
from fenicsmech.joints import WELD
from fenicsmech.linkage import Linkage
from fenicsmech.mechanism import DRAWN, Configuration, FlexibleLink, Force, Mechanism, Strip
from fenicsmech.mechanism.checks import finite
from fenicsmech.meshing import Centreline


@dataclass(frozen=True)
class SplineDesign:
    """A flexible link whose shape may change: centreline and thickness as cubic Hermite segments.

    Attributes:
        link: the link.
        segments: number of cubic segments; control points beyond the joints go where joints are farthest apart.
        thickness: least and largest thickness in the plane that can be made.
        bend: largest curvature ratio.
        centreline: points the centreline runs through; that of a strip by default.
    """

    link: FlexibleLink
    segments: int
    thickness: tuple[float, float] = (1.0, 9.0)
    bend: float = 0.08
    centreline: Sequence[Sequence[float]] | None = None


@dataclass(frozen=True)
class Target:
    """A wanted sample of a load–displacement curve.

    Attributes:
        force_part: the force that acts.
        force: its magnitude.
        displacement: how far its point should move along it.
        configuration: motor positions.
    """

    force_part: Force
    force: float
    displacement: float
    configuration: Configuration = DRAWN

    def __post_init__(self) -> None:
        finite(f"force of a target for {self.force_part.name!r}", self.force)
        finite(f"displacement of a target for {self.force_part.name!r}", self.displacement)


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
        joints=joints,
        turns=tuple(at not in welded for at in joints),
        interior=tuple(int(n) for n in interior),
    )
