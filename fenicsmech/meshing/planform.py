"""Geometry of closed plane outlines."""

from __future__ import annotations

import numpy as np


def first_crossing(polygon: np.ndarray) -> np.ndarray | None:
    """A point where two edges of the closed ``polygon`` ((n, 2)) that are not neighbours meet, or None."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    between = polygon[None, :] - polygon[:, None]
    # p_i + t e_i = p_j + u e_j for all pairs at once; edges in line with each other do not cross
    sine, lengths = _cross(edge[:, None], edge[None, :]), np.linalg.norm(edge, axis=1)
    sine[np.abs(sine) <= 1e-10 * lengths[:, None] * lengths[None, :]] = np.nan
    t, u = _cross(between, edge[None, :]) / sine, _cross(between, edge[:, None]) / sine
    number = np.arange(len(polygon))
    apart = np.abs(number[:, None] - number[None, :])
    strangers = (apart > 1) & (apart < len(polygon) - 1)
    meetings = np.argwhere(strangers & (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0))
    if not len(meetings):
        return None
    i, j = meetings[0]
    return polygon[i] + t[i, j] * edge[i]


def inside(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Whether ``point`` (2,) lies in the closed ``polygon`` ((n, 2)): a ray from it crosses an odd number of edges."""
    a, b = polygon - point, np.roll(polygon, -1, axis=0) - point
    straddles = (a[:, 1] > 0.0) != (b[:, 1] > 0.0)
    a, b = a[straddles], b[straddles]
    reach = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(reach > 0.0) % 2)


def distance(polygon: np.ndarray, point: np.ndarray) -> float:
    """Distance of ``point`` (2,) from the edges of the closed ``polygon`` ((n, 2))."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    along = np.einsum("ij,ij->i", point - polygon, edge) / np.einsum("ij,ij->i", edge, edge)
    nearest = polygon + np.clip(along, 0.0, 1.0)[:, None] * edge
    return float(np.linalg.norm(point - nearest, axis=1).min())


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
