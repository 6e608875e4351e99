"""How large the picture of a design is: the mechanism in place, and every link laid down beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fenicsmech.report.canvas import new_figure
from fenicsmech.report.design_shapes import DesignShape

Reals = NDArray[np.float64]

_LARGEST = 5.6, 5.2  # in, of the mechanism
_SMALLEST = 1.3  # in, of the mechanism
_DETAILS = 5.6, 6.4  # in, of all links laid down, unless they would be smaller than in place
_ZOOM = 3.0  # most a link laid down is larger than in place
_PADDING = 0.4  # in, around the mechanism: room for names
_LEFT, _RIGHT, _BOTTOM, _TOP, _GAP = 0.62, 0.18, 0.52, 0.12, 0.4  # in
_LINE = 0.27  # in, height of a line of text
_SIDE, _ROOM, _BETWEEN = 0.12, 0.2, 0.4  # in, beside, above and below (for dimensions), and between links laid down
_CAPTION = 0.42  # in, height of the two lines above a link laid down
_AIR = 0.12  # in, least between rows
_SCALE_BAR = 0.3  # in, height of its row
_READING = np.array([1.0, 0.5])  # what points this way before points right when laid down


@dataclass(frozen=True, eq=False)
class View:
    """A rigid motion in the plane: x ↦ R x + shift."""

    turn: Reals
    shift: Reals

    def __call__(self, points: Reals) -> Reals:
        return points @ self.turn.T + self.shift


IN_PLACE = View(np.eye(2), np.zeros(2))


@dataclass(frozen=True, eq=False)
class DesignFrame:
    """An empty figure whose axes have equal scales in x and y.

    Attributes:
        figure: what to draw on.
        place: axes of the mechanism.
        place_scale: its inches per unit of length.
        details: axes of the links laid down, in the same unit; None for a single link.
        details_scale: its inches per unit of length.
        views: how each link gets there.
        captions: (2,) upper left corner of each caption in ``details``.
        line: height of a line of text, as a share of the figure.
    """

    figure: Figure
    place: Axes
    place_scale: float
    details: Axes | None
    details_scale: float
    views: tuple[View, ...]
    captions: tuple[Reals, ...]
    line: float


def lay_out_designs(
    designs: Sequence[DesignShape], *, captions: Sequence[float], heading: float, legend: float, subtitle: float
) -> DesignFrame:
    """A figure in which all ``designs`` fit.

    Args:
        designs: at least one.
        captions: width of each link's caption, in inches.
        heading: width of the line above all, in inches, or 0.
        legend: width of the line below all, in inches.
        subtitle: width of the line above the mechanism, in inches, or 0.
    """
    corners = np.concatenate([_corners(design) for design in designs])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = _scale(high - low, _LARGEST)
    rows, beside = None, 0.0
    if len(designs) > 1:
        rows = _Rows(designs, captions, scale)
        beside = rows.width + _GAP
        # as tall as the rows if that is wide enough, but not larger than them
        scale = max(scale, min(_scale(high - low, (_LARGEST[0], max(_LARGEST[1], rows.height))), rows.scale))
    wide, tall = scale * (high - low) + 2.0 * _PADDING
    wide = max(wide, _SMALLEST, subtitle, max(heading, legend) - beside)
    tall = max(tall, _SMALLEST, rows.height if rows else 0.0)
    centre, size = 0.5 * (low + high), np.array([wide, tall]) / scale

    bottom, top = _BOTTOM + _LINE, _TOP + _LINE * (bool(heading) + bool(subtitle))
    width, height = _LEFT + wide + beside + _RIGHT, bottom + tall + top
    figure = new_figure(width, height)
    place = figure.add_axes((_LEFT / width, bottom / height, wide / width, tall / height))
    place.set(xlim=centre[0] + (-0.5, 0.5) * size[:1], ylim=centre[1] + (-0.5, 0.5) * size[1:])
    place.tick_params(length=3.0)
    if rows is None:
        return DesignFrame(figure, place, scale, None, scale, (), (), _LINE / height)
    left = (_LEFT + wide + _GAP) / width
    details = figure.add_axes((left, bottom / height, rows.width / width, tall / height))
    details.set(xlim=(0.0, rows.width / rows.scale), ylim=(0.0, tall / rows.scale))
    details.set_axis_off()
    views, corners = rows.spread(tall)
    return DesignFrame(figure, place, scale, details, rows.scale, views, corners, _LINE / height)


class _Rows:
    """Links laid down in rows, all at the same scale, as large as the room allows.

    Attributes:
        scale: inches per unit of length.
        width, height: in inches, of all rows and the scale bar below them.
    """

    def __init__(self, designs: Sequence[DesignShape], captions: Sequence[float], place_scale: float) -> None:
        self._turns = [_lay_down(design) for design in designs]
        turned = [_corners(design) @ turn.T for design, turn in zip(designs, self._turns, strict=True)]
        self._centres = [0.5 * (points.min(axis=0) + points.max(axis=0)) for points in turned]
        self._sizes = np.array([np.ptp(points, axis=0) for points in turned])
        self._captions = captions
        self.scale = min((_DETAILS[0] - 2.0 * _SIDE) / self._sizes[:, 0].max(), _ZOOM * place_scale)
        self._fill()
        while self.height > _DETAILS[1] and self.scale > place_scale:
            self.scale = max(0.95 * self.scale, place_scale)
            self._fill()

    def _fill(self) -> None:
        drawn = self.scale * self._sizes
        self._widths = np.maximum(drawn[:, 0] + 2.0 * _SIDE, self._captions)
        self._heights = _CAPTION + drawn[:, 1] + 2.0 * _ROOM
        self._rows: list[list[int]] = []
        room: list[float] = []  # left in each row
        for link, width in enumerate(self._widths):
            row = next((k for k, left in enumerate(room) if width <= left), len(room))
            if row == len(room):
                self._rows.append([])
                room.append(_DETAILS[0])
            self._rows[row].append(link)
            room[row] -= width + _BETWEEN
        self.width = max(self._widths[row].sum() + _BETWEEN * (len(row) - 1) for row in self._rows)
        self.height = sum(self._heights[row].max() + _AIR for row in self._rows) + _SCALE_BAR

    def spread(self, tall: float) -> tuple[tuple[View, ...], tuple[Reals, ...]]:
        """Views and upper left corners of captions of all links, with the rows spread over ``tall`` inches."""
        views, corners = {}, {}
        top, air = tall, _AIR + (tall - self.height) / len(self._rows)
        for row in self._rows:
            left = 0.0
            for link in row:
                wide, deep = self.scale * self._sizes[link]
                middle = np.array([left + _SIDE + 0.5 * wide, top - _CAPTION - _ROOM - 0.5 * deep])
                views[link] = View(self._turns[link], middle / self.scale - self._centres[link])
                corners[link] = np.array([left, top]) / self.scale
                left += self._widths[link] + _BETWEEN
            top -= self._heights[row].max() + air
        links = range(len(views))
        return tuple(views[link] for link in links), tuple(corners[link] for link in links)


def _scale(size: Reals, largest: tuple[float, float]) -> float:
    """Inches per unit at which ``size`` (2,) with its padding fills a panel of ``largest`` inches."""
    return float(np.min((np.array(largest) - 2.0 * _PADDING) / np.maximum(size, 1e-6 * size.max())))


def _corners(design: DesignShape) -> Reals:
    return np.concatenate((*design.before.loops, *design.after.loops, design.joints))


def _lay_down(design: DesignShape) -> Reals:
    """(2, 2) the rotation that turns a link's longest direction to x, by less than a quarter turn or little more."""
    rim = design.before.loops[0]
    _, axes = np.linalg.eigh(np.cov(rim.T))
    x, y = axes[:, 1] if axes[:, 1] @ _READING >= 0.0 else -axes[:, 1]
    return np.array([[x, y], [-y, x]])
