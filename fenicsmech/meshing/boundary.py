"""The boundary of a plane triangulation: closed polygons."""

from __future__ import annotations

import numpy as np

from fenicsmech.errors import MeshingError
from fenicsmech.meshing.link_mesh import LinkMesh, cell_measures


def boundary_loops(part: str, mesh: LinkMesh) -> tuple[np.ndarray, ...]:
    """The closed polygons that bound a link in the plane.

    Args:
        part: what the mesh belongs to, for messages.
        mesh: triangles.

    Returns:
        Vertex numbers (k,) of each polygon, the first not repeated at the end: the outline, counter-clockwise, then
        the holes, clockwise, so that the link lies to the left of every edge.

    Raises:
        MeshingError: a triangle is turned over, the link falls apart or touches itself in a point.
    """
    measures = cell_measures(mesh.points, mesh.cells)
    if np.any(measures <= 0.0):
        raise _turned_over(part, mesh, int(np.argmin(measures)), np.count_nonzero(measures <= 0.0))
    # with all triangles counter-clockwise every edge inside is run through once in each direction
    edges = mesh.cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    count = len(mesh.points)
    forth, back = edges @ (count, 1), edges[:, ::-1] @ (count, 1)
    _, first, repeats = np.unique(forth, return_index=True, return_counts=True)
    if np.any(repeats > 1):
        raise _turned_over(part, mesh, int(first[np.argmax(repeats)]) // 3, np.count_nonzero(repeats > 1))
    starts, ends = edges[~np.isin(forth, back)].T
    following = np.full(count, -1)
    following[starts] = ends
    if len(np.unique(starts)) < len(starts):
        vertices, visits = np.unique(starts, return_counts=True)
        raise MeshingError(
            part,
            f"the link touches itself in the single point {_shown(mesh.points[vertices[np.argmax(visits)]])}",
            "Give its shape some width there",
        )
    loops = sorted(_follow(following), key=lambda loop: -_area(mesh.points[loop]))
    outlines = sum(_area(mesh.points[loop]) > 0.0 for loop in loops)
    if outlines > 1:
        raise MeshingError(
            part, f"the link falls into {outlines} separate pieces", "Describe each piece as a link of its own"
        )
    return tuple(loops)


def _follow(following: np.ndarray) -> list[np.ndarray]:
    """The cycles of the map from each vertex to the next; -1 marks vertices in none."""
    loops, seen = [], following < 0
    for start in range(len(following)):
        loop, vertex = [], start
        while not seen[vertex]:
            seen[vertex] = True
            loop.append(vertex)
            vertex = following[vertex]
        if loop:
            loops.append(np.array(loop))
    return loops


def _area(polygon: np.ndarray) -> float:
    """Signed area of a closed ``polygon`` ((n, 2)), positive if it runs counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def _turned_over(part: str, mesh: LinkMesh, cell: int, count: int) -> MeshingError:
    return MeshingError(
        part,
        f"{count} of its {len(mesh.cells)} triangles are turned over or lie on others, one of them near "
        f"{_shown(mesh.points[mesh.cells[cell]].mean(axis=0))}",
        "Choose a design that deforms the mesh less",
    )


def _shown(point: np.ndarray) -> str:
    return f"({', '.join(f'{c:g}' for c in point)})"
