"""The edge of a strip: curves parallel to its centreline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from fenicsmech.errors import MeshingError
from fenicsmech.meshing.centreline import Centreline
from fenicsmech.meshing.planform import first_crossing

Side = list[np.ndarray]

_STRAIGHT = 1e-9  # curvature × length below which a centreline is straight
_ACCURACY = 1e-6  # of a side's spline, relative to the thickness
_MOST_POINTS = 128  # between two points of the centreline


def strip_sides(centreline: Centreline, thickness: float, breaks: Sequence[float] = ()) -> tuple[Side, Side]:
    """The right and the left side of a strip, c(s) ∓ n(s) thickness/2, both from its start to its end.

    Args:
        centreline: c.
        thickness: distance of the sides.
        breaks: parameters s at which the sides are divided.

    Returns:
        For each side its pieces, arrays (k, 2) of points: the ends of a straight line, or enough points for the
        interpolating cubic spline. Pieces share their end points.
    """
    ends = np.unique(np.clip([0.0, *breaks, centreline.end], 0.0, centreline.end))
    ends = ends[np.append(True, np.diff(ends) > 1e-6 * thickness)]
    spans = list(zip(ends[:-1], ends[1:], strict=True))
    piece = _straight_piece if _is_straight(centreline) else _curved_piece
    right, left = ([piece(centreline, offset * thickness, a, b) for a, b in spans] for offset in (-0.5, 0.5))
    return right, left


def check_sides(part: str, centreline: Centreline, thickness: float) -> None:
    """Refuse a strip whose sides are no proper outline.

    Raises:
        MeshingError: a side folds over where the centreline bends too sharply, or the outline crosses itself.
    """
    s = centreline.samples(32)
    bend = np.abs(centreline.curvature(s))
    sharpest = int(np.argmax(bend))
    if bend[sharpest] * 0.5 * thickness >= 1.0:
        raise MeshingError(
            part,
            f"the centreline bends with radius {1.0 / bend[sharpest]:g} near "
            f"{_shown(centreline.evaluate(s[sharpest]))}, which is not more than half the thickness {thickness:g}",
            "Make the strip thinner or its centreline smoother",
        )
    right, left = (_side(centreline, s, offset * thickness) for offset in (-0.5, 0.5))
    crossing = first_crossing(np.concatenate([right, left[::-1]]))
    if crossing is not None:
        raise MeshingError(
            part,
            f"the strip crosses itself near {_shown(crossing)}",
            "Lead the centreline apart there, or make the strip thinner",
        )


def _shown(point: np.ndarray) -> str:
    return f"({', '.join(f'{c:g}' for c in point)})"


def _is_straight(centreline: Centreline) -> bool:
    return bool(np.max(np.abs(centreline.curvature(centreline.samples(32)))) * centreline.end < _STRAIGHT)


def _side(centreline: Centreline, s: np.ndarray, offset: float) -> np.ndarray:
    return centreline.evaluate(s) + offset * centreline.normal(s)


def _straight_piece(centreline: Centreline, offset: float, start: float, end: float) -> np.ndarray:
    return _side(centreline, np.array([start, end]), offset)


def _curved_piece(centreline: Centreline, offset: float, start: float, end: float) -> np.ndarray:
    """Points of a side, as many as a cubic spline through them needs to follow it between them."""
    knots, margin = centreline.knots, 1e-6 * (end - start)
    inner = knots[(knots > start + margin) & (knots < end - margin)]
    stations = np.concatenate([[start], inner, [end]])
    parts = 8
    while True:
        finer = np.interp(
            np.arange(2 * parts * (len(stations) - 1) + 1) / (2 * parts), np.arange(len(stations)), stations
        )
        points = _side(centreline, finer, offset)
        error = np.linalg.norm(CubicSpline(finer[::2], points[::2])(finer[1::2]) - points[1::2], axis=1).max()
        if error <= _ACCURACY * 2.0 * abs(offset) or parts >= _MOST_POINTS:
            return points[::2]
        parts *= 2
