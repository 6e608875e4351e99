"""The mesh of a link from its shape: the request, the functions of each kind of shape, the checks of every mesh."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from itertools import combinations

import numpy as np

from fenicsmech.errors import DescriptionError, MeshingError, point_text, positive, set_fields, whole
from fenicsmech.log import logger
from fenicsmech.mechanism import Disc, Region, Shape
from fenicsmech.meshing.link_mesh import FREE, LinkMesh, cell_measures, count_pieces

LEAST_SEGMENTS = 8
"""Least number of segments of a circle."""

_log = logger(__name__)


@dataclass(frozen=True)
class InterfaceSite:
    """A region of a link that moves as a rigid body because a joint holds it.

    In the plane the region is a disc or a rectangle around ``at``; in space the cylinder or the box that it
    sweeps along ``axis``, all through the link.

    Attributes:
        at: the joint's point, 2 or 3 coordinates. Two coordinates leave the height along z open.
        region: extent of the interface across the axis.
        axis: unit vector along which the region is swept in space; its sign does not matter. Not used in 2D.
        name: the joint's name, for messages.
    """

    at: tuple[float, ...]
    region: Region
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    name: str = ""

    @property
    def is_planar(self) -> bool:
        """Whether the axis runs along z, so that the region is a figure in the plan view."""
        return math.hypot(self.axis[0], self.axis[1]) <= 1e-9 * abs(self.axis[2])

    @property
    def centre(self) -> np.ndarray:
        """The joint's point in space, shape (3,); z = 0 if it was given in the plane."""
        return np.array([*self.at, 0.0][:3])

    @property
    def reach(self) -> float:
        """Radius of the smallest circle about the joint's point that contains the region."""
        if isinstance(self.region, Disc):
            return self.region.radius
        return 0.5 * math.hypot(self.region.length, self.region.width)

    @property
    def frame(self) -> np.ndarray:
        """Right-handed orthonormal frame with its third row along the axis, shape (3, 3).

        The frame is the smallest rotation of the x-y-z frame, after the axis is turned to z > 0 (to y > 0, then
        x > 0 where that is zero), so that an axis and its opposite give the same region.
        """
        w = np.array(self.axis, dtype=float) / np.linalg.norm(self.axis)
        w *= np.sign(w[np.flatnonzero(np.abs(w) > 1e-12)[-1]])
        x, y, z = w
        # Rodrigues' formula for the rotation that takes e_z to w
        h = 1.0 + z
        return np.array([[1.0 - x * x / h, -x * y / h, -x], [-x * y / h, 1.0 - y * y / h, -y], [x, y, z]])

    def across(self, points: np.ndarray) -> np.ndarray:
        """Coordinates of ``points`` ((n, 2) or (n, 3)) relative to the site, across its axis, shape (n, 2)."""
        dim = points.shape[1]
        return (points - self.centre[:dim]) @ self.frame[:2, :dim].T

    def along(self, points: np.ndarray) -> np.ndarray:
        """Coordinates of ``points`` ((n, 3)) relative to the site, along its axis, shape (n,)."""
        return (points - self.centre) @ self.frame[2]

    def contains(self, points: np.ndarray, tolerance: float) -> np.ndarray:
        """Mask (n,) of ``points`` ((n, 2) or (n, 3)) in the region or within ``tolerance`` of it."""
        offsets, region = self.across(points), self.region
        if isinstance(region, Disc):
            return np.hypot(*offsets.T) <= region.radius + tolerance
        c, s = math.cos(region.angle), math.sin(region.angle)
        turned = offsets @ np.array([[c, -s], [s, c]])
        return np.all(np.abs(turned) <= 0.5 * np.array([region.length, region.width]) + tolerance, axis=1)


