"""Edges of a mesh that follow the curved outline of a link between their ends.

With barycentric coordinates λ a cell covers the points X₀ + c,

    X₀ = Σ λ_i x_i,     c = Σ 4 λ_i λ_j w_ij,

w_ij the bulge of the edge between corners i and j: what takes the middle of its chord onto the curve. Without it a
polygon stands for the outline, an error that shrinks with the square of the element size whatever the order of the
elements. Source: Ciarlet & Raviart, Interpolation theory over curved elements (doi:10.1016/0045-7825(72)90018-0).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

_STRAIGHT = 1e-6  # bulge over chord length below which an edge is straight
_LEAST_VOLUME = 0.3  # of that of the straight cell, where the map squeezes it most
_HALVINGS = 6  # of bulges that squeeze a cell too much, before they are given up


@dataclass(frozen=True, eq=False)
class CurvedEdges:
    """The curved edges of a mesh; all others are straight.

    Attributes:
        ends: vertex numbers of each, the lower one first, (k, 2).
        bulges: w, (k, dim).
    """

    ends: np.ndarray
    bulges: np.ndarray

    @classmethod
    def none(cls, dim: int) -> CurvedEdges:
        """No curved edge."""
        return cls(np.zeros((0, 2), np.int64), np.zeros((0, dim)))

    @classmethod
    def through(cls, points: np.ndarray, ends: np.ndarray, middles: np.ndarray) -> CurvedEdges:
        """The edges whose ``middles`` (m, dim) lie off the chords between their ``ends`` (m, 2) in ``points``.

        Edges may be given once for every cell they belong to.
        """
        ends, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
        a, b = points[ends[:, 0]], points[ends[:, 1]]
        bulges = middles[first] - 0.5 * (a + b)
        curved = np.linalg.norm(bulges, axis=1) > _STRAIGHT * np.linalg.norm(b - a, axis=1)
        return cls(ends[curved], bulges[curved])

    def renumbered(self, numbers: np.ndarray) -> CurvedEdges:
        """The same edges when vertex i is called ``numbers[i]``; those with an end called −1 are left out."""
        ends = numbers[self.ends]
        kept = (ends >= 0).all(axis=1)
        return CurvedEdges(np.sort(ends[kept], axis=1), self.bulges[kept])

    def times(self, factor: float) -> CurvedEdges:
        """The edges of the mesh whose lengths are all ``factor`` times these."""
        return CurvedEdges(self.ends, factor * self.bulges)

    def of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Bulges of the edges of ``cells`` (m, n), pairs of corners in lexical order, (m, n (n − 1) / 2, dim)."""
        pairs = np.sort(cells[:, list(combinations(range(cells.shape[1]), 2))], axis=2)
        found = np.zeros((*pairs.shape[:2], self.bulges.shape[1]))
        if len(self.ends):
            count = int(max(cells.max(initial=0), self.ends.max())) + 1
            keys, wanted = self.ends @ (count, 1), pairs @ (count, 1)
            order = np.argsort(keys)
            place = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
            hit = keys[place] == wanted
            found[hit] = self.bulges[place[hit]]
        return found

    def limited(self, points: np.ndarray, cells: np.ndarray) -> CurvedEdges:
        """Edges that squeeze a cell too much bulge less, or not at all."""
        edges = self
        for _ in range(_HALVINGS):
            crowded = edges._squeezed(points, cells)
            if not crowded.any():
                return edges
            edges = edges._scaled(cells[crowded], 0.5)
        return edges._scaled(cells[edges._squeezed(points, cells)], 0.0)

    def _squeezed(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Which cells the map compresses below the least volume at a corner or the middle of an edge, (m,)."""
        dim = points.shape[1]
        bulges, corners = self.of_cells(cells), points[cells]
        bent = np.flatnonzero(np.any(bulges != 0.0, axis=(1, 2)))
        # ∇λ_1 … ∇λ_dim are the rows of the inverse of the edges from corner 0, (cells, corners, dim)
        inverse = np.linalg.inv((corners[bent, 1:] - corners[bent, :1]).transpose(0, 2, 1))
        slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        pairs = list(combinations(range(dim + 1), 2))
        places = np.vstack([np.eye(dim + 1), [(np.eye(dim + 1)[i] + np.eye(dim + 1)[j]) / 2 for i, j in pairs]])
        squeezed = np.zeros(len(cells), dtype=bool)
        for place in places:
            gradient = np.tile(np.eye(dim), (len(bent), 1, 1))
            for number, (i, j) in enumerate(pairs):
                slope = 4.0 * (place[i] * slopes[:, j] + place[j] * slopes[:, i])
                gradient += bulges[bent, number, :, None] * slope[:, None, :]
            squeezed[bent] |= np.linalg.det(gradient) < _LEAST_VOLUME
        return squeezed

    def _scaled(self, cells: np.ndarray, factor: float) -> CurvedEdges:
        """The bulges of the edges of ``cells`` times ``factor``."""
        count = int(max(cells.max(initial=0), self.ends.max(initial=0))) + 1
        pairs = np.sort(cells[:, list(combinations(range(cells.shape[1]), 2))], axis=2).reshape(-1, 2)
        touched = np.isin(self.ends @ (count, 1), pairs @ (count, 1))
        return CurvedEdges(self.ends, np.where(touched[:, None], factor, 1.0) * self.bulges)
