"""The look all figures share, and the way a figure becomes a PNG file (no display, no pyplot state)."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import ArrayLike

from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write

DPI = 150
INK = "#333333"
FLEXIBLE, FLEXIBLE_RIM = "#f39c3d", "#a85b0b"
PALETTE = ("#2166ac", "#d95f02", "#1b9e77", "#b2182b", "#7570b3", "#8c6d31")

_STYLE = {
    "font.family": "sans-serif",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlepad": 7.0,
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#777777",
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.facecolor": "white",
    "figure.facecolor": "white",
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "xtick.color": "#777777",
    "ytick.color": "#777777",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "legend.fontsize": 9.0,
    "hatch.linewidth": 0.7,
    "text.usetex": False,
}


def house_style() -> AbstractContextManager[None]:
    """Everything drawn inside this context has the look of the package's figures."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of ``width`` × ``height`` inches with its own Agg canvas."""
    figure = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def open_frame(axes: Axes) -> None:
    """Keep only the left and the bottom line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)


def draw_pin(axes: Axes, at: ArrayLike, radius: float) -> None:
    """Draw a revolute joint at ``at`` (2,): a ring with a dot, over everything but arrows and labels."""
    axes.add_patch(Circle(at, radius, fc="white", ec=INK, lw=1.0, zorder=6))
    axes.add_patch(Circle(at, 0.35 * radius, fc=INK, ec="none", zorder=6))


def save_png(figure: Figure, path: str | Path) -> None:
    """Write ``figure`` to ``path``, atomically and without a time stamp: equal figures give equal files.

    Raises:
        DescriptionError: the name does not end in .png.
    """
    if Path(path).suffix.lower() != ".png":
        raise DescriptionError(f"picture '{path}'", "only PNG files are drawn", "Let the name end in .png")
    with atomic_write(path, binary=True) as file:
        figure.canvas.print_png(file, metadata={"Software": None})
