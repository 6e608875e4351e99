"""Pictures of mechanisms side by side: links, their deformation, forces and paths of points.

All panels have the same limits, the same scale in x and y, and the same scale of forces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.plot.library import mpl
from fenicsmech.plot.page import (
    FLEXIBLE,
    FLEXIBLE_RIM,
    HEADING,
    INK,
    LENGTHS,
    NAME,
    PALETTE,
    SMALL,
    TITLE,
    Labels,
    Page,
    Spot,
    draw_pin,
    halo,
    house_style,
    legend_width,
    normalised,
    path_of,
    save_png,
    text_size,
)
from fenicsmech.plot.shapes import Arrow, FlexibleShape, MechanismShape, Panel, PeakMark, Reals, RigidShape
from fenicsmech.polygons import edge_loops

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.path import Path as Outline

_RIGID, _RIGID_RIM = "#c9ccd1", "#6b7078"
_FIXED, _FIXED_RIM, _FIXED_HATCH = "#565b63", "#2e3238", "#7d838d"
_PALE = "#c4c4c4"
_FORCE = "#1d4f9c"
_TRACES = (PALETTE[2], PALETTE[4], PALETTE[5])
_HEAT = ("#fff3d6", "#fdd28a", "#f6983f", "#d9542b", "#a01c3b", "#5c0b3e")


def draw_configurations(
    path: str | Path, panels: Sequence[Panel], *, title: str = "", colour_label: str = "", unit: str = "mm"
) -> None:
    """Draws mechanisms side by side, with the same limits, scale of forces and colours.

    The undeformed state is a pale outline under the deformed one. Flexible links are orange or coloured by their
    values, rigid links grey, fixed ones dark and hatched; the largest force has the longest arrow.

    Colours span from zero, or the least value, to the largest of the panels' peaks, which are marked, or else to the
    99th percentile. A pointed end of the bar shows that larger values exist: near singular places, of which few would
    leave the rest without contrast.

    Args:
        path: the PNG file.
        panels: from left to right.
        title: a line above all.
        colour_label: quantity and unit of the values ("von Mises stress [MPa]").
        unit: of lengths, for the axes.
    """
    if not any(s.flexible or s.rigid or s.pins for panel in panels for s in (panel.undeformed, *panel.deformed)):
        raise DescriptionError(f"picture '{path}'", "there is nothing to draw", "Give at least one shape")
    coloured = [shape.values for panel in panels for shape in _filled(panel).flexible if shape.values is not None]
    values = np.concatenate(coloured) if coloured else None
    peaks = [panel.peak.value for panel in panels if panel.peak is not None]
    norm = None if values is None else _normalise(values, max(peaks, default=float(np.percentile(values, 99.0))))
    with house_style():
        legend = _legend(panels)
        layout = lay_out(panels, colour_bar=norm is not None, heading=title, legend=tuple(legend))
        for axes, panel in zip(layout.axes, panels, strict=True):
            _draw_panel(axes, panel, layout, norm)
            axes.set_xlabel(f"x [{unit}]")
        layout.axes[0].set_ylabel(f"y [{unit}]")
        if values is not None:
            _draw_colour_bar(layout, norm, values, colour_label)
        layout.page.write(title, {label: mpl.Line2D([], [], color=c, lw=1.4) for label, c in legend.items()})
        save_png(layout.page.figure, path)


def _filled(panel: Panel) -> MechanismShape:
    return panel.deformed[-1] if panel.deformed else panel.undeformed


def _normalise(values: Reals, most: float) -> Normalize:
    low = min(0.0, float(values.min()))
    return mpl.Normalize(low, next(high for high in (most, float(values.max()), low + 1.0) if high > low))


def _draw_panel(axes: Axes, panel: Panel, layout: Layout, norm: Normalize | None) -> None:
    axes.set_title(panel.title, loc="left")
    if panel.deformed:
        still = panel.undeformed
        for outline in (*(path_of([rigid.outline]) for rigid in still.rigid), *map(_rim, still.flexible)):
            axes.add_patch(mpl.PathPatch(outline, fc="none", ec=_PALE, lw=1.0, zorder=2))
    for state in panel.deformed[:-1]:
        for rigid in state.rigid:
            axes.add_patch(mpl.Polygon(rigid.outline, closed=True, fc=_RIGID, ec="none", alpha=0.35, zorder=2.5))
        for flexible in state.flexible:
            axes.add_patch(mpl.PathPatch(_rim(flexible), fc=FLEXIBLE, ec="none", alpha=0.25, zorder=2.6))
    state = _filled(panel)
    for rigid in sorted(state.rigid, key=lambda shape: not shape.fixed):
        _draw_rigid(axes, rigid)
    for flexible in state.flexible:
        _draw_flexible(axes, flexible, norm)
    for pin in state.pins:
        draw_pin(axes, pin.at, 0.014 * layout.size, welded=pin.welded)
    for trace, colour in zip(panel.traces, _TRACES * len(panel.traces), strict=False):
        axes.plot(*trace.points.T, color=colour, lw=1.4, zorder=5)
        axes.plot(*trace.marks.T, "o", ms=4.5, mfc=colour, mec="white", mew=0.8, zorder=7)
    for arrow in panel.arrows:
        _draw_arrow(axes, arrow, layout.arrow_scale)
    if panel.peak is not None:
        _draw_peak(axes, panel.peak, state)
    axes.grid(True, color="#ededed")  # last: coloured meshes switch it off


def _rim(shape: FlexibleShape) -> Outline:
    """The rim of a flexible link as one path."""
    corners = shape.points[shape.triangles]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    turned = np.where((ax * by < ay * bx)[:, None], shape.triangles[:, [0, 2, 1]], shape.triangles)
    return path_of(shape.points[loop] for loop in edge_loops(turned))


def _draw_rigid(axes: Axes, shape: RigidShape) -> None:
    face, edge = _RIGID, _RIGID_RIM
    if shape.fixed:
        axes.add_patch(
            mpl.Polygon(shape.outline, closed=True, fc=_FIXED, ec=_FIXED_HATCH, hatch="////", lw=0.0, zorder=3)
        )
        face, edge = "none", _FIXED_RIM
    axes.add_patch(mpl.Polygon(shape.outline, closed=True, fc=face, ec=edge, lw=1.0, zorder=3))


def _draw_flexible(axes: Axes, shape: FlexibleShape, norm: Normalize | None) -> None:
    face = FLEXIBLE
    if shape.values is not None:
        face, corners = "none", shape.points[shape.triangles]
        look = {"cmap": _colours(), "norm": norm, "zorder": 4}
        # each triangle with corners of its own, where values jump between cells
        apart = mpl.Triangulation(*corners.reshape(-1, 2).T, np.arange(corners.size // 2).reshape(-1, 3))
        axes.add_collection(mpl.TriMesh(apart, array=shape.values.ravel(), **look), autolim=False)
    axes.add_patch(mpl.PathPatch(_rim(shape), fc=face, ec=FLEXIBLE_RIM, lw=0.9, joinstyle="round", zorder=4))


def _draw_arrow(axes: Axes, arrow: Arrow, scale: float) -> None:
    if not arrow.vector.any():
        return
    tail, side = arrow.at - scale * arrow.vector, -normalised(arrow.vector)
    look = {"lw": 2.2, "color": _FORCE, "shrinkA": 0, "shrinkB": 0, "joinstyle": "miter", "zorder": 8}
    style = "-|>,head_length=0.5,head_width=0.26"
    axes.add_patch(mpl.FancyArrowPatch(tail, arrow.at, arrowstyle=style, mutation_scale=15, **look))
    if arrow.label:
        axes.annotate(
            arrow.label, tail, xytext=5.0 * side, textcoords="offset points", color=_FORCE, fontweight="bold",
            ha="right" if side[0] < -0.5 else "left" if side[0] > 0.5 else "center",
            va="top" if side[1] < -0.5 else "bottom" if side[1] > 0.5 else "center",
            path_effects=halo(), zorder=9,
        )  # fmt: skip


def _draw_peak(axes: Axes, peak: PeakMark, state: MechanismShape) -> None:
    """A ring at the peak, and its label beside it, off the links where there is room."""
    axes.plot(*peak.at, "o", ms=7.0, mfc="none", mec="white", mew=3.0, zorder=9)
    axes.plot(*peak.at, "o", ms=7.0, mfc="none", mec=INK, mew=1.4, zorder=9)
    outlines = [rigid.outline for rigid in state.rigid]
    outlines += [polygon for flexible in state.flexible for polygon in _rim(flexible).to_polygons()]
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    spots = [Spot(peak.at, np.array([np.cos(angle), np.sin(angle)])) for angle in angles]
    Labels(axes, outlines).add(peak.label, spots, leader=True, **SMALL)


def _colours() -> Any:
    """The colours of stresses."""
    return mpl.LinearSegmentedColormap.from_list("stress", _HEAT)


def _draw_colour_bar(layout: Layout, norm: Normalize, values: np.ndarray, label: str) -> None:
    over, under = values.max() > norm.vmax, values.min() < norm.vmin
    extend = "both" if over and under else "max" if over else "min" if under else "neither"
    bar = layout.page.figure.colorbar(
        mpl.ScalarMappable(norm, _colours()), cax=layout.bar, extend=extend, extendfrac=0.04
    )
    bar.locator, bar.formatter = mpl.MaxNLocator(5), mpl.FuncFormatter(lambda value, _: f"{value:.3g}")
    bar.set_label(label)
    bar.outline.set_linewidth(0.6)


def _legend(panels: Sequence[Panel]) -> dict[str, str]:
    """Colours of the labelled traces; a label of several panels appears once."""
    drawn = [pair for panel in panels for pair in zip(panel.traces, _TRACES * len(panel.traces), strict=False)]
    return {trace.label: colour for trace, colour in drawn if trace.label}


# -- layout ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Layout:
    """An empty picture of mechanisms."""

    page: Page
    axes: tuple[Axes, ...]  # one per panel
    size: float  # diagonal of the mechanism, in the user's unit
    arrow_scale: float  # length drawn per unit of force
    bar: Axes | None  # of the colour bar


def lay_out(panels: Sequence[Panel], *, colour_bar: bool, heading: str, legend: Sequence[str]) -> Layout:
    """A figure in which all ``panels`` fit, with a ``heading`` above them and the entries of a ``legend`` below."""
    points = np.concatenate([p for panel in panels for p in _extent(panel)])
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high > low).any():  # a single point
        low, high = low - 0.5, high + 0.5
    size = float(np.hypot(*(high - low)))
    arrows = [arrow for panel in panels for arrow in panel.arrows]
    strongest = max((float(np.hypot(*arrow.vector)) for arrow in arrows), default=0.0)
    arrow_scale = LENGTHS.longest_arrow * size / (strongest or np.inf)

    largest = np.array([min(LENGTHS.panel[0], LENGTHS.row / len(panels)), LENGTHS.panel[1]])
    low, high = _limits(arrows, np.array([low, high]), arrow_scale, largest)
    scale = float(min(largest / (high - low)))
    # slender and small mechanisms keep their scale and get air on both sides
    lines = text_size(heading, **HEADING)[0], legend_width(legend)
    titles = (text_size(panel.title, **TITLE)[0] for panel in panels)
    least = max(LENGTHS.smallest, max(lines) / len(panels), *titles)
    lack = np.maximum(np.array([least, LENGTHS.smallest]) / scale - (high - low), 0.0)
    low, high = low - 0.5 * lack, high + 0.5 * lack
    wide, tall = scale * (high - low)

    widths, gaps = [wide] * len(panels), [LENGTHS.gap] * (len(panels) - 1)
    if colour_bar:
        widths, gaps = [*widths, LENGTHS.bar], [*gaps, LENGTHS.bar]
    above = bool(heading) + any(panel.title for panel in panels)
    right = LENGTHS.bar_room - 2.0 * LENGTHS.bar if colour_bar else LENGTHS.right
    page = Page.of(widths, gaps, tall, above=above, below=bool(legend), right=right)
    axes = page.row[: len(panels)]
    for one in axes:
        one.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        one.tick_params(labelleft=one is axes[0], length=3.0)
    return Layout(page, axes, size, arrow_scale, page.row[-1] if colour_bar else None)


def _limits(arrows: Sequence[Arrow], corners: Reals, arrow_scale: float, largest: Reals) -> tuple[Reals, Reals]:
    """Limits around ``corners`` and ``arrows``; the room for labels depends on the scale, and the scale on the room."""
    low, high = corners
    for _ in range(3):
        scale = float(min(largest / np.maximum(high - low, 1e-6 * (high - low).max())))
        around = np.array([*corners, *(end for arrow in arrows for end in _arrow_extent(arrow, arrow_scale, scale))])
        padding = LENGTHS.padding / scale
        low, high = around.min(axis=0) - padding, around.max(axis=0) + padding
    return low, high


def _extent(panel: Panel) -> Iterator[Reals]:
    for state in (panel.undeformed, *panel.deformed):
        yield from (shape.points[np.unique(shape.triangles)] for shape in state.flexible)
        yield from (shape.outline for shape in state.rigid)
        yield from (pin.at[None] for pin in state.pins)
    for trace in panel.traces:
        yield from (trace.points, trace.marks)
    yield from (arrow.at[None] for arrow in panel.arrows)


def _arrow_extent(arrow: Arrow, arrow_scale: float, scale: float) -> Iterator[Reals]:
    """Corners of ``arrow`` and of the label at its tail."""
    tail = arrow.at - arrow_scale * arrow.vector
    yield from (tail, arrow.at)
    if arrow.label:
        room = np.array(text_size(arrow.label, **NAME)) / scale
        centre = tail - normalised(arrow.vector) * (0.5 * room + 0.1 / scale)
        yield from (centre - 0.5 * room, centre + 0.5 * room)
