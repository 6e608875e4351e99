"""What a picture of a design is made of: links before and after, in the user's unit of length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fenicsmech.errors import DescriptionError
from fenicsmech.report.arrays import real_array

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinkOutline:
    """The rest shape of a link as seen from above.

    Args:
        loops: (n, 2) polygons, closed by themselves, in any orientation: the outer rim, then its holes.
        centreline: (n, 2) points along the link, or None.
        thickness: (n,) thickness in the plane at the points of the centreline, or None.
        controls: (k, 2) control points of the centreline, or None.

    Raises:
        DescriptionError: no outline, the arrays do not fit each other, or a value that cannot be drawn.
    """

    loops: Sequence[Reals]
    centreline: Reals | None = None
    thickness: Reals | None = None
    controls: Reals | None = None

    def __post_init__(self) -> None:
        loops = tuple(real_array("loop of a link's outline", loop, None, 2) for loop in self.loops)
        if not loops:
            raise DescriptionError("outline of a link", "there is no loop", "Give its outer rim first, then its holes")
        for loop in loops:
            if len(loop) < 3:
                raise DescriptionError("loop of a link's outline", f"{len(loop)} point(s) given", "Give at least 3")
        object.__setattr__(self, "loops", loops)
        for name, part in (("centreline", "centreline of a link"), ("controls", "control points of a link")):
            given = getattr(self, name)
            points = np.empty((0, 2)) if given is None else given
            object.__setattr__(self, name, real_array(part, points, None, 2))
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
    joints: Reals | None = None

    def __post_init__(self) -> None:
        joints = np.empty((0, 2)) if self.joints is None else self.joints
        object.__setattr__(self, "joints", real_array(f"joints of link '{self.name}'", joints, None, 2))
