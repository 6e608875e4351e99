"""Extrusion of a plane triangulation into layers of tetrahedra."""

from __future__ import annotations

import numpy as np

from fenicsmech.meshing.curved_edges import CurvedEdges
from fenicsmech.meshing.link_mesh import LinkMesh


def layer_count(depth: float, size: float) -> int:
    """Number of layers through ``depth`` if none is asked for: about twice as high as the triangles are wide."""
    return max(1, round(depth / (2.0 * size)))


def extrude(plan: LinkMesh, depth: float, layers: int) -> LinkMesh:
    """The tetrahedra over ``plan`` between z = −depth/2 and z = depth/2, in ``layers`` equal layers.

    A prism over the triangle a < b < c (numbers of its vertices in ``plan``), with a′, b′, c′ above them, is cut
    into abcc′, abb′c′ and aa′b′c′. The diagonal of a side then joins the lower number below with the higher above,
    whichever of the two neighbours looks at it. Layers above the middle are mirror images of those below, so with an
    even number of layers the mesh is symmetric about z = 0, and plane loads cause no motion out of the plane.

    Args:
        plan: the triangulation; its ``interface`` numbers pass on to the cells above.
        depth: extent along z.
        layers: number of layers, at least 1.
    """
    return _stack(plan, np.linspace(-0.5 * depth, 0.5 * depth, layers + 1), mirrored_from=(layers + 1) // 2)


def extrude_half(plan: LinkMesh, depth: float, layers: int) -> LinkMesh:
    """The upper half, z ≥ 0, of what ``extrude`` makes of twice as many ``layers``."""
    return _stack(plan, np.linspace(0.0, 0.5 * depth, layers + 1), mirrored_from=0)


def _stack(plan: LinkMesh, heights: np.ndarray, *, mirrored_from: int) -> LinkMesh:
    """Layers of tetrahedra between ``heights``; those from number ``mirrored_from`` on are cut upside down."""
    count, layers = len(plan.points), len(heights) - 1
    points = np.column_stack([np.tile(plan.points, (layers + 1, 1)), np.repeat(heights, count)])
    a, b, c = np.sort(plan.cells, axis=1).T
    sides = [(layer, layer + 1) if layer < mirrored_from else (layer + 1, layer) for layer in range(layers)]
    cells = []
    for near, far in sides:
        below, above = near * count, far * count
        cells += [
            np.column_stack([a + below, b + below, c + below, c + above]),
            np.column_stack([a + below, b + below, b + above, c + above]),
            np.column_stack([a + below, a + above, b + above, c + above]),
        ]
    return LinkMesh.from_cells(
        points, np.concatenate(cells), np.tile(plan.interface, 3 * layers), _walls(plan.curved, sides, count)
    )


def _walls(plan: CurvedEdges, sides: list[tuple[int, int]], count: int) -> CurvedEdges:
    """Curved edges of an extruded mesh: copies at every height, and the diagonals of the walls between them."""
    lower, upper = plan.ends.T
    ends = [plan.ends + height * count for height in range(len(sides) + 1)]
    ends += [np.column_stack([lower + near * count, upper + far * count]) for near, far in sides]
    bulges = np.column_stack([plan.bulges, np.zeros(len(plan.ends))])
    return CurvedEdges(np.sort(np.concatenate(ends), axis=1), np.tile(bulges, (len(ends), 1)))
