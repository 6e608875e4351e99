"""The plan of an extruded link: the triangulation that its layers of tetrahedra repeat.

Fields that are the same all through the depth are fields on the plan. On tetrahedra whose vertices stand on the three
corners of a triangle such a field has exactly no gradient along z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenicsmech.meshing.link_mesh import LinkMesh

_SAME = 1e-8  # of the link's extent: vertices this close in the plan stand on one column


@dataclass(frozen=True, eq=False)
class Plan:
    """What remains of a link when fields do not change through its depth.

    Attributes:
        mesh: triangles; the link's own mesh if it is not extruded along z.
        column: vertex of ``mesh`` that stands for each vertex of the link, (n,).
    """

    mesh: LinkMesh
    column: np.ndarray


def plan_of(link: LinkMesh) -> Plan:
    """The plan of a link."""
    if link.dim == 3:
        flat = link.points[:, :2]
        pairs = cKDTree(flat).query_pairs(_SAME * np.ptp(flat, axis=0).max(), output_type="ndarray")
        graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(flat),) * 2)
        count, column = connected_components(graph, directed=False)
        corners = np.sort(column[link.cells], axis=1)
        first = np.diff(corners, axis=1, prepend=-1) > 0
        if np.all(first.sum(axis=1) == 3):
            triangles, below = np.unique(corners[first].reshape(-1, 3), axis=0, return_index=True)
            points = np.empty((count, 2))
            points[column] = flat
            return Plan(LinkMesh.from_cells(points, triangles, link.interface[below]), column)
    return Plan(link, np.arange(len(link.points)))