@dataclass(frozen=True)
class MeshRequest:
    """The mesh wanted of one link.

    Attributes:
        link: the link's name, for messages.
        sites: of its interfaces, in the order of ``LinkMesh.interface``; the mesh conforms to their regions.
        dim: 2 (triangles) or 3 (tetrahedra).
        size: target edge length, in the plane for links that are extruded.
        layers: layers through the depth of an extruded link; None: one per two element sizes.
        segments: least number of segments of the circle around a pin.
        half: in space, mesh the half above the mid-plane z = 0 only; ``layers`` are those of the half.

    Raises:
        DescriptionError: a number is out of its range.
    """

    link: str
    sites: tuple[InterfaceSite, ...]
    dim: int
    size: float
    layers: int | None = None
    segments: int = LEAST_SEGMENTS
    half: bool = False

    def __post_init__(self) -> None:
        part = f"mesh of {self.part}"
        set_fields(self, size=positive(f"element size, {part}", self.size))
        if self.dim not in (2, 3):
            raise DescriptionError(part, f"dim is {self.dim!r}", "Give 2 or 3")
        if self.layers is not None:
            whole(f"number of layers, {part}", self.layers, least=1)
        whole(f"number of segments around pins, {part}", self.segments, least=LEAST_SEGMENTS)
        if self.dim == 2 or self.half:
            # in the plane every region is swept along z, whatever the joint's own axis, such as that of a slider
            set_fields(self, sites=tuple(replace(site, axis=(0.0, 0.0, 1.0)) for site in self.sites))

    @property
    def part(self) -> str:
        """The name of the link in messages."""
        return f"link {self.link!r}"

    def part_at(self, site: InterfaceSite) -> str:
        """The names of a joint and the link in messages."""
        return f"joint {site.name!r} on {self.part}"

    def overlap(self, first: int, second: int) -> MeshingError:
        """The error of sites ``first`` and ``second`` that touch or overlap."""
        one, other = self.sites[first], self.sites[second]
        return MeshingError(
            self.part,
            f"the interface regions of joints {one.name!r} at {point_text(one.at)} and {other.name!r} at "
            f"{point_text(other.at)} touch or overlap",
            "Make the regions smaller or move the joints apart",
        )


@singledispatch
def mesh_shape(shape: object, request: MeshRequest) -> LinkMesh:
    """The mesh of ``shape`` wanted by ``request``; each kind of shape registers its own function."""
    raise TypeError(f"{type(shape).__name__} is not a shape that can be meshed")


@singledispatch
def check_shape(shape: object, request: MeshRequest) -> None:
    """Refuses, before anything is meshed, outlines that cross themselves, files that cannot be read, and joints off
    the link."""
    raise TypeError(f"{type(shape).__name__} is not a shape that can be meshed")


@singledispatch
def holds(shape: object, request: MeshRequest, at: tuple[float, ...]) -> bool:
    """Whether the point ``at`` lies on ``shape``, as far as is known without a mesh; True in doubt."""
    return True


@singledispatch
def clamp_defect(shape: object, site: InterfaceSite) -> tuple[str, str] | None:
    """The way in which a rectangle differs from a clamp across ``shape``, and a remedy; None where it does not."""
    return None


def mesh_link(name: str, shape: Shape, sites: Sequence[InterfaceSite] = (), **options) -> LinkMesh:
    """Meshes one link so that the cells of each interface fill the region where its joint holds the link.

    The same input gives the same arrays. No unit of length is preferred, except that STEP files are read in mm.

    Args:
        name: the link's name, for messages.
        shape: the link's shape.
        sites: of its interfaces, in the order of ``LinkMesh.interface``.
        options: ``dim``, ``size`` and further attributes of a ``MeshRequest``.

    Raises:
        MeshingError: the link cannot be meshed as described, a joint is not on the link or holds no cell, or the
            regions of two joints touch.
        DescriptionError: an option is out of its range, or ``half`` is set for a shape without mirror symmetry.
    """
    request = MeshRequest(name, tuple(sites), **options)
    check_shape(shape, request)
    mesh = mesh_shape(shape, request)
    _check_cells(mesh, request)
    for number, site in enumerate(request.sites):
        _check_held(mesh, request, number, site)
    _check_interfaces(mesh, request)
    return mesh


def check_link(
    name: str, shape: Shape, sites: Sequence[InterfaceSite], points: Mapping[str, Sequence[float]], **options
) -> None:
    """Checks a link before it is meshed; arguments and errors as for ``mesh_link``.

    A warning is logged for rectangles that do not hold a strip as a clamp across it would.

    Args:
        points: further points that must be on the link, by name: where forces act and displacements are read.
    """
    request = MeshRequest(name, tuple(sites), **options)
    check_shape(shape, request)
    for site in request.sites:
        if defect := clamp_defect(shape, site):
            _log.warning("%s: %s. %s", request.part_at(site), *defect)
    for part, at in points.items():
        if not holds(shape, request, tuple(at)):
            problem = f"the point {point_text(at)} is not on {request.part}"
            raise MeshingError(f"{part!r}", problem, "Move it onto the link")


