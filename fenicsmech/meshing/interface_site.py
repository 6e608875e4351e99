"""Where a joint takes hold of a link."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fenicsmech.mechanism import Disc, Rectangle


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
    region: Disc | Rectangle
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    name: str = ""

    @property
    def is_planar(self) -> bool:
        """Whether the axis runs along z, so that the region is a figure in the plan view."""
        return math.hypot(self.axis[0], self.axis[1]) <= 1e-9 * abs(self.axis[2])

    @property
    def centre(self) -> np.ndarray:
        """The joint's point in space, shape (3,); z = 0 if it was given in the plane."""
        return np.array([*self.at, 0.0][:3])


def axis_frame(axis: tuple[float, float, float]) -> np.ndarray:
    """Right-handed orthonormal frame with its third row along ``axis``, shape (3, 3).

    The frame is the smallest rotation of the x-y-z frame, after the axis is turned to z > 0 (to y > 0, then
    x > 0 where that is zero), so that an axis and its opposite give the same region.
    """
    w = np.array(axis, dtype=float) / np.linalg.norm(axis)
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


def across(site: InterfaceSite, points: np.ndarray) -> np.ndarray:
    """Coordinates of ``points`` ((n, 2) or (n, 3)) relative to the site, across its axis, shape (n, 2)."""
    dim = points.shape[1]
    return (points - site.centre[:dim]) @ axis_frame(site.axis)[:2, :dim].T


def along(site: InterfaceSite, points: np.ndarray) -> np.ndarray:
    """Coordinates of ``points`` ((n, 3)) relative to the site, along its axis, shape (n,)."""
    return (points - site.centre) @ axis_frame(site.axis)[2]
