"""The common look of all pictures, the lengths of their layouts, and PNG files, without a display or pyplot."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import ArrayLike

from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write

DPI = 150
INK, MUTED = "#333333", "#777777"
FLEXIBLE, FLEXIBLE_RIM = "#f39c3d", "#a85b0b"
PALETTE = ("#2166ac", "#d95f02", "#1b9e77", "#b2182b", "#7570b3", "#8c6d31")
HALO = (patheffects.withStroke(linewidth=2.5, foreground="white"),)
HEADING: dict[str, Any] = {"fontsize": 11.5, "fontweight": "bold"}
TITLE: dict[str, Any] = {"fontsize": 10.5, "fontweight": "bold"}
NAME: dict[str, Any] = {"fontsize": 9.5, "fontweight": "bold"}
LEGEND: dict[str, Any] = {"fontsize": 9.0}
SMALL: dict[str, Any] = {"fontsize": 8.5}


@dataclass(frozen=True)
class Lengths:
    """Lengths of pictures of mechanisms and designs, in inches.

    Attributes:
        panel: largest width and height of one panel; two of them fill the width of a page.
        smallest: least width and height of a panel, so that ticks do not collide.
        row: largest width of all panels beside each other.
        left, bottom: room for the names and numbers of the axes.
        right, top: margins.
        line: height of a line of text.
        padding: air around a mechanism.
        gap: between panels with a common axis.
        bar, bar_room: width of a colour bar, without and with its numbers and label.
        key: line and gap of one entry of a legend.
        longest_arrow: length of the longest arrow, relative to the mechanism's diagonal.
        details: largest width and height of all links laid down, unless they would be smaller than in place.
        details_gap: between the mechanism and the links laid down, and between these.
        details_padding: air around a mechanism whose links have names beside them.
        zoom: largest scale of a link laid down, relative to that in place.
        side, above: air beside a link laid down, and above and below it, where its dimensions stand.
        caption: height of the two lines above a link laid down.
        rows: least air between rows of links.
        scale_bar: height of the row of the scale bar.
        pin: radius of a pin in pictures of designs.
        tick: half the stroke at the end of a dimension.
    """

    panel: tuple[float, float] = (5.6, 5.2)
    smallest: float = 1.3
    row: float = 13.0
    left: float = 0.62
    bottom: float = 0.52
    right: float = 0.18
    top: float = 0.12
    line: float = 0.27
    padding: float = 0.12
    gap: float = 0.16
    bar: float = 0.14
    bar_room: float = 1.1
    key: float = 0.6
    longest_arrow: float = 0.17
    details: tuple[float, float] = (5.6, 6.4)
    details_gap: float = 0.4
    details_padding: float = 0.4
    zoom: float = 3.0
    side: float = 0.12
    above: float = 0.2
    caption: float = 0.42
    rows: float = 0.12
    scale_bar: float = 0.3
    pin: float = 0.075
    tick: float = 0.04


LENGTHS = Lengths()


def house_style() -> AbstractContextManager[None]:
    """A context in which figures have the look of the package."""
    return matplotlib.rc_context(
        {
            "font.family": "sans-serif",
            "font.size": 9.5,
            "axes.titlesize": 10.5,
            "axes.titleweight": "bold",
            "axes.titlepad": 7.0,
            "axes.labelsize": 9.5,
            "axes.labelcolor": INK,
            "axes.edgecolor": MUTED,
            "axes.linewidth": 0.8,
            "axes.axisbelow": True,
            "axes.facecolor": "white",
            "figure.facecolor": "white",
            "grid.color": "#e4e4e4",
            "grid.linewidth": 0.7,
            "xtick.color": MUTED,
            "ytick.color": MUTED,
            "xtick.labelcolor": INK,
            "ytick.labelcolor": INK,
            "text.color": INK,
            "legend.fontsize": 9.0,
            "hatch.linewidth": 0.7,
            "text.usetex": False,
        }
    )


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of ``width`` × ``height`` inches with its own Agg canvas."""
    figure = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def text_size(text: str, **style: Any) -> tuple[float, float]:
    """Width and height of ``text`` in inches, in the look of the figures."""
    return _text_size(text, tuple(style.items()))


@cache
def _text_size(text: str, style: tuple[tuple[str, Any], ...]) -> tuple[float, float]:
    with house_style():
        figure = new_figure(1.0, 1.0)
        extent = figure.text(0.0, 0.0, text, **dict(style)).get_window_extent(figure.canvas.get_renderer())
    return extent.width / DPI, extent.height / DPI


def open_frame(axes: Axes) -> None:
    """Keeps only the left and the bottom line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)


def draw_pin(axes: Axes, at: ArrayLike, radius: float, *, welded: bool = False) -> None:
    """Draws a joint at ``at`` (2,): a ring with a dot or, of a weld, a square; over all but arrows and labels."""
    if welded:
        side = 1.4 * radius
        axes.add_patch(Rectangle(np.subtract(at, 0.5 * side), side, side, fc=INK, ec="white", lw=1.0, zorder=6))
        return
    axes.add_patch(Circle(at, radius, fc="white", ec=INK, lw=1.0, zorder=6))
    axes.add_patch(Circle(at, 0.35 * radius, fc=INK, ec="none", zorder=6))


def save_png(figure: Figure, path: str | Path) -> None:
    """Writes ``figure`` to ``path``, atomically and without a time stamp: equal figures give equal files.

    Raises:
        DescriptionError: the name does not end in .png.
    """
    if Path(path).suffix.lower() != ".png":
        raise DescriptionError(f"picture '{path}'", "only PNG files are written", "Give a name that ends in .png")
    with atomic_write(path, binary=True) as file:
        figure.canvas.print_png(file, metadata={"Software": None})
