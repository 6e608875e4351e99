"""Work–precision plots: accuracy against time, and the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray

from fenicsmech.errors import DescriptionError, real_array, set_fields
from fenicsmech.plot import INK, PALETTE, Labels, Spot, house_style, new_figure, open_frame, save_png, text_size

_MARKERS = ("o", "s", "^", "D", "v", "P")
# of labels from their points: to the lower left first, where the front leaves nothing
_DIRECTIONS = [(-1, 0), (0, -1), (-1, -0.1), (-0.1, -1), (-1, -0.25), (1, 0), (0, 1), (0.1, 1), (1, 0.1), (1, 0.25)]
_SMALL = 8.0  # pt
_BAND = "#eeeeee"
_MUTED = "#777777"
_LOWEST = 0.2  # of the uncertainty: where smaller errors are drawn


@dataclass(frozen=True, eq=False)
class WorkSeries:
    """Points of one sequence of meshes.

    Args:
        model: by which it is coloured.
        variant: by which it is marked, among the sequences of a model.
        seconds: (n,) positive.
        errors: (n,) relative to the reference, not negative.
        names: (n,) of the points, for labels on the front.
        joined: draw a thin line through the points, in their order; else they are small and hollow.

    Raises:
        DescriptionError: the arrays differ in length, or a number has no logarithm.
    """

    model: str
    variant: str
    seconds: NDArray[np.float64]
    errors: NDArray[np.float64]
    names: Sequence[str]
    joined: bool = True

    def __post_init__(self) -> None:
        part = f"points of '{self.model} {self.variant}'"
        seconds = real_array(f"seconds of {part}", self.seconds, None)
        errors = real_array(f"errors of {part}", self.errors, len(seconds))
        if (seconds <= 0.0).any() or (errors < 0.0).any():
            raise DescriptionError(part, "seconds or errors have no logarithm", "Give positive ones")
        if len(self.names) != len(seconds):
            raise DescriptionError(part, f"{len(self.names)} names for {len(seconds)} points", "Give one per point")
        set_fields(self, seconds=seconds, errors=errors)


@dataclass(frozen=True)
class ModellingError:
    """An error that no refinement takes away: a dashed line in the colour of ``model``."""

    model: str
    error: float


def pareto_front(seconds: ArrayLike, errors: ArrayLike, *, least_gain: float = 0.05) -> list[int]:
    """Indices of the points that are worth their time, fastest first.

    Each is more accurate than every faster one, by a fraction of at least ``least_gain``: differences that are noise do
    not put a point on the front.

    Args:
        seconds, errors: (n,). Of equal points the first is on the front.
        least_gain: least decrease of the error, relative; 0 for the front in the strict sense.
    """
    seconds, errors = np.asarray(seconds, dtype=float), np.asarray(errors, dtype=float)
    front: list[int] = []
    for index in np.lexsort((errors, seconds)):
        if not front or errors[index] < (1.0 - least_gain) * errors[front[-1]]:
            front.append(int(index))
    return front


def plot_work_precision(
    path: str | Path,
    series: Sequence[WorkSeries],
    *,
    uncertainty: float = 0.0,
    modelling: Sequence[ModellingError] = (),
    xlabel: str = "time per frame [s]",
    ylabel: str = "relative error",
    title: str = "",
) -> None:
    """Draw error against time, both logarithmic: colours are models, markers variants of them.

    The Pareto front is a grey staircase, its points are labelled. Errors below ``uncertainty`` are all alike:
    that band is grey, and only the fastest point in it is on the front.

    Args:
        path: the PNG file.
        series: the points; models take their colours in the order of appearance.
        uncertainty: uncertainty of the reference, relative.
        modelling: errors that remain on any mesh.
        xlabel, ylabel: quantities and units.
        title: a line above the plot.

    Raises:
        DescriptionError: the name does not end in .png, or there are no points.
    """
    if not any(len(one.seconds) for one in series):
        raise DescriptionError(f"plot '{path}'", "it has no points", "Give at least one level with a value")
    colours = dict(zip(dict.fromkeys(one.model for one in series), PALETTE * len(series), strict=False))
    with house_style():
        figure = new_figure(8.0, 5.2)
        figure.set_layout_engine("constrained")
        axes = figure.add_subplot()
        axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
        axes.set_title(title, loc="left")
        axes.grid(True)
        open_frame(axes)
        _set_limits(axes, series, uncertainty)
        if uncertainty > 0.0:
            _draw_uncertainty(axes, uncertainty)
        markers = _draw_series(axes, series, colours)
        for level in modelling:
            axes.axhline(level.error, color=colours.get(level.model, INK), ls=(0, (5.0, 3.0)), lw=1.0, zorder=1.5)
        front = _draw_front(axes, series, uncertainty)
        _draw_legend(axes, series, colours, markers)
        figure.canvas.draw()  # fixes the positions labels are placed by
        figure.set_layout_engine("none")
        labels = Labels(axes, _obstacles(axes, series, uncertainty, front))
        if uncertainty > 0.0:
            _label_line(axes, labels, f"reference known to ±{100.0 * uncertainty:.2g} %", uncertainty, (-1.0,), _MUTED)
        for level in modelling:
            text = f"modelling error of {level.model}: {100.0 * level.error:.2g} %"
            _label_line(axes, labels, text, level.error, (1.0, -1.0), colours.get(level.model, INK))
        for x, y, name, model in front:
            spots = [Spot(np.array([x, y]), np.array(d) / np.hypot(*d)) for d in _DIRECTIONS]
            labels.add(name, spots, leader=True, color=colours[model], fontsize=8.5, fontweight="bold")
        save_png(figure, path)


def _shown(errors: NDArray[np.float64], uncertainty: float) -> NDArray[np.float64]:
    """Errors as drawn: those far below the uncertainty stand at the lower edge."""
    return np.maximum(errors, _LOWEST * uncertainty if uncertainty > 0.0 else np.finfo(float).tiny)


def _set_limits(axes: Axes, series: Sequence[WorkSeries], uncertainty: float) -> None:
    seconds = np.concatenate([one.seconds for one in series])
    errors = np.concatenate([_shown(one.errors, uncertainty) for one in series])
    lowest = min(errors.min(), 0.5 * uncertainty) if uncertainty > 0.0 else errors.min()
    axes.set_xlim(0.55 * seconds.min(), 2.2 * seconds.max())
    axes.set_ylim(0.65 * lowest, 2.0 * errors.max())
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    percent = FuncFormatter(lambda value, _: f"{100.0 * value:g} %")
    for axis, form in ((axes.xaxis, plain), (axes.yaxis, percent)):
        axis.set_major_locator(LogLocator(base=10.0))
        axis.set_major_formatter(form)
        axis.set_minor_formatter(NullFormatter())


def _draw_uncertainty(axes: Axes, uncertainty: float) -> None:
    axes.axhspan(axes.get_ylim()[0], uncertainty, color=_BAND, lw=0.0, zorder=0.2)


def _draw_series(axes: Axes, series: Sequence[WorkSeries], colours: dict[str, str]) -> dict[tuple[str, str], str]:
    """Draws the points; returns the marker of every (model, variant)."""
    markers: dict[tuple[str, str], str] = {}
    for one in series:
        taken = [variant for model, variant in markers if model == one.model]
        marker = markers.setdefault((one.model, one.variant), _MARKERS[len(taken) % len(_MARKERS)])
        colour, uncertainty = colours[one.model], axes.get_ylim()[0] / 0.65
        errors = np.maximum(one.errors, uncertainty)
        if one.joined:
            axes.plot(one.seconds, errors, "-", color=colour, lw=1.0, alpha=0.55, zorder=2)
            axes.plot(one.seconds, errors, marker, color=colour, ms=6.5, mec="white", mew=0.7, zorder=4)
        else:
            axes.plot(one.seconds, errors, marker, mfc="white", mec=colour, ms=4.0, mew=0.9, zorder=3)
    return markers


def _draw_front(axes: Axes, series: Sequence[WorkSeries], uncertainty: float) -> list[tuple[float, float, str, str]]:
    """Draws the staircase and rings; returns seconds, error, name and model of its points."""
    points = [
        (float(seconds), float(error), name, one.model)
        for one in series
        for seconds, error, name in zip(one.seconds, _shown(one.errors, uncertainty), one.names, strict=True)
    ]
    front = [points[k] for k in pareto_front([p[0] for p in points], [max(p[1], uncertainty) for p in points])]
    x, y = np.array([point[:2] for point in front]).T
    axes.step([*x, axes.get_xlim()[1]], [*y, y[-1]], where="post", color=INK, lw=1.6, alpha=0.45, zorder=2.5)
    axes.plot(x, y, "o", mfc="none", mec=INK, ms=11.0, mew=1.3, zorder=5)
    return front


def _obstacles(
    axes: Axes, series: Sequence[WorkSeries], uncertainty: float, front: Sequence[tuple[float, float, str, str]]
) -> list[NDArray[np.float64]]:
    """Shapes that labels should not hide: squares around the points, the sequences' lines and the staircase."""
    scale, corners = np.array([1.04, 1.06]), np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    lines = [np.column_stack([one.seconds, _shown(one.errors, uncertainty)]) for one in series]
    # nested, so that hiding a point costs more than crossing a line
    squares = [point * scale ** (k * corners) for line in lines for point in line for k in (0.25, 0.5, 0.75, 1.0)]
    x, y = np.array([point[:2] for point in front]).T
    stairs = np.column_stack([np.repeat([*x, axes.get_xlim()[1]], 2)[1:-1], np.repeat(y, 2)])
    joined = [line for one, line in zip(series, lines, strict=True) if one.joined and len(line) > 1]
    return squares + [np.vstack([line, line[::-1]]) for line in (*joined, stairs)]  # there and back: no area


