"""Plots of load–displacement curves."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from fenicsmech.collective import on_one
from fenicsmech.errors import DescriptionError, counted, real_array, set_fields
from fenicsmech.plot.library import mpl
from fenicsmech.plot.page import INK, MUTED, PALETTE, house_style, new_figure, open_frame, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DASHES = (0, (3.0, 1.6))  # of unstable parts
_DOTS = (0, (1.0, 1.6))  # of snap-throughs
_MARKERS = ("s", "^", "X", "P", "v", "*")  # of the kinds of marks, in the order of their names


@dataclass(frozen=True)
class CurveMark:
    """A point of a curve with a marker; marks of one ``kind`` look alike."""

    displacement: float
    force: float
    kind: str


def _no_flags() -> NDArray[np.bool_]:
    return np.zeros(0, bool)


@dataclass(frozen=True, eq=False)
class CurveSeries:
    """One curve of a plot.

    Args:
        displacement: (n,) abscissae.
        force: (n,) ordinates.
        label: its name in the legend.
        stable: (n,) whether each equilibrium is stable; empty: all are.
        snapped_through: (n,) whether the mechanism snapped through on the way to each point; empty: nowhere.
        joined: draw the line through the points; False for measurements.
        colour: a matplotlib colour; None takes the next of the palette.
        faint: draw it thin and light behind the others, for a curve before a change.
        marks: points with a marker.
        corrected: (n, 2) displacement and force of each point in finer elements, as estimated; empty: not known.

    Raises:
        DescriptionError: the arrays differ in length or are not finite.
    """

    displacement: NDArray[np.float64]
    force: NDArray[np.float64]
    label: str = ""
    stable: NDArray[np.bool_] = field(default_factory=_no_flags)
    joined: bool = True
    colour: str | None = None
    faint: bool = False
    marks: tuple[CurveMark, ...] = ()
    snapped_through: NDArray[np.bool_] = field(default_factory=_no_flags)
    corrected: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        part = f"curve '{self.label}'"
        displacement = real_array(f"displacements of {part}", self.displacement, None)
        force = real_array(f"forces of {part}", self.force, len(displacement))
        count = len(force) if np.size(self.corrected) else 0
        corrected = real_array(f"corrected values of {part}", self.corrected, count, 2)
        set_fields(self, displacement=displacement, force=force, corrected=corrected)
        for name, what, absent in (("stable", "stability", True), ("snapped_through", "snaps", False)):
            given = np.array(getattr(self, name), dtype=bool)
            flags = given if given.size else np.full(len(force), absent)
            if flags.shape != force.shape:
                problem = f"{counted(flags.size, 'flag')} for {counted(force.size, 'point')}"
                raise DescriptionError(f"{what} of {part}", problem, "Give one flag per point")
            set_fields(self, **{name: flags})


@dataclass(frozen=True)
class CurveTarget:
    """A target point of a curve; ``colour`` None draws it in ink."""

    displacement: float
    force: float
    colour: str | None = None

    def __post_init__(self) -> None:
        real_array("displacement and force of a target", (self.displacement, self.force), 2)


def plot_curve(
    path: str | Path,
    series: Sequence[CurveSeries],
    *,
    targets: Sequence[CurveTarget] = (),
    xlabel: str = "displacement [mm]",
    ylabel: str = "force [N]",
    title: str = "",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> None:
    """Draws load–displacement curves, displacement across and force up, as a PNG.

    Stable parts are solid, unstable parts dashed, snap-throughs dotted arrows, points dots, targets open diamonds; bars
    lead from points to where finer elements put them. For curves before and after a change, give
    both the same colour and make the first faint; curves with the same label appear once in the legend, in grey if
    their colours differ.

    Args:
        path: the PNG file.
        series: the curves, drawn in this order, faint ones behind.
        targets: target points; equal ones are drawn around each other.
        xlabel, ylabel: quantity and unit of the axes.
        title: a line above the plot.
        comm: the processes that call it; one of them draws.

    Raises:
        DescriptionError: the name does not end in .png.
        OSError: the file cannot be written.
    """

    def draw() -> None:
        with house_style():
            figure = new_figure(6.4, 4.4)
            figure.set_layout_engine("constrained")
            axes = figure.add_subplot()
            colours = [curve.colour or PALETTE[index % len(PALETTE)] for index, curve in enumerate(series)]
            for curve, colour in zip(series, colours, strict=True):
                _draw_series(axes, curve, colour)
            _draw_targets(axes, targets)
            _draw_marks(axes, series)
            axes.margins(0.05)
            axes.axhline(0.0, color="#bbbbbb", lw=0.8, zorder=0.5)
            axes.axvline(0.0, color="#bbbbbb", lw=0.8, zorder=0.5)
            axes.grid(True)
            open_frame(axes)
            axes.set(xlabel=xlabel, ylabel=ylabel)
            axes.set_title(title, loc="left")
            _draw_legend(axes, series, colours, targets)
            save_png(figure, path)

    on_one(comm, draw)


def _line_style(colour: str, *, faint: bool) -> tuple[str, float, float]:
    """Colour and width of the line, and size of the dots on it."""
    if not faint:
        return colour, 2.0, 4.5
    return mpl.to_hex(1.0 - 0.45 * (1.0 - np.array(mpl.to_rgb(colour)))), 1.4, 3.2


def _draw_series(axes: Axes, curve: CurveSeries, colour: str) -> None:
    points, stable = np.column_stack((curve.displacement, curve.force)), curve.stable
    colour, width, size = _line_style(colour, faint=curve.faint)
    behind = 1.0 if curve.faint else 0.0
    if curve.joined:
        # a step is stable when both its ends are, and no equilibria lie along a snap-through
        solid, snaps = stable[:-1] & stable[1:], curve.snapped_through[1:]
        for part, style in ((solid & ~snaps, "-"), (~solid & ~snaps, _DASHES)):
            # breaking the line with NaN keeps one artist per style
            line = np.insert(points, np.flatnonzero(~part) + 1, np.nan, axis=0)
            axes.plot(*line.T, ls=style, color=colour, lw=width, zorder=3 - behind)
        for index in np.flatnonzero(snaps):
            start, end = points[index : index + 2]
            axes.plot(*points[index : index + 2].T, ls=_DOTS, color=colour, lw=0.7 * width, zorder=3 - behind)
            tip = {"arrowstyle": "-|>", "shrinkA": 0.0, "shrinkB": 3.0, "color": colour, "lw": 0.7 * width}
            axes.annotate("", xy=end, xytext=end - 0.1 * (end - start), arrowprops=tip, zorder=3 - behind)
    size = size if len(points) <= 40 else 0.55 * size
    for part, face in ((stable, colour), (~stable, "white")):
        axes.plot(*points[part].T, "o", ms=size, mfc=face, mec=colour, mew=1.0, zorder=4 - 1.5 * behind)
    if len(curve.corrected):
        moved = curve.corrected != points
        bars = np.stack([points, curve.corrected], axis=1)[moved.any(axis=1)]
        axes.add_collection(mpl.LineCollection(bars, colors=colour, lw=0.7 * width, zorder=4.5 - behind))
        look = {"ms": 1.6 * size, "mec": colour, "mew": 0.7 * width, "zorder": 4.5 - behind}
        axes.plot(*bars[:, 1].T, "|" if moved[:, 0].any() else "_", **look)


def _draw_targets(axes: Axes, targets: Sequence[CurveTarget]) -> None:
    places = [(target.displacement, target.force) for target in targets]
    for index, (target, place) in enumerate(zip(targets, places, strict=True)):
        size = 8.0 + 5.0 * places[:index].count(place)
        axes.plot(*place, "D", ms=size, mfc="none", mec=target.colour or INK, mew=1.5, clip_on=False, zorder=5)


def _markers(series: Sequence[CurveSeries]) -> dict[str, str]:
    """The marker of each kind of marks."""
    kinds = sorted({mark.kind for curve in series for mark in curve.marks})
    return dict(zip(kinds, _MARKERS * len(kinds), strict=False))


def _draw_marks(axes: Axes, series: Sequence[CurveSeries]) -> None:
    markers = _markers(series)
    for curve in series:
        for mark in curve.marks:
            place = mark.displacement, mark.force
            axes.plot(*place, markers[mark.kind], ms=8.0, mfc="white", mec=INK, mew=1.5, zorder=6)


def _draw_legend(
    axes: Axes, series: Sequence[CurveSeries], colours: Sequence[str], targets: Sequence[CurveTarget]
) -> None:
    handles = []
    for label in dict.fromkeys(curve.label for curve in series if curve.label):
        group = [(curve, colour) for curve, colour in zip(series, colours, strict=True) if curve.label == label]
        curve = group[0][0]
        colour, width, size = _line_style(_common([colour for _, colour in group]), faint=curve.faint)
        handles.append(mpl.Line2D([], [], color=colour, label=label, lw=width * curve.joined, marker="o", ms=size))
    unstable = [curve.joined and not curve.stable.all() for curve in series]
    snaps = [curve.joined and curve.snapped_through.any() for curve in series]
    corrected = [len(curve.corrected) > 0 for curve in series]
    for label, shown, look in (
        ("unstable", unstable, {"ls": _DASHES, "lw": 2.0, "marker": "o", "ms": 4.5, "mfc": "white"}),
        ("snap-through", snaps, {"ls": _DOTS, "lw": 1.4, "marker": ">", "markevery": (1, 1), "ms": 5}),
        ("in finer elements", corrected, {"lw": 1.4, "marker": "|", "markevery": (1, 1), "ms": 7}),
    ):
        if own := list(itertools.compress(colours, shown)):
            handles.append(mpl.Line2D([], [], color=_common(own), label=label, **look))
    for kind, marker in _markers(series).items():
        handles.append(mpl.Line2D([], [], lw=0, marker=marker, ms=8, mfc="white", mec=INK, mew=1.5, label=kind))
    if targets:
        colour = _common([target.colour or INK for target in targets])
        handles.append(mpl.Line2D([], [], lw=0, marker="D", ms=8, mfc="none", mec=colour, mew=1.5, label="target"))
    if handles:
        axes.legend(handles=handles, loc="best", framealpha=0.9, edgecolor="none", handlelength=2.8)


def _common(colours: Sequence[str]) -> str:
    """Their common colour, or grey."""
    return colours[0] if len(set(colours)) == 1 else MUTED
