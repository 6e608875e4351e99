"""Plots of stress along the edge of a link, beside the link with the edge."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenicsmech.plot.library import mpl
from fenicsmech.plot.page import (
    FLEXIBLE,
    FLEXIBLE_RIM,
    INK,
    MUTED,
    PALETTE,
    house_style,
    new_figure,
    open_frame,
    path_of,
    save_png,
)
from fenicsmech.plot.shapes import Reals

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class EdgeSeries:
    """Stress along an edge; NaN is not drawn.

    Args:
        arc_length: (n,) abscissae.
        along: (n,) stress along the edge.
        error: (n,) estimated, of ``along``.
        von_mises: (n,) von Mises stress.
        singular: (n,) whether stress has no limit there.
        points: (n, 2) of the edge.
        outline: closed polygons of the link, (k, 2) each.
    """

    arc_length: Reals
    along: Reals
    error: Reals
    von_mises: Reals
    singular: Reals
    points: Reals
    outline: tuple[Reals, ...]


def plot_edge(path: str | Path, edge: EdgeSeries, *, title: str = "", labels: tuple[str, str] = ("", "")) -> None:
    """Draws stress over arc length as a PNG, with its largest modulus, and the link with the edge and its start.

    Within reach of singular places lines are dotted and do not decide the limits; bands show estimated errors.

    Args:
        path: the PNG file.
        edge: the stress.
        title: a line above the plot.
        labels: quantity and unit of both axes.
    """
    with house_style():
        figure = new_figure(8.6, 4.0)
        figure.set_layout_engine("constrained")
        axes, plan = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
        peak = _draw_stress(axes, edge)
        axes.set(xlabel=labels[0], ylabel=labels[1])
        axes.set_title(title, loc="left")
        plan.add_patch(mpl.PathPatch(path_of(edge.outline), fc=FLEXIBLE, ec=FLEXIBLE_RIM, lw=0.6, alpha=0.5, zorder=2))
        plan.plot(*edge.points.T, color=PALETTE[0], lw=2.0, clip_on=False, zorder=3)
        plan.plot(*edge.points[0], "o", ms=6.0, mfc=PALETTE[0], mec="white", clip_on=False, zorder=4)
        half = len(edge.points) // 2
        tip = {"arrowstyle": "-|>", "color": PALETTE[0], "shrinkA": 0, "shrinkB": 0, "mutation_scale": 16.0}
        plan.annotate("", xy=edge.points[half], xytext=edge.points[max(half - 1, 0)], arrowprops=tip, zorder=4)
        if peak is not None:
            plan.plot(*edge.points[peak], "o", ms=7.0, mfc="white", mec=INK, mew=1.4, clip_on=False, zorder=5)
        plan.set_aspect("equal")
        plan.margins(0.08)
        plan.axis("off")
        save_png(figure, path)


def _draw_stress(axes: Axes, edge: EdgeSeries) -> int | None:
    """Draws the stress; returns the point of its largest modulus, None if there is none."""
    kept = np.isfinite(edge.along) & ~np.asarray(edge.singular, dtype=bool)
    for values, colour, width, label in (
        (edge.von_mises, MUTED, 1.2, "von Mises"),
        (edge.along, PALETTE[0], 1.8, "along the edge"),
    ):
        axes.plot(edge.arc_length, np.where(kept, values, np.nan), color=colour, lw=width, label=label, zorder=3)
    peak = int(np.argmax(np.where(kept, np.abs(edge.along), -1.0))) if kept.any() else None
    low, high = edge.along - edge.error, edge.along + edge.error
    axes.fill_between(edge.arc_length, low, high, where=kept, color=PALETTE[0], alpha=0.25, lw=0.0, zorder=2)
    if peak is not None:
        at = edge.arc_length[peak], edge.along[peak]
        axes.plot(*at, "o", ms=7.0, mfc="white", mec=INK, mew=1.4, zorder=5)
        axes.annotate(
            f"{at[1]:.3g}", at, xytext=(8, 0), textcoords="offset points", va="center", fontsize=8.5, zorder=6
        )
    axes.margins(0.05)
    axes.relim()
    axes.autoscale_view()
    limits = axes.get_xlim(), axes.get_ylim()
    if not kept.all():
        axes.plot(edge.arc_length, edge.along, ":", color=PALETTE[0], lw=1.0, label="singular places", zorder=1)
    axes.set(xlim=limits[0], ylim=limits[1])
    axes.axhline(0.0, color="#bbbbbb", lw=0.8, zorder=0.5)
    axes.grid(True)
    open_frame(axes)
    axes.legend(loc="best", framealpha=0.9, edgecolor="none")
    return peak
