"""The content of pictures: planar shapes of mechanisms and designs, in the user's unit of length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fenicsmech.checks import index_array, real_array
from fenicsmech.errors import DescriptionError

Reals = NDArray[np.float64]


def _no_points() -> Reals:
    return np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class FlexibleShape:
    """A meshed link as seen from above; give values to colour it.

    Args:
        points: (n, 2) vertices, deformed or not; vertices of no triangle are allowed.
        triangles: (m, 3) indices of vertices.
        values: (m,) one per triangle, or None.
        point_values: (n,) one per vertex, or None; smoothly interpolated. At most one of the two.
        name: of the link, for messages.

    Raises:
        DescriptionError: the arrays do not fit each other or are not finite.
    """

    points: Reals
    triangles: NDArray[np.int64]
    values: Reals | None = None
    point_values: Reals | None = None
    name: str = ""

    def __post_init__(self) -> None:
        part = f"flexible shape '{self.name}'"
        points = real_array(f"points of {part}", self.points, None, 2)
        triangles = index_array(f"triangles of {part}", self.triangles, None, 3, below=len(points))
        if not len(triangles):
            raise DescriptionError(part, "it has no triangle", "Give the triangles of its mesh or of its plan view")
        if self.values is not None and self.point_values is not None:
            raise DescriptionError(part, "both values and point_values are given", "Give one of them")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "triangles", triangles)
        if self.values is not None:
            values = real_array(f"values of {part}, one per triangle,", self.values, len(triangles))
            object.__setattr__(self, "values", values)
        if self.point_values is not None:
            values = real_array(f"point_values of {part}, one per vertex,", self.point_values, len(points))
            object.__setattr__(self, "point_values", values)


@dataclass(frozen=True, eq=False)
class RigidShape:
    """A rigid link: ``outline`` is a (k, 2) polygon, closed by itself; ``fixed`` is part of the ground."""

    outline: Reals
    name: str = ""
    fixed: bool = False

    def __post_init__(self) -> None:
        outline = real_array(f"outline of rigid shape '{self.name}'", self.outline, None, 2)
        if len(outline) < 3:
            raise DescriptionError(f"rigid shape '{self.name}'", f"{len(outline)} point(s) given", "Give at least 3")
        object.__setattr__(self, "outline", outline)


@dataclass(frozen=True, eq=False)
class Pin:
    """A joint at ``at`` (2,): a ring with a dot, a square where it is ``welded``.

    ``radius`` None draws it in a size that suits the picture.
    """

    at: Reals
    radius: float | None = None
    welded: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", real_array("position of a pin", self.at, 2))
        if self.radius is not None and not self.radius > 0.0:
            raise DescriptionError("radius of a pin", f"{self.radius} is not positive", "Give a positive one or None")


@dataclass(frozen=True, eq=False)
class Arrow:
    """A force on the point ``at`` (2,); the longest ``vector`` (2,) of a picture gets a fixed length.

    ``pushes`` puts the head on the point, as where something presses; otherwise the tail sits there.
    """

    at: Reals
    vector: Reals
    label: str = ""
    pushes: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", real_array(f"position of arrow '{self.label}'", self.at, 2))
        object.__setattr__(self, "vector", real_array(f"vector of arrow '{self.label}'", self.vector, 2))


@dataclass(frozen=True, eq=False)
class Trace:
    """The path of a point: ``points`` (n, 2) joined by a line, ``marks`` (k, 2) shown as dots on it."""

    points: Reals
    label: str = ""
    marks: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", real_array(f"points of trace '{self.label}'", self.points, None, 2))
        object.__setattr__(self, "marks", real_array(f"marks of trace '{self.label}'", self.marks, None, 2))


@dataclass(frozen=True)
class MechanismShape:
    """All links and pins of a mechanism in one state."""

    flexible: tuple[FlexibleShape, ...] = ()
    rigid: tuple[RigidShape, ...] = ()
    pins: tuple[Pin, ...] = ()


@dataclass(frozen=True)
class Panel:
    """One of several pictures side by side.

    Args:
        undeformed: the mechanism without load; filled if nothing else is given, else a pale outline.
        deformed: states under load; the last is drawn in full, those before it pale.
        arrows: the forces on the last state.
        traces: paths of points.
        title: a line above the panel.
    """

    undeformed: MechanismShape
    deformed: tuple[MechanismShape, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    traces: tuple[Trace, ...] = ()
    title: str = ""


@dataclass(frozen=True, eq=False)
class LinkOutline:
    """The rest shape of a link as seen from above.

    Args:
        loops: (n, 2) polygons, closed by themselves, in any orientation: the outer rim, then its holes.
        centreline: (n, 2) points along the link.
        thickness: (n,) thickness in the plane at the points of the centreline, or None.
        controls: (k, 2) control points of the centreline.

    Raises:
        DescriptionError: no outline, the arrays do not fit each other, or a value that is not finite.
    """

    loops: Sequence[Reals]
    centreline: Reals = field(default_factory=_no_points)
    thickness: Reals | None = None
    controls: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        loops = tuple(real_array("loop of a link's outline", loop, None, 2) for loop in self.loops)
        if not loops:
            raise DescriptionError("outline of a link", "there are no loops", "Give its outer rim, then its holes")
        for loop in loops:
            if len(loop) < 3:
                raise DescriptionError("loop of a link's outline", f"{len(loop)} point(s) given", "Give at least 3")
        object.__setattr__(self, "loops", loops)
        for name, part in (("centreline", "centreline of a link"), ("controls", "control points of a link")):
            object.__setattr__(self, name, real_array(part, getattr(self, name), None, 2))
        if self.thickness is not None:
            thickness = real_array("thickness along a link's centreline", self.thickness, len(self.centreline))
            if not (len(thickness) > 1 and thickness.min() > 0.0):
                raise DescriptionError(
                    "thickness along a link's centreline",
                    "it is not positive at two points or more",
                    "Give the thickness at every point of the centreline",
                )
            object.__setattr__(self, "thickness", thickness)


@dataclass(frozen=True, eq=False)
class DesignShape:
    """A link before and after an optimisation; ``joints`` (m, 2) stay where they are."""

    name: str
    before: LinkOutline
    after: LinkOutline
    joints: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", real_array(f"joints of link '{self.name}'", self.joints, None, 2))
