"""The request for the mesh of one link, and the functions that each kind of shape implements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from fenicsmech.checks import point_text
from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import Disc, Region
from fenicsmech.meshing.link_mesh import FREE, LinkMesh

LEAST_SEGMENTS = 8
"""Least number of segments of a circle."""


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
    def frame(self) -> np.ndarray:
        """Right-handed orthonormal frame with its third row along the axis, shape (3, 3).

        The frame is the smallest rotation of the x-y-z frame, after the axis is turned to z > 0 (to y > 0, then
        x > 0 where that is zero), so that an axis and its opposite give the same region.
        """
        w = np.array(self.axis, dtype=float) / np.linalg.norm(self.axis)
        w *= np.sign(w[np.flatnonzero(np.abs(w) > 1e-12)[-1]])
        x, y, z = w
        # Rodrigues' formula for the rotation that takes e_z to w
        return np.array(
            [
                [1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), -x],
                [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), -y],
                [x, y, z],
            ]
        )

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
        sites: of its interfaces; the mesh conforms to their regions.
        dim: 2 or 3.
        size: target edge length in the plane of the link (everywhere, for a solid).
        layers: number of layers through the depth of an extruded link; None: chosen from depth and size.
        segments: least number of segments of the circle around a pin.
        half: in space, mesh the half above the mid-plane z = 0 only; ``layers`` are those of the half.
    """

    link: str
    sites: tuple[InterfaceSite, ...]
    dim: int
    size: float
    layers: int | None = None
    segments: int = LEAST_SEGMENTS
    half: bool = False

    @property
    def part(self) -> str:
        """The name of the link in messages."""
        return f"link {self.link!r}"

    def part_at(self, site: InterfaceSite) -> str:
        """The names of a joint and the link in messages."""
        return f"joint {site.name!r} on link {self.link!r}"

    def holder(self, candidates: Sequence[int]) -> int:
        """The one site among ``candidates`` (numbers of sites that contain a cell), or FREE.

        Raises:
            MeshingError: there are two.
        """
        if len(candidates) > 1:
            raise self.overlap(*candidates[:2])
        return candidates[0] if len(candidates) else FREE

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
    """Checks ``shape`` and its joints before anything is meshed.

    Raises:
        MeshingError: the outline of the shape crosses itself, its file cannot be read, or a joint is not on it.
    """
    raise TypeError(f"{type(shape).__name__} is not a shape that can be meshed")


@singledispatch
def holds(shape: object, request: MeshRequest, at: tuple[float, ...]) -> bool:
    """Whether the point ``at`` lies on ``shape``, as far as is known without a mesh; True in doubt."""
    return True
