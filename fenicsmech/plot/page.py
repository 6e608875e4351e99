"""The page a picture is drawn on: the look of the package, lengths, a row of panels, labels, and the PNG file.

Neither a display nor pyplot is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write
from fenicsmech.plot.library import mpl
from fenicsmech.polygons import divided

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as Outline
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

Reals = NDArray[np.float64]
Handle: TypeAlias = "Artist | tuple[Artist, ...]"

DPI = 150
INK, MUTED = "#333333", "#777777"
FLEXIBLE, FLEXIBLE_RIM = "#f39c3d", "#a85b0b"
PALETTE = ("#2166ac", "#d95f02", "#1b9e77", "#b2182b", "#7570b3", "#8c6d31")
HEADING: dict[str, Any] = {"fontsize": 11.5, "fontweight": "bold"}
TITLE: dict[str, Any] = {"fontsize": 10.5, "fontweight": "bold"}
NAME: dict[str, Any] = {"fontsize": 9.5, "fontweight": "bold"}
LEGEND: dict[str, Any] = {"fontsize": 9.0}
SMALL: dict[str, Any] = {"fontsize": 8.5}


@dataclass(frozen=True)
class Lengths:
    """Lengths of pictures of mechanisms and designs, in inches."""

    panel: tuple[float, float] = (5.6, 5.2)  # largest width and height of one panel; two fill the width of a page
    smallest: float = 1.3  # least width and height of a panel, so that ticks do not collide
    row: float = 13.0  # largest width of all panels beside each other
    left: float = 0.62  # room for the names and numbers of the axes
    bottom: float = 0.52
    right: float = 0.18  # margin
    top: float = 0.12
    line: float = 0.27  # height of a line of text
    padding: float = 0.12  # air around a mechanism
    gap: float = 0.16  # between panels with a common axis
    bar: float = 0.14  # width of a colour bar
    bar_room: float = 1.1  # width of a colour bar with its numbers and label
    key: float = 0.6  # line and gap of one entry of a legend
    longest_arrow: float = 0.17  # relative to the mechanism's diagonal
    # largest width and height of all links laid down, unless they would be smaller than in place
    details: tuple[float, float] = (5.6, 6.4)
    details_gap: float = 0.4  # between the mechanism and the links laid down, and between these
    details_padding: float = 0.4  # air around a mechanism whose links have names beside them
    zoom: float = 3.0  # largest scale of a link laid down, relative to that in place
    side: float = 0.12  # air beside a link laid down
    above: float = 0.2  # air above and below it, where its dimensions stand
    caption: float = 0.42  # height of the two lines above a link laid down
    rows: float = 0.12  # least air between rows of links
    scale_bar: float = 0.3  # height of its row
    pin: float = 0.075  # radius of a pin in pictures of designs
    tick: float = 0.04  # half the stroke at the end of a dimension


LENGTHS = Lengths()


def house_style() -> AbstractContextManager[None]:
    """A context in which figures have the look of the package."""
    look = {
        "text.color": INK, "text.usetex": False, "font.family": "sans-serif", "font.size": 9.5, "legend.fontsize": 9.0,
        "axes.titlesize": 10.5, "axes.titleweight": "bold", "axes.titlepad": 7.0, "axes.labelsize": 9.5,
        "axes.labelcolor": INK, "axes.edgecolor": MUTED, "axes.linewidth": 0.8, "axes.axisbelow": True,
        "axes.facecolor": "white", "figure.facecolor": "white", "grid.color": "#e4e4e4", "grid.linewidth": 0.7,
        "xtick.color": MUTED, "ytick.color": MUTED, "xtick.labelcolor": INK, "ytick.labelcolor": INK,
        "hatch.linewidth": 0.7,
    }  # fmt: skip
    return mpl.rc_context(look)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of ``width`` × ``height`` inches with its own Agg canvas."""
    figure = mpl.Figure(figsize=(width, height), dpi=DPI)
    mpl.FigureCanvasAgg(figure)
    return figure


@cache
def text_size(text: str, **style: Any) -> tuple[float, float]:
    """Width and height of ``text`` in inches, in the look of the figures."""
    with house_style():
        figure = new_figure(1.0, 1.0)
        extent = figure.text(0.0, 0.0, text, **style).get_window_extent(figure.canvas.get_renderer())
    return extent.width / DPI, extent.height / DPI


def legend_width(labels: Iterable[str]) -> float:
    """Inches of a legend in one line."""
    return sum(text_size(label, **LEGEND)[0] + LENGTHS.key for label in labels)


def halo() -> tuple[Any, ...]:
    """The rim of labels, which keeps them legible on what they cover."""
    return (mpl.withStroke(linewidth=2.5, foreground="white"),)


def open_frame(axes: Axes) -> None:
    """Keeps only the left and the bottom line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)


def draw_pin(axes: Axes, at: ArrayLike, radius: float, *, welded: bool = False) -> None:
    """Draws a joint at ``at`` (2,): a ring with a dot or, of a weld, a square; over all but arrows and labels."""
    side = 1.4 * radius
    if welded:
        axes.add_patch(mpl.Rectangle(np.subtract(at, 0.5 * side), side, side, fc=INK, ec="white", lw=1.0, zorder=6))
    else:
        axes.add_patch(mpl.Circle(at, radius, fc="white", ec=INK, lw=1.0, zorder=6))
        axes.add_patch(mpl.Circle(at, 0.35 * radius, fc=INK, ec="none", zorder=6))


def path_of(loops: Iterable[Reals]) -> Outline:
    """Closed loops (n, 2) as one path, which fills without the seams that single triangles leave."""
    return mpl.Path.make_compound_path(*(mpl.Path(np.vstack((loop, loop[:1])), closed=True) for loop in loops))


def normalised(vectors: Reals) -> Reals:
    """(…, 2) vectors of length one; zero stays zero, as where points coincide."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny)


