"""The mesh of one link: plain arrays of points, cells and interface numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fenicsmech.meshing.curved_edges import CurvedEdges

FREE = -1


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A conforming simplex mesh of one link, in arrays that cannot be written into.

    Attributes:
        points: vertex coordinates, shape (n, dim), in the user's unit of length. Every vertex belongs to a cell.
        cells: vertex numbers, shape (m, dim + 1): triangles or tetrahedra of positive volume.
        interface: shape (m,): the index of the interface site that holds the cell, ``FREE`` (-1) if none does.
        curved: edges that follow a curve.
    """

    points: np.ndarray
    cells: np.ndarray
    interface: np.ndarray
    curved: CurvedEdges = field(default=None)

    def __post_init__(self) -> None:
        if self.curved is None:
            object.__setattr__(self, "curved", CurvedEdges.none(self.dim))
        for array in (self.points, self.cells, self.interface, self.curved.ends, self.curved.bulges):
            array.setflags(write=False)

    @property
    def dim(self) -> int:
        """Dimension of the space the link is meshed in."""
        return self.points.shape[1]

    @classmethod
    def from_cells(
        cls, points: np.ndarray, cells: np.ndarray, interface: np.ndarray, curved: CurvedEdges | None = None
    ) -> LinkMesh:
        """The mesh of ``cells``, turned to positive orientation, without the points that no cell uses.

        Args:
            points: (n, dim) coordinates; cells: (m, dim + 1) rows of ``points``; interface: (m,) site numbers;
                curved: edges between rows of ``points`` that bulge.
        """
        used, renumbered = np.unique(cells, return_inverse=True)
        if curved is not None:
            numbers = np.full(len(points), -1)
            numbers[used] = np.arange(len(used))
            curved = curved.renumbered(numbers)
        points = np.array(points[used], dtype=np.float64)
        cells = renumbered.reshape(cells.shape).astype(np.int64)
        turned = cell_measures(points, cells) < 0.0
        cells[turned, -2:] = cells[turned, :-3:-1]
        return cls(points, cells, np.array(interface, dtype=np.int32), curved and curved.limited(points, cells))

    def cells_of(self, site: int) -> np.ndarray:
        """The cells (k, dim + 1) that the interface ``site`` holds; ``FREE`` gives the flexible ones."""
        return self.cells[self.interface == site]


def cell_measures(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed areas or volumes det(x₁ − x₀, …, x_d − x₀) / d! of ``cells`` ((m, d + 1)), shape (m,)."""
    corners = points[cells]
    edges = corners[:, 1:] - corners[:, :1]
    return np.linalg.det(edges) / math.factorial(points.shape[1])
