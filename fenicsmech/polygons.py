"""Closed polygons in the plane, (n, 2) without a repeated corner, the loops of edges that bound triangles, and lines
through points."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np


def signed_area(polygon: np.ndarray) -> float:
    """½ Σ (x_i y_{i+1} − x_{i+1} y_i), positive if ``polygon`` runs counter-clockwise."""
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def strip_width(polygon: np.ndarray) -> float:
    """2 A / P: the width of a long strip with the area A and the perimeter P of ``polygon``."""
    perimeter = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum()
    return 2.0 * abs(signed_area(polygon)) / float(perimeter)


def is_inside(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Whether ``point`` (2,) lies in ``polygon``."""
    return bool(are_inside(polygon, point[None])[0])


def are_inside(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Mask (n,) of the ``points`` (n, 2) in ``polygon``: a ray from them crosses an odd number of edges."""
    a, b = (corners - points[:, None] for corners in (polygon, np.roll(polygon, -1, axis=0)))
    straddles = (a[..., 1] > 0.0) != (b[..., 1] > 0.0)
    row, _ = np.nonzero(straddles)
    a, b = a[straddles], b[straddles]
    reach = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return np.bincount(row[reach > 0.0], minlength=len(points)) % 2 == 1


def distance_to(polygon: np.ndarray, point: np.ndarray) -> float:
    """Distance of ``point`` (2,) from the edges of ``polygon``."""
    return distance_to_edges(polygon, np.roll(polygon, -1, axis=0), point)


def distance_to_edges(starts: np.ndarray, ends: np.ndarray, point: np.ndarray) -> float:
    """Distance of ``point`` (2,) from the edges between ``starts`` and ``ends``, (n, 2) each; infinite from none."""
    edge = ends - starts
    squares = np.maximum(np.einsum("ij,ij->i", edge, edge), np.finfo(float).tiny)  # an edge may be a point
    along = np.einsum("ij,ij->i", point - starts, edge) / squares
    nearest = starts + np.clip(along, 0.0, 1.0)[:, None] * edge
    return float(np.linalg.norm(point - nearest, axis=1).min(initial=np.inf))


def first_crossing(polygon: np.ndarray) -> np.ndarray | None:
    """A point where two edges of ``polygon`` that are not neighbours meet, or None."""
    count, edge = len(polygon), np.roll(polygon, -1, axis=0) - polygon
    ends = np.stack([polygon, polygon + edge])
    # sweep along the longer side of the polygon: only edges that overlap there can meet
    sweep = ends[..., int(np.argmax(np.ptp(polygon, axis=0)))]
    order = np.argsort(sweep.min(axis=0))
    behind = np.searchsorted(sweep.min(axis=0)[order], sweep.max(axis=0)[order], side="right") - np.arange(count) - 1
    first = np.repeat(np.arange(count), behind)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(behind) - behind, behind)
    i, j = np.sort([order[first], order[second]], axis=0)
    apart = (j - i > 1) & (j - i < count - 1)
    i, j = i[apart], j[apart]
    # p_i + t e_i = p_j + u e_j; collinear edges do not cross
    between, sine, lengths = polygon[j] - polygon[i], _cross(edge[i], edge[j]), np.linalg.norm(edge, axis=1)
    sine[np.abs(sine) <= 1e-10 * lengths[i] * lengths[j]] = np.nan
    t, u = _cross(between, edge[j]) / sine, _cross(between, edge[i]) / sine
    meetings = np.flatnonzero((t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0))
    if not len(meetings):
        return None
    k = min(meetings, key=lambda k: (i[k], j[k]))
    return polygon[i[k]] + t[k] * edge[i[k]]


def divided_triangle(parts: int) -> tuple[np.ndarray, np.ndarray]:
    """A triangle with each side in ``parts``: barycentric coordinates in whole parts (p, 3), and the small triangles
    between these points, in its orientation, (parts², 3)."""
    places = np.array([(parts - i - j, i, j) for i in range(parts + 1) for j in range(parts + 1 - i)])
    number = {(int(i), int(j)): k for k, (_, i, j) in enumerate(places)}
    upright = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i in range(parts) for j in range(parts - i)]
    turned = [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i in range(parts) for j in range(parts - 1 - i)
    ]
    return places, np.array(upright + turned)


def edge_loops(triangles: np.ndarray) -> list[np.ndarray]:
    """The closed loops of edges that belong to one triangle only: outlines and holes alike; loops may touch.

    Each is the vertex numbers (k,) from its lowest one on, in the orientation of ``triangles`` (m, 3) where that is
    consistent; loops are in the order of these lowest numbers.
    """
    edges = triangles[:, ((0, 1), (1, 2), (2, 0))].reshape(-1, 2)
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    edges = edges[np.sort(first[count == 1])]
    edges_at = defaultdict(list)
    for index, ends in enumerate(edges.tolist()):
        for end in ends:
            edges_at[end].append(index)
    unused, loops = dict.fromkeys(range(len(edges))), []
    while unused:
        index = next(iter(unused))
        unused.pop(index)
        start, vertex = edges[index].tolist()
        loop = [start]
        while vertex != start:
            loop.append(vertex)
            index = next(k for k in edges_at[vertex] if k in unused)  # exists: every vertex has an even degree
            unused.pop(index)
            one, other = edges[index].tolist()
            vertex = other if one == vertex else one
        loops.append(np.roll(loop, -int(np.argmin(loop))))
    return sorted(loops, key=lambda loop: int(loop[0]))


def chord_lengths(points: np.ndarray) -> np.ndarray:
    """Length (n,) of the line through ``points`` (n, dim) up to each of them."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def divided(points: np.ndarray, spacing: float, *, least: int = 1) -> np.ndarray:
    """Points that divide the line through ``points`` (n, dim) evenly, at most ``spacing`` apart, in ``least`` parts."""
    arc = chord_lengths(points)
    at = np.linspace(0.0, arc[-1], max(least, math.ceil(arc[-1] / spacing)) + 1)
    return np.column_stack([np.interp(at, arc, coordinate) for coordinate in points.T])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
