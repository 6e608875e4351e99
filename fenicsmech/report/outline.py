"""The outline of a rigid link that is known by its joints only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError
from fenicsmech.report.arrays import real_array

_STEP = np.pi / 48  # of the polygon that stands for an arc


def rigid_outline(points: ArrayLike, width: float) -> NDArray[np.float64]:
    """All points within ``width``/2 of the convex hull of the joints.

    One point gives a disc, two a bar with round ends, three and more a rounded plate.

    Args:
        points: (k, 2) joint positions; coincident and collinear ones are allowed.
        width: of the bar, in the unit of the points.

    Returns:
        (m, 2) polygon, counter-clockwise, not closed.

    Raises:
        DescriptionError: no point, values that are not finite, or a width that is not positive.
    """
    joints = real_array("joints of a rigid link", points, None, 2)
    if not len(joints):
        raise DescriptionError("outline of a rigid link", "there is no joint", "Give at least one point")
    if not (width > 0.0 and np.isfinite(width)):
        raise DescriptionError("outline of a rigid link", f"the width is {width}", "Give a positive width")
    corners = _convex_hull(joints)
    # hull ⊕ disc: between the outer normals of its two edges each corner carries an arc
    if len(corners) == 1:
        spans = [(0.0, 2.0 * np.pi)]
    else:
        edges = np.roll(corners, -1, axis=0) - corners
        normals = np.arctan2(-edges[:, 0], edges[:, 1])  # of a counter-clockwise hull, pointing out
        spans = [(a, a + (b - a) % (2.0 * np.pi)) for a, b in zip(np.roll(normals, 1), normals, strict=True)]
    arcs = []
    for corner, (start, end) in zip(corners, spans, strict=True):
        angles = np.linspace(start, end, max(2, int(np.ceil((end - start) / _STEP)) + 1))
        arcs.append(corner + 0.5 * width * np.column_stack((np.cos(angles), np.sin(angles))))
    outline = np.concatenate(arcs)
    return outline[:-1] if len(corners) == 1 else outline


def _convex_hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, 2) corners, counter-clockwise; one or two when the points coincide or are collinear."""
    ordered = np.unique(points, axis=0)
    if len(ordered) <= 2:
        return ordered
    size = np.ptp(ordered, axis=0).max()
    flat = 1e-12 * size**2  # joints on a line that rounding has bent still make a bar

    def half(sequence: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        chain: list[NDArray[np.float64]] = []
        for point in sequence:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-1] - chain[-2], point - chain[-2]
                if ax * by - ay * bx > flat:
                    break
                chain.pop()
            chain.append(point)
        return chain

    lower, upper = half(ordered), half(ordered[::-1])
    return np.array(lower[:-1] + upper[:-1])