def save_png(figure: Figure, path: str | Path) -> None:
    """Writes ``figure`` to ``path``, atomically and without a time stamp: equal figures give equal files."""
    if Path(path).suffix.lower() != ".png":
        raise DescriptionError(f"picture '{path}'", "only PNG files are written", "Give a name that ends in .png")
    with atomic_write(path, binary=True) as file:
        figure.canvas.print_png(file, metadata={"Software": None})


@dataclass(frozen=True, eq=False)
class Page:
    """A figure with a row of panels of equal height, a line for the heading above and one for the legend below."""

    figure: Figure
    row: tuple[Axes, ...]  # from left to right
    line: float  # height of a line of text, relative to the figure's

    @classmethod
    def of(cls, widths: Sequence[float], gaps: Sequence[float], tall: float, *, above: int, below: int, right: float):
        """Axes of ``widths`` × ``tall`` inches with ``gaps`` between them, and lines ``above`` and ``below``."""
        bottom, top = LENGTHS.bottom + LENGTHS.line * below, LENGTHS.top + LENGTHS.line * above
        width, height = LENGTHS.left + sum(widths) + sum(gaps) + right, bottom + tall + top
        figure, row, left = new_figure(width, height), [], LENGTHS.left
        for wide, gap in zip(widths, (*gaps, 0.0), strict=True):
            row.append(figure.add_axes((left / width, bottom / height, wide / width, tall / height)))
            left += wide + gap
        return cls(figure, tuple(row), LENGTHS.line / height)

    def write(self, title: str, handles: Mapping[str, Handle]) -> None:
        """The heading, and the legend: handles by their label."""
        if title:
            left = self.row[0].get_position().x0
            self.figure.text(left, 1.0 - 0.35 * self.line, title, va="top", **HEADING)
        if handles:
            place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.0), "ncol": len(handles)}
            self.figure.legend(list(handles.values()), list(handles), frameon=False, **place)


@dataclass(frozen=True)
class Placement:
    """Costs of places for labels; a point of distance from the anchor costs 1."""

    gaps: tuple[float, ...] = (3.0, 6.0, 10.0, 15.0, 21.0, 28.0)  # distances from the anchor that are tried, pt
    margin: float = 2.0  # air around a label, pt
    outside: float = 1e6  # of leaving the picture
    label: float = 1e5  # of each label that is hidden
    filled: float = 1e3  # of a centre inside a shape
    line: float = 1e2  # of each point of an outline that is hidden
    order: float = 0.5  # of the next spot in the list


_COSTS = Placement()


@dataclass(frozen=True, eq=False)
class Spot:
    """A place for a label: beside ``anchor`` (2,) in ``direction`` (2,), a unit vector or zero."""

    anchor: Reals
    direction: Reals


class Labels:
    """The labels of one picture, each placed by least cost after those before it.

    The limits and position of ``axes`` are final; ``shapes`` are (n, 2) closed polygons in data coordinates that labels
    should not hide.
    """

    def __init__(self, axes: Axes, shapes: Iterable[Reals]) -> None:
        self._axes, self._renderer = axes, axes.figure.canvas.get_renderer()
        self._point = axes.figure.dpi / 72.0  # pixels
        self._frame = axes.get_window_extent(self._renderer)
        self._shapes = [mpl.Path(axes.transData.transform(shape)) for shape in shapes]
        closed = [np.vstack((path.vertices, path.vertices[:1])) for path in self._shapes]
        dense = [divided(loop, 3.0 * self._point) for loop in closed]
        self._lines = np.concatenate(dense) if dense else np.empty((0, 2))
        self._taken: list[Bbox] = []

    def add(self, text: str, spots: Sequence[Spot], *, leader: bool = False, **style: Any) -> Text:
        """Puts ``text`` in ``style`` at the best of ``spots``, the earlier of equal ones.

        With ``leader``, a thin line connects the anchor with a label that is not right beside it.
        """
        label = self._axes.text(0.0, 0.0, text, ha="center", va="center", path_effects=halo(), zorder=9, **style)
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
        self._taken.append(mpl.Bbox([centre - half, centre + half]))
        back = self._axes.transData.inverted()
        label.set_position(back.transform(centre))
        if leader and gap > _COSTS.gaps[0]:
            start = self._axes.transData.transform(spot.anchor)
            end = back.transform(start + (gap - 1.0) * self._point * spot.direction)
            self._axes.plot(*np.array([spot.anchor, end]).T, color=label.get_color(), lw=0.7, zorder=8)
        return label

    def _cost(self, centre: Reals, half: Reals) -> float:
        air = half + _COSTS.margin * self._point
        low, high = centre - air, centre + air
        box = mpl.Bbox([low, high])
        cost = _COSTS.label * sum(box.overlaps(other) for other in self._taken)
        cost += _COSTS.filled * sum(bool(shape.contains_point(centre)) for shape in self._shapes)
        cost += _COSTS.line * float(((self._lines > low) & (self._lines < high)).all(axis=1).sum())
        leaves = (low < self._frame.min).any() or (high > self._frame.max).any()
        return cost + _COSTS.outside * bool(leaves)