def _check_cells(mesh: LinkMesh, request: MeshRequest) -> None:
    """Refuses cells without volume, and links in pieces."""
    longest = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    flat = np.flatnonzero(cell_measures(mesh.points, mesh.cells) <= 1e-12 * longest**mesh.dim)
    if len(flat):
        where = point_text(mesh.points[mesh.cells[flat[0]]].mean(axis=0))
        problem = f"cells have no volume: {len(flat)} of {len(mesh.cells)}, for example at {where}"
        remedy = "Remove tiny features from the shape, or change the element size"
        raise MeshingError(request.part, problem, remedy)
    pieces = count_pieces(mesh.cells)
    if pieces > 1:
        problem = f"the link falls into {pieces} separate pieces"
        raise MeshingError(request.part, problem, "Describe each piece as a link of its own")


def _check_held(mesh: LinkMesh, request: MeshRequest, number: int, site: InterfaceSite) -> None:
    """Refuses a joint off the link, or that holds no cell."""
    held, part, place = mesh.cells_of(number), request.part_at(site), f"the point {point_text(site.at)}"
    tolerance = 1e-2 * request.size  # of joints off their link, by rounded coordinates or flattened arcs
    offsets = site.across(mesh.points)
    away = _distance(offsets, mesh.cells)
    if away > tolerance and not _surrounds(offsets, held):
        remedy = "Move the joint onto the link, or change the link's shape"
        raise MeshingError(part, f"{place} is not on the link, but {away:g} away from it", remedy)
    if not len(held):
        problem = f"no cell lies in {site.region} around {point_text(site.at)}"
        raise MeshingError(part, problem, "Make the region larger or the elements smaller")
    if mesh.dim == len(site.at) == 3:
        heights = site.along(mesh.points[np.unique(held)])
        if heights.min() > tolerance or heights.max() < -tolerance:
            raise MeshingError(
                part,
                f"{place} is not on the link: along the joint's axis the link lies between "
                f"{heights.min():g} and {heights.max():g} from it",
                "Move the joint along its axis onto the link",
            )


def _distance(offsets: np.ndarray, cells: np.ndarray) -> float:
    """Distance of the origin of the plane from the projection of the nearest cell; 0 inside one."""
    nearest = math.inf
    for kept in combinations(range(cells.shape[1]), 3):
        corners = offsets[cells[:, list(kept)]]
        edges = np.roll(corners, -1, axis=1) - corners
        squares = np.maximum(np.einsum("mkd,mkd->mk", edges, edges), np.finfo(float).tiny)
        # twice the area to the left of each edge, seen from the origin; their sum is twice the triangle's area
        left = edges[..., 1] * corners[..., 0] - edges[..., 0] * corners[..., 1]
        upright = np.abs(left.sum(axis=1)) <= 1e-9 * squares.max(axis=1)  # projected onto a line
        if np.any(~upright & (np.all(left >= 0.0, axis=1) | np.all(left <= 0.0, axis=1))):
            return 0.0
        foot = np.clip(-np.einsum("mkd,mkd->mk", corners, edges) / squares, 0.0, 1.0)
        nearest = min(nearest, float(np.linalg.norm(corners + foot[..., None] * edges, axis=2).min()))
    return nearest


def _surrounds(offsets: np.ndarray, cells: np.ndarray) -> bool:
    """Whether the projections of ``cells`` stand around the origin on all sides, as around a pin hole."""
    if not len(cells):
        return False
    turn, angles = 2.0 * math.pi, np.arctan2(offsets[cells, 1], offsets[cells, 0])
    # a cell beside the origin subtends less than a half turn, measured from its own first vertex
    relative = np.angle(np.exp(1j * (angles - angles[:, :1])))
    starts = np.mod(angles[:, 0] + relative.min(axis=1), turn)
    order = np.argsort(starts)
    starts, reach = starts[order], np.maximum.accumulate((starts + np.ptp(relative, axis=1))[order])
    # the last arcs may run over into the next turn
    covered = np.maximum(reach, reach[-1] - turn)
    return bool(np.all(np.append(starts[1:], starts[0] + turn) - covered <= 1e-6))


def _check_interfaces(mesh: LinkMesh, request: MeshRequest) -> None:
    """Refuses two interfaces with a common vertex, which could not follow both bodies, and links held everywhere."""
    held = mesh.interface != FREE
    holder = np.repeat(mesh.interface[held], mesh.dim + 1)
    pairs = np.unique(np.column_stack([mesh.cells[held].reshape(-1), holder]), axis=0)
    shared = np.flatnonzero(pairs[1:, 0] == pairs[:-1, 0])
    if len(shared):
        raise request.overlap(int(pairs[shared[0], 1]), int(pairs[shared[0] + 1, 1]))
    if np.all(held):
        problem = "the interface regions of its joints cover the whole link, so nothing of it can bend"
        raise MeshingError(request.part, problem, "Make the regions smaller, or the link rigid")
