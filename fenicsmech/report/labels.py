"""Labels beside what they name: put where they hide least."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fenicsmech.report.canvas import DPI, house_style, new_figure

_HALO = (patheffects.withStroke(linewidth=2.5, foreground="white"),)
_GAPS = (3.0, 6.0, 10.0, 15.0, 21.0, 28.0)  # pt, between anchor and label
_MARGIN = 2.0  # pt, of air around a label
_OUTSIDE, _LABEL, _FILLED, _LINE = 1e6, 1e5, 1e3, 1e2  # costs; a point of distance costs 1
_ORDER = 0.5  # cost of the next spot


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

    def add(self, text: str, spots: Sequence[Spot], *, leader: bool = False, **style: object) -> Text:
        """Put ``text`` at the best of ``spots``, the earlier of equal ones.

        Args:
            text: the label.
            spots: where it may go.
            leader: whether a thin line leads from the anchor to a label that is not right beside it.
            style: of the text.
        """
        label = self._axes.text(0.0, 0.0, text, ha="center", va="center", path_effects=_HALO, zorder=9, **style)
        extent = label.get_window_extent(self._renderer)
        half = 0.5 * np.array([extent.width, extent.height])
        best = np.inf, np.zeros(2), spots[0], 0.0
        for order, spot in enumerate(spots):
            anchor = self._axes.transData.transform(spot.anchor)
            reach = float(np.min(half / np.maximum(np.abs(spot.direction), 1e-9)))  # from its centre to its edge
            for gap in _GAPS:
                centre = anchor + (reach + gap * self._point) * spot.direction
                cost = self._cost(centre, half) + gap + _ORDER * order
                if cost < best[0]:
                    best = cost, centre, spot, gap
        _, centre, spot, gap = best
        self._taken.append(Bbox([centre - half, centre + half]))
        back = self._axes.transData.inverted()
        label.set_position(back.transform(centre))
        if leader and gap > _GAPS[0]:
            start = self._axes.transData.transform(spot.anchor)
            end = back.transform(start + (gap - 1.0) * self._point * spot.direction)
            self._axes.plot(*np.array([spot.anchor, end]).T, color=label.get_color(), lw=0.7, zorder=8)
        return label

    def _cost(self, centre: NDArray[np.float64], half: NDArray[np.float64]) -> float:
        air = half + _MARGIN * self._point
        low, high = centre - air, centre + air
        box = Bbox([low, high])
        cost = 0.0
        if (low < self._frame.min).any() or (high > self._frame.max).any():
            cost += _OUTSIDE
        cost += _LABEL * sum(box.overlaps(other) for other in self._taken)
        cost += _FILLED * sum(bool(shape.contains_point(centre)) for shape in self._shapes)
        return cost + _LINE * float(((self._lines > low) & (self._lines < high)).all(axis=1).sum())


def text_size(text: str, **style: object) -> tuple[float, float]:
    """Width and height of ``text`` in inches, in the look of the figures."""
    with house_style():
        figure = new_figure(1.0, 1.0)
        extent = figure.text(0.0, 0.0, text, **style).get_window_extent(figure.canvas.get_renderer())
    return extent.width / DPI, extent.height / DPI


def _dense(loop: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points on the polygon ``loop`` (n, 2), at most ``step`` apart."""
    closed = np.vstack((loop, loop[:1]))
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))))
    at = np.linspace(0.0, arc[-1], max(2, int(np.ceil(arc[-1] / step)) + 1))
    return np.column_stack([np.interp(at, arc, closed[:, k]) for k in range(2)])