def _label_line(axes: Axes, labels: Labels, text: str, error: float, sides: Sequence[float], colour: str) -> None:
    """Writes ``text`` along a level, above (1) or below (−1) it, at the left end if there is room."""
    low, high = axes.get_xlim()
    width, _ = text_size(text, fontsize=_SMALL)
    half = 0.5 * width / (axes.get_position().width * axes.figure.get_figwidth()) + 0.01
    places = [np.array([low * (high / low) ** part, error]) for part in (half, 1.0 - half, 0.5)]
    spots = [Spot(place, np.array([0.0, side])) for place in places for side in sides]
    labels.add(text, spots, color=colour, fontsize=_SMALL)


def _draw_legend(
    axes: Axes, series: Sequence[WorkSeries], colours: dict[str, str], markers: dict[tuple[str, str], str]
) -> None:
    handles = [
        Line2D([], [], color=colours[model], marker=marker, lw=1.0, ms=6.5, mec="white", label=f"{model} {variant}")
        for (model, variant), marker in markers.items()
    ]
    if not all(one.joined for one in series):
        label = "other quadrature, tolerance"
        handles.append(Line2D([], [], color=_MUTED, marker="o", mfc="white", ms=4.0, lw=0.0, label=label))
    handles.append(Line2D([], [], color=INK, alpha=0.6, lw=1.6, marker="o", mfc="none", ms=9.0, label="Pareto front"))
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
