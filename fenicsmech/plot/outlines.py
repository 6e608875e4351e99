"""Outlines: of a rigid link from its joints, of a solid mesh seen from above."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull

from fenicsmech.checks import index_array, real_array
from fenicsmech.errors import DescriptionError

Reals = NDArray[np.float64]


def rigid_outline(points: ArrayLike, width: float) -> Reals:
    """All points within ``width``/2 of the convex hull of the joints: the hull of discs around them.

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
        raise DescriptionError("outline of a rigid link", "there are no joints", "Give at least one point")
    if not (width > 0.0 and np.isfinite(width)):
        raise DescriptionError("outline of a rigid link", f"the width is {width}", "Give a positive width")
    angles = np.linspace(0.0, 2.0 * np.pi, 384, endpoint=False)  # of the polygon that stands for a disc
    circle = 0.5 * width * np.column_stack((np.cos(angles), np.sin(angles)))
    discs = (joints[:, None] + circle).reshape(-1, 2)
    return discs[ConvexHull(discs).vertices]


@dataclass(frozen=True, eq=False)
class PlanView:
    """The top of a solid mesh.

    Attributes:
        triangles: (k, 3) indices of the solid's vertices, counter-clockwise seen from +z.
        cells: (k,) the tetrahedron each triangle belongs to: ``values[cells]`` maps cell values to triangles.
    """

    triangles: NDArray[np.int64]
    cells: NDArray[np.int64]


def plan_view(points: ArrayLike, tets: ArrayLike) -> PlanView:
    """The boundary faces whose outer unit normal has z > 0.5.

    Take it from the undeformed mesh and use it with deformed points, so that all pictures show the same triangles.

    Args:
        points: (n, 3) vertices.
        tets: (m, 4) indices of vertices, in any orientation.

    Raises:
        DescriptionError: the arrays do not fit each other, or nothing faces +z.
    """
    vertices = real_array("points of a solid mesh", points, None, 3)
    cells = index_array("tetrahedra of a solid mesh", tets, None, 4, below=len(vertices))
    faces = cells[:, ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))].reshape(-1, 3)  # face i is opposite to vertex i
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    boundary = first[count == 1]
    faces, opposite, owner = faces[boundary], cells.reshape(-1)[boundary], boundary // 4

    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    inward = np.einsum("ij,ij->i", normal, a - vertices[opposite]) < 0.0
    normal[inward] *= -1.0
    faces = np.where(inward[:, None], faces[:, [0, 2, 1]], faces)
    top = normal[:, 2] > 0.5 * np.linalg.norm(normal, axis=1)
    if not top.any():
        raise DescriptionError(
            "plan view of a solid mesh", "no face has a normal towards +z", "Extrude planar links along z"
        )
    return PlanView(triangles=faces[top], cells=owner[top])


def path_of(loops: Iterable[Reals]) -> Path:
    """Closed loops (n, 2) as one path, which fills without the seams that single triangles leave."""
    return Path.make_compound_path(*(Path(np.vstack((loop, loop[:1])), closed=True) for loop in loops))
