"""Weights of the handles at the midpoints of edges, so that a design bends edges too.

The outline of a designed link is that of the drawn link under a smooth map. Moving vertices alone would leave chords,
with an error of second order in the element size whatever the order of the elements; the midpoint m of an edge of the
outline therefore moves like a vertex,

    d(m) = Σ_j w_j(m) T_j (m − X_j, 1),

w_j(m) interpolated along the outline: the cubic in the arc length through the two vertices on either side. It does not
reach across corners or into interfaces, whose vertices are held; there it is the quadratic through three. Edges around
interfaces move with them. All other edges stay as straight as the map of their ends makes them. An extruded link has
the weights of its plan.

Where handles slide, the map stretches one end of an edge more than the other and shifts its midpoint along the outline.
Such a shift does not change the shape of the outline, but turns cells inside out if it is a quarter of the edge:
``MidEdgeNodes`` take it back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fenicsmech.meshing import LinkMesh, boundary_loops, edge_rows, plan_of

_CORNER = 0.3  # rad between the tangents of two edges: less is the error of edges on a curve


@dataclass(frozen=True, eq=False)
class EdgeWeights:
    """The edges of a link that follow a design at their midpoints; the midpoints of others stay between their ends.

    Attributes:
        ends: vertices of each, the lower one first, in lexical order, (k, 2).
        middles: drawn midpoints in the plane, on the curve, (k, 2).
        weights: of each handle there, (k, handles).
    """

    ends: np.ndarray
    middles: np.ndarray
    weights: np.ndarray


def edge_weights(mesh: LinkMesh, weights: np.ndarray) -> EdgeWeights:
    """The weights at midpoints from those at the vertices of ``mesh``, (n, handles)."""
    pairs = list(combinations(range(mesh.dim + 1), 2))
    ends = np.unique(np.sort(mesh.cells[:, pairs].reshape(-1, 2), axis=1), axis=0)
    bulges = mesh.curved.of_cells(ends)[:, 0]
    middles, found = (mesh.points[ends].mean(axis=1) + bulges)[:, :2], weights[ends].mean(axis=1)
    follows = np.any(bulges != 0.0, axis=1)
    plan = plan_of(mesh)
    if plan.mesh.dim == 2:
        held = np.zeros(len(plan.mesh.points), dtype=bool)
        held[plan.mesh.cells[plan.mesh.interface >= 0]] = True
        # vertex of the link at the foot of each column, and the edge of the plan below each edge
        vertex = np.unique(plan.column, return_index=True)[1]
        columns = np.sort(plan.column[ends], axis=1)
        for loop in boundary_loops("link", plan.mesh):
            edges = np.sort(np.column_stack([loop, np.roll(loop, -1)]), axis=1)
            above = edge_rows(columns, edges)
            assert np.all(above >= 0), "every edge of the outline is below one of the link"
            outline = _Outline(plan.mesh.points[loop], middles[above], held[loop])
            below = edge_rows(edges, columns)
            found[below >= 0] = outline.at_middles(weights[vertex[loop]])[below[below >= 0]]
            follows |= below >= 0
    return EdgeWeights(ends[follows], middles[follows], found[follows])


class _Outline:
    """A closed line of edges, each from one of ``points`` over its middle to the next."""

    def __init__(self, points: np.ndarray, middles: np.ndarray, held: np.ndarray) -> None:
        after = np.roll(points, -1, axis=0)
        chords, bulges = after - points, middles - 0.5 * (points + after)
        first, second = (np.linalg.norm(half, axis=1) for half in (middles - points, after - middles))
        lengths = first + second
        self._share, self._lengths, self._count = first / lengths, lengths, len(points)
        into, out = np.roll(chords - 4.0 * bulges, 1, axis=0), chords + 4.0 * bulges
        turn = np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], np.sum(into * out, axis=1))
        self._breaks = held | (np.abs(turn) > _CORNER)
        self._rigid = held & np.roll(held, -1)

    def at_middles(self, values: np.ndarray) -> np.ndarray:
        """Values (n, …) of a smooth function at the points, interpolated at the middle of each edge, (n, …)."""
        found = 0.5 * (values + np.roll(values, -1, axis=0))
        for edge in np.flatnonzero(~self._rigid):
            indices, places = self._stencil(int(edge))
            found[edge] = _shares(places) @ values[indices]
        return found

    def _stencil(self, edge: int) -> tuple[np.ndarray, np.ndarray]:
        """Up to two vertices on either side of the middle of an edge, and their arc lengths from there."""
        found = [near for step in (-1, 1) for near in self._walk(edge, step)]
        indices, places = (np.array(part) for part in zip(*found, strict=True))
        return indices, places

    def _walk(self, edge: int, step: int) -> Iterator[tuple[int, float]]:
        """Vertices from the middle of an edge on, up to a corner or interface, and their arc lengths from there."""
        n, share = self._count, self._share[edge]
        vertex = (edge + (step > 0)) % n
        place = step * self._lengths[edge] * (1.0 - share if step > 0 else share)
        for _ in range(2):
            yield vertex, place
            if self._breaks[vertex]:
                return
            place += step * self._lengths[vertex if step > 0 else vertex - 1]
            vertex = (vertex + step) % n


class MidEdgeNodes:
    """The nodes in the middles of edges, which keep their drawn place along the chord.

    With the ends x_a and x_b of an edge, its middle x_m where the handles take it, and τ° of the drawn edge,

        x_m − (τ − τ°) e,     e = x_b − x_a,     w = x_m − ½ (x_a + x_b),     τ = w · e / |e|²,

    all in the plane: edges above each other stay so. Edges that move rigidly or have no bulge stay as they are.

    Args:
        ends: vertices at the ends of the edge of each local node, nodes at vertices have theirs twice, (nodes, 2).
        points: drawn positions of the nodes, (nodes, dim).
    """

    def __init__(self, ends: np.ndarray, points: np.ndarray) -> None:
        self._points = points[:, :2]
        at_vertex = np.flatnonzero(ends[:, 0] == ends[:, 1])
        node = np.zeros(ends.max(initial=-1) + 1, dtype=np.int64)
        node[ends[at_vertex, 0]] = at_vertex
        middles = np.flatnonzero(ends[:, 0] != ends[:, 1])
        a, b = node[ends[middles]].T
        level = np.any(points[a, :2] != points[b, :2], axis=1)  # not between two vertices of one column
        self._a, self._b, self._middles = a[level], b[level], middles[level]
        self._drawn = self._places(self._points)[2]

    def placed(self, field: np.ndarray) -> np.ndarray:
        """The design field (nodes, dim) with shifts along chords taken back."""
        chords, _, places = self._places(self._points + field[:, :2])
        found = field.copy()
        found[self._middles, :2] -= (places - self._drawn)[:, None] * chords
        return found

    def apply_transpose(self, field: np.ndarray, g: np.ndarray) -> np.ndarray:
        """The transpose of the derivative of ``placed`` at ``field``.

        Args:
            field: given to ``placed``, (nodes, dim).
            g: of the first nodes, those that this rank owns, (…, owned nodes, dim).

        Returns:
            This rank's part of the sum over all ranks, at all its nodes, (…, nodes, dim).
        """
        chords, bulges, places = self._places(self._points + field[:, :2])
        owned = g.shape[-2]
        found = np.zeros((*g.shape[:-2], *field.shape))
        found[..., :owned, :] = g
        mine = self._middles < owned
        e, w, tau = chords[mine], bulges[mine], places[mine, None]
        own = g[..., self._middles[mine], :2]
        # δ(x_m − (τ − τ°) e) · g,  with  |e|² δτ = e · δw + (w − 2 τ e) · δe
        along = np.sum(own * e, axis=-1, keepdims=True) / np.sum(e**2, axis=1, keepdims=True)
        by_chord = -along * (w - 2.0 * tau * e) - (tau - self._drawn[mine, None]) * own
        for nodes, part in (
            (self._middles[mine], -along * e),
            (self._a[mine], 0.5 * along * e - by_chord),
            (self._b[mine], 0.5 * along * e + by_chord),
        ):
            np.add.at(np.moveaxis(found, -2, 0)[..., :2], nodes, np.moveaxis(part, -2, 0))
        return found

    def _places(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """e and w (n, 2) and τ (n,) of the edges, from the positions of all nodes in the plane (nodes, 2)."""
        chords, bulges = x[self._b] - x[self._a], x[self._middles] - 0.5 * (x[self._a] + x[self._b])
        return chords, bulges, np.sum(bulges * chords, axis=1) / np.sum(chords**2, axis=1)


def _shares(places: np.ndarray) -> np.ndarray:
    """Shares of values at ``places`` (n,) in that at 0 (Lagrange's polynomials), (n,)."""
    others = [np.delete(places, k) for k in range(len(places))]
    return np.array([np.prod(rest / (rest - place)) for rest, place in zip(others, places, strict=True)])
