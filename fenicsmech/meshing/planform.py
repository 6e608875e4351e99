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


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
