"""The content of pictures: planar shapes of mechanisms and designs, in the user's unit of length.

A rigid link gets its outline from its joints, a solid link is seen from above. Values that are not finite and arrays
that do not fit each other are refused with a ``DescriptionError``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from fenicsmech.errors import DescriptionError, counted, index_array, positive, real_array, set_fields

Reals = NDArray[np.float64]


def _no_points() -> Reals:
    return np.empty((0, 2))


def _polygon(part: str, points: ArrayLike) -> Reals:
    polygon = real_array(part, points, None, 2)
    if len(polygon) < 3:
        raise DescriptionError(part, f"{counted(len(polygon), 'point')} given", "Give at least 3")
    return polygon


@dataclass(frozen=True, eq=False)
class FlexibleShape:
    """A meshed link as seen from above; give values to colour it.

    Args:
        points: (n, 2) vertices, deformed or not; vertices of no triangle are allowed.
        triangles: (m, 3) indices of vertices.
        values: (m, 3) at the corners of each triangle, or None.
        name: of the link, for messages.
    """

    points: Reals
    triangles: NDArray[np.int64]
    values: Reals | None = None
    name: str = ""

    def __post_init__(self) -> None:
        part = f"flexible shape '{self.name}'"
        points = real_array(f"points of {part}", self.points, None, 2)
        triangles = index_array(f"triangles of {part}", self.triangles, None, 3, below=len(points))
        if not len(triangles):
            raise DescriptionError(part, "it has no triangle", "Give the triangles of its mesh or of its plan view")
        set_fields(self, points=points, triangles=triangles)
        if self.values is not None:
            values = real_array(f"values at the corners of triangles of {part}", self.values, len(triangles), 3)
            set_fields(self, values=values)


@dataclass(frozen=True, eq=False)
class RigidShape:
    """A rigid link: ``outline`` is a (k, 2) polygon, closed by itself; ``fixed`` is part of the ground."""

    outline: Reals
    name: str = ""
    fixed: bool = False

    def __post_init__(self) -> None:
        set_fields(self, outline=_polygon(f"outline of rigid shape '{self.name}'", self.outline))


@dataclass(frozen=True, eq=False)
class Pin:
    """A joint at ``at`` (2,): a ring with a dot, a square where it is ``welded``."""

    at: Reals
    welded: bool = False

    def __post_init__(self) -> None:
        set_fields(self, at=real_array("position of a pin", self.at, 2))


@dataclass(frozen=True, eq=False)
class Arrow:
    """A force on the point ``at`` (2,), its tip; the longest ``vector`` (2,) of a picture has a fixed length."""

    at: Reals
    vector: Reals
    label: str = ""

    def __post_init__(self) -> None:
        for name, part in (("at", "position"), ("vector", "vector")):
            set_fields(self, **{name: real_array(f"{part} of arrow '{self.label}'", getattr(self, name), 2)})


@dataclass(frozen=True, eq=False)
class Trace:
    """The path of a point: ``points`` (n, 2) joined by a line, ``marks`` (k, 2) shown as dots on it."""

    points: Reals
    label: str = ""
    marks: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        for name in ("points", "marks"):
            set_fields(self, **{name: real_array(f"{name} of trace '{self.label}'", getattr(self, name), None, 2)})


@dataclass(frozen=True, eq=False)
class PeakMark:
    """The largest value of a panel, at the point ``at`` (2,); ``label`` stands beside it."""

    at: Reals
    value: float
    label: str = ""

    def __post_init__(self) -> None:
        set_fields(self, at=real_array(f"position of peak '{self.label}'", self.at, 2))


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
        peak: the largest of the values that colour links, singular places left out.
    """

    undeformed: MechanismShape
    deformed: tuple[MechanismShape, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    traces: tuple[Trace, ...] = ()
    title: str = ""
    peak: PeakMark | None = None


@dataclass(frozen=True, eq=False)
class OutlineShape:
    """The rest shape of a link as seen from above, by its outline.

    Args:
        loops: (n, 2) polygons, closed by themselves, in any orientation: the outer rim, then its holes.
        centreline: (n, 2) points along the link.
        thickness: (n,) thickness in the plane at the points of the centreline, or None.
        controls: (k, 2) control points of the centreline.
    """

    loops: Sequence[Reals]
    centreline: Reals = field(default_factory=_no_points)
    thickness: Reals | None = None
    controls: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        loops = tuple(_polygon("loop of a link's outline", loop) for loop in self.loops)
        if not loops:
            raise DescriptionError("outline of a link", "there are no loops", "Give its outer rim, then its holes")
        centreline = real_array("centreline of a link", self.centreline, None, 2)
        controls = real_array("control points of a link", self.controls, None, 2)
        set_fields(self, loops=loops, centreline=centreline, controls=controls)
        if self.thickness is not None:
            part, problem = "thickness along a link's centreline", "it is not positive at two points or more"
            thickness = real_array(part, self.thickness, len(centreline))
            if len(thickness) < 2 or thickness.min() <= 0.0:
                raise DescriptionError(part, problem, "Give the thickness at every point of the centreline")
            set_fields(self, thickness=thickness)


@dataclass(frozen=True, eq=False)
class DesignShape:
    """A link before and after an optimisation; ``joints`` (m, 2) stay where they are."""

    name: str
    before: OutlineShape
    after: OutlineShape
    joints: Reals = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        set_fields(self, joints=real_array(f"joints of link '{self.name}'", self.joints, None, 2))


def rigid_outline(points: ArrayLike, width: float) -> Reals:
    """The outline of all points within ``width``/2 of the convex hull of the joints: the hull of discs around them.

    One point gives a disc, two a bar with round ends, three and more a rounded plate.

    Args:
        points: (k, 2) joint positions; coincident and collinear ones are allowed.
        width: of the bar, in the unit of the points.

    Returns:
        (m, 2) polygon, counter-clockwise, not closed.
    """
    joints = real_array("joints of a rigid link", points, None, 2)
    if not len(joints):
        raise DescriptionError("outline of a rigid link", "there are no joints", "Give at least one point")
    radius = 0.5 * positive("width of a rigid link's outline", width)
    angles = np.linspace(0.0, 2.0 * np.pi, 384, endpoint=False)  # of the polygon that stands for a disc
    circle = radius * np.column_stack((np.cos(angles), np.sin(angles)))
    discs = (joints[:, None] + circle).reshape(-1, 2)
    return discs[ConvexHull(discs).vertices]


def outer_faces(points: ArrayLike, tets: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The boundary faces of a solid mesh.

    Args:
        points: (n, 3) vertices.
        tets: (m, 4) indices of vertices, in any orientation.

    Returns:
        (k, 3) vertices of the triangles, counter-clockwise seen from outside; (k,) the tetrahedron each belongs to.
    """
    vertices = real_array("points of a solid mesh", points, None, 3)
    cells = index_array("tetrahedra of a solid mesh", tets, None, 4, below=len(vertices))
    faces = cells[:, ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))].reshape(-1, 3)  # face i is opposite to vertex i
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    boundary = first[count == 1]
    faces, opposite, owner = faces[boundary], cells.reshape(-1)[boundary], boundary // 4
    inward = np.einsum("ij,ij->i", _normals(vertices, faces), vertices[faces[:, 0]] - vertices[opposite]) < 0.0
    return np.where(inward[:, None], faces[:, [0, 2, 1]], faces), owner


def _normals(vertices: Reals, faces: NDArray[np.int64]) -> Reals:
    """Of triangles, twice as long as their area, (k, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def plan_view(points: ArrayLike, tets: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The boundary faces whose outer unit normal has z > 0.5.

    Take it from the undeformed mesh and use it with deformed points, so that all pictures show the same triangles.

    Args:
        points: (n, 3) vertices.
        tets: (m, 4) indices of vertices, in any orientation.

    Returns:
        (k, 3) vertices of the triangles, counter-clockwise seen from +z; (k,) the tetrahedron each belongs to.
    """
    faces, owner = outer_faces(points, tets)
    normal = _normals(np.asarray(points, dtype=float), faces)
    top = normal[:, 2] > 0.5 * np.linalg.norm(normal, axis=1)
    if not top.any():
        part, problem = "plan view of a solid mesh", "no face has a normal towards +z"
        raise DescriptionError(part, problem, "Extrude planar links along z")
    return faces[top], owner[top]
