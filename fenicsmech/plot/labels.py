"""Labels of parts of a picture, placed by least cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fenicsmech.plot.style import HALO


@dataclass(frozen=True)
class Placement:
    """Costs of places for labels; a point of distance from the anchor costs 1.

    Attributes:
        gaps: distances from the anchor that are tried, pt.
        margin: air around a label, pt.
        outside: of leaving the picture.
        label: of each label that is hidden.
        filled: of a centre inside a shape.
        line: of each point of an outline that is hidden.
        order: of the next spot in the list.
    """

    gaps: tuple[float, ...] = (3.0, 6.0, 10.0, 15.0, 21.0, 28.0)
    margin: float = 2.0
    outside: float = 1e6
    label: float = 1e5
    filled: float = 1e3
    line: float = 1e2
    order: float = 0.5


_COSTS = Placement()


@dataclass(frozen=True, eq=False)
class Spot:
    """A place for a label: beside ``anchor`` (2,) in ``direction`` (2,), a unit vector or zero."""

    anchor: NDArray[np.float64]
    direction: NDArray[np.float64]


class Labels:
    """The labels of one picture, placed one after the other.

    Args:
        axes: final limits and position.
        shapes: (n, 2) closed polygons that labels should not hide, in data coordinates.
    """

    def __init__(self, axes: Axes, shapes: Iterable[NDArray[np.float64]]) -> None:
        self._axes, self._renderer = axes, axes.figure.canvas.get_renderer()
        self._point = axes.figure.dpi / 72.0  # pixels
        self._frame = axes.get_window_extent(self._renderer)
        self._shapes = [Path(axes.transData.transform(shape)) for shape in shapes]
        dense = [_dense(path.vertices, 3.0 * self._point) for path in self._shapes]
        self._lines = np.concatenate(dense) if dense else np.empty((0, 2))
        self._taken: list[Bbox] = []

    def add(self, text: str, spots: Sequence[Spot], *, leader: bool = False, **style: Any) -> Text:
        """Puts ``text`` at the best of ``spots``, the earlier of equal ones.

        Args:
            text: the label.
            spots: places tried.
            leader: whether a thin line connects the anchor with a label that is not right beside it.
            style: of the text.
        """
        label = self._axes.text(0.0, 0.0, text, ha="center", va="center", path_effects=HALO, zorder=9, **style)
        extent = label.get_window_extent(self._renderer)
        half = 0.5 * np.array([extent.width, extent.height])
        best = np.inf, np.zeros(2), spots[0], 0.0
        for order, spot in enumerate(spots):
            anchor = self._axes.transData.transform(spot.anchor)
            reach = float(np.min(half / np.maximum(np.abs(spot.direction), 1e-9)))  # from its centre to its edge
            for gap in _COSTS.gaps:
                centre = anchor + (reach + gap * self._point) * spot.direction
                cost = self._cost(centre, half) + gap + _COSTS.order * order
                if cost < best[0]:
                    best = cost, centre, spot, gap
        _, centre, spot, gap = best
        self._taken.append(Bbox([centre - half, centre + half]))
        back = self._axes.transData.inverted()
        label.set_position(back.transform(centre))
        if leader and gap > _COSTS.gaps[0]:
            start = self._axes.transData.transform(spot.anchor)
            end = back.transform(start + (gap - 1.0) * self._point * spot.direction)
            self._axes.plot(*np.array([spot.anchor, end]).T, color=label.get_color(), lw=0.7, zorder=8)
        return label

    def _cost(self, centre: NDArray[np.float64], half: NDArray[np.float64]) -> float:
        air = half + _COSTS.margin * self._point
        low, high = centre - air, centre + air
        box = Bbox([low, high])
        cost = 0.0
        if (low < self._frame.min).any() or (high > self._frame.max).any():
            cost += _COSTS.outside
        cost += _COSTS.label * sum(box.overlaps(other) for other in self._taken)
        cost += _COSTS.filled * sum(bool(shape.contains_point(centre)) for shape in self._shapes)
        return cost + _COSTS.line * float(((self._lines > low) & (self._lines < high)).all(axis=1).sum())


def _dense(loop: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points on the polygon ``loop`` (n, 2), at most ``step`` apart."""
    closed = np.vstack((loop, loop[:1]))
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))))
    at = np.linspace(0.0, arc[-1], max(2, int(np.ceil(arc[-1] / step)) + 1))
    return np.column_stack([np.interp(at, arc, closed[:, k]) for k in range(2)])
