"""Where a polygon has true corners, and where it stands for a smooth curve."""

from __future__ import annotations

import math

import numpy as np

_SHARP = math.radians(60.0)  # a circle has eight vertices at least
_LEAST = math.radians(15.0)  # what a smooth curve may turn unexpectedly
_IRREGULAR = 0.5  # of the turns nearby: 1/4 where a curvature sets in, and up to 1/2 if the edges grow there


def corners_of(polygon: np.ndarray) -> np.ndarray:
    """Which vertices of a closed polygon are corners of the shape that it stands for.

    With edges l_i from vertex i to i + 1 the polygon turns by θ_i at vertex i, and per length by
    κ_i = 2 θ_i / (l_{i-1} + l_i). A smooth curve that bends on either side as it does at the next vertex there turns by
    (κ_{i-1} l_{i-1} + κ_{i+1} l_i) / 2; what is left of θ_i is the corner. The clearest corner is found first, and
    does not count as a bend of the curve for its neighbours any more.

    A single vertex between two corners that turn the other way is the middle of a small arc, not a tip.

    Args:
        polygon: vertices (n, 2).

    Returns:
        (n,) True at corners.
    """
    ahead = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
    behind, turn = np.roll(ahead, 1), _turns(polygon)
    bend, corner = 2.0 * turn / (behind + ahead), sharp_corners_of(polygon)
    while True:
        left, right = _bends_beside(bend, corner)
        unexpected = np.abs(turn - 0.5 * (left * behind + right * ahead))
        smooth = np.abs(np.where(corner, 0.0, bend))
        nearby = np.max([np.roll(smooth, k) for k in range(-2, 3)], axis=0)
        excess = unexpected / np.maximum(_LEAST, _IRREGULAR * 0.5 * nearby * (behind + ahead))
        excess[corner | _between(corner)] = 0.0
        clearest = int(np.argmax(excess))
        if excess[clearest] <= 1.0:
            break
        corner[clearest] = True
    dents = turn * np.roll(turn, 1) < 0.0, turn * np.roll(turn, -1) < 0.0
    return corner & ~(_between(corner) & np.all(dents, axis=0)) | sharp_corners_of(polygon)


def sharp_corners_of(polygon: np.ndarray) -> np.ndarray:
    """Which vertices of a closed polygon ((n, 2)) turn more than any curve of its resolution does: (n,)."""
    return np.abs(_turns(polygon)) > _SHARP


def _turns(polygon: np.ndarray) -> np.ndarray:
    """The angle (rad) by which a closed polygon turns left at each vertex."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    x, y = np.roll(ahead, 1, axis=0).T
    return np.arctan2(x * ahead[:, 1] - y * ahead[:, 0], x * ahead[:, 0] + y * ahead[:, 1])


def _between(corner: np.ndarray) -> np.ndarray:
    """Which vertices lie between two corners."""
    return np.roll(corner, 1) & np.roll(corner, -1)


def _bends_beside(bend: np.ndarray, corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bend at the vertices before and after each, from the other side where one of these is a corner."""
    before, after = np.roll(bend, 1), np.roll(bend, -1)
    corner_before, corner_after = np.roll(corner, 1), np.roll(corner, -1)
    return np.where(corner_before, after, before), np.where(corner_after, before, after)
