"""Pictures of a mechanism: its links, their deformation, forces and paths of points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, PathPatch, Polygon
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.tri import Triangulation

from fenicsmech.errors import DescriptionError
from fenicsmech.plot.layout import MechanismLayout, arrow_ends, lay_out
from fenicsmech.plot.outlines import path_of
from fenicsmech.plot.shapes import Arrow, FlexibleShape, MechanismShape, Panel, RigidShape
from fenicsmech.plot.style import FLEXIBLE, FLEXIBLE_RIM, HALO, PALETTE, draw_pin, house_style, save_png
from fenicsmech.polygons import edge_loops

_RIGID, _RIGID_RIM = "#c9ccd1", "#6b7078"
_FIXED, _FIXED_RIM, _FIXED_HATCH = "#565b63", "#2e3238", "#7d838d"
_PALE = "#c4c4c4"
_FORCE = "#1d4f9c"
_TRACES = (PALETTE[2], PALETTE[4], PALETTE[5])
_STRESS = LinearSegmentedColormap.from_list(
    "stress", ("#fff3d6", "#fdd28a", "#f6983f", "#d9542b", "#a01c3b", "#5c0b3e")
)


def draw_configurations(
    path: str | Path,
    panels: Sequence[Panel],
    *,
    title: str = "",
    colour_label: str = "",
    colour_limits: tuple[float, float] | None = None,
    unit: str = "mm",
) -> None:
    """Draws mechanisms side by side, with the same limits, scale of forces and colours.

    The undeformed state is a pale outline under the deformed one. Flexible links are orange or coloured by their
    values, rigid links grey, fixed ones dark and hatched; the largest force has the longest arrow.

    Args:
        path: the PNG file.
        panels: from left to right.
        title: a line above all.
        colour_label: quantity and unit of the values ("von Mises stress [MPa]").
        colour_limits: least and largest colour; None spans from zero (or the least value) to the 99th percentile:
            the few peaks at the edge of an interface would leave the rest without contrast. The bar shows with a
            pointed end that larger values exist.
        unit: of lengths, for the axes.

    Raises:
        DescriptionError: the panels are empty, the colour limits are not in order, or the name does not end in .png.
    """
    if not any(s.flexible or s.rigid or s.pins for panel in panels for s in (panel.undeformed, *panel.deformed)):
        raise DescriptionError(f"picture '{path}'", "there is nothing to draw", "Give at least one shape")
    values = [v for panel in panels for shape in _filled(panel).flexible for v in _values(shape)]
    norm = _normalise(values, colour_limits) if values else None
    with house_style():
        legend = _legend(panels)
        layout = lay_out(panels, colour_bar=norm is not None, heading=title, legend=tuple(legend))
        for axes, panel in zip(layout.axes, panels, strict=True):
            _draw_panel(axes, panel, layout, norm)
            axes.set_xlabel(f"x [{unit}]")
        layout.axes[0].set_ylabel(f"y [{unit}]")
        if norm is not None:
            _draw_colour_bar(layout, norm, np.concatenate(values), colour_label)
        layout.page.write(title, {label: Line2D([], [], color=c, lw=1.4) for label, c in legend.items()})
        save_png(layout.page.figure, path)


def _filled(panel: Panel) -> MechanismShape:
    return panel.deformed[-1] if panel.deformed else panel.undeformed


def _values(shape: FlexibleShape) -> Iterator[np.ndarray]:
    if shape.values is not None:
        yield shape.values
    if shape.point_values is not None:
        yield shape.point_values[np.unique(shape.triangles)]


def _normalise(values: Sequence[np.ndarray], limits: tuple[float, float] | None) -> Normalize:
    if limits is None:
        every = np.concatenate(values)
        low, most = min(0.0, float(every.min())), float(np.percentile(every, 99.0))
        high = next(h for h in (most, float(every.max()), low + 1.0) if h > low)
    else:
        low, high = limits
        if not low < high:
            raise DescriptionError("colour_limits", f"{low} is not below {high}", "Give the smaller value first")
    return Normalize(low, high)


def _draw_panel(axes: Axes, panel: Panel, layout: MechanismLayout, norm: Normalize | None) -> None:
    axes.set_title(panel.title, loc="left")
    if panel.deformed:
        still = panel.undeformed
        outlines = [*(path_of([rigid.outline]) for rigid in still.rigid), *map(_rim, still.flexible)]
        for outline in outlines:
            axes.add_patch(PathPatch(outline, fc="none", ec=_PALE, lw=1.0, zorder=2))
    for state in panel.deformed[:-1]:
        for rigid in state.rigid:
            axes.add_patch(Polygon(rigid.outline, closed=True, fc=_RIGID, ec="none", alpha=0.35, zorder=2.5))
        for flexible in state.flexible:
            axes.add_patch(PathPatch(_rim(flexible), fc=FLEXIBLE, ec="none", alpha=0.25, zorder=2.6))
    state = _filled(panel)
    for rigid in sorted(state.rigid, key=lambda shape: not shape.fixed):
        _draw_rigid(axes, rigid)
    for flexible in state.flexible:
        _draw_flexible(axes, flexible, norm)
    for pin in state.pins:
        draw_pin(axes, pin.at, pin.radius or 0.014 * layout.size, welded=pin.welded)
    for index, trace in enumerate(panel.traces):
        colour = _trace_colour(index)
        axes.plot(*trace.points.T, color=colour, lw=1.4, zorder=5)
        axes.plot(*trace.marks.T, "o", ms=4.5, mfc=colour, mec="white", mew=0.8, zorder=7)
    for arrow in panel.arrows:
        _draw_arrow(axes, arrow, layout.arrow_scale)
    axes.grid(True, color="#ededed")  # last: coloured meshes switch it off


def _rim(shape: FlexibleShape) -> Outline:
    """The rim of a flexible link as one path."""
    corners = shape.points[shape.triangles]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    turned = np.where((ax * by < ay * bx)[:, None], shape.triangles[:, [0, 2, 1]], shape.triangles)
    return path_of(shape.points[loop] for loop in edge_loops(turned))


def _draw_rigid(axes: Axes, shape: RigidShape) -> None:
    face, edge = (_FIXED, _FIXED_RIM) if shape.fixed else (_RIGID, _RIGID_RIM)
    if shape.fixed:
        axes.add_patch(Polygon(shape.outline, closed=True, fc=face, ec=_FIXED_HATCH, hatch="////", lw=0.0, zorder=3))
        face = "none"
    axes.add_patch(Polygon(shape.outline, closed=True, fc=face, ec=edge, lw=1.0, zorder=3))


def _draw_flexible(axes: Axes, shape: FlexibleShape, norm: Normalize | None) -> None:
    face = FLEXIBLE
    if shape.values is not None:
        cells = PolyCollection(
            shape.points[shape.triangles], array=shape.values, cmap=_STRESS, norm=norm, ec="face", lw=0.3, zorder=4
        )
        axes.add_collection(cells, autolim=False)
        face = "none"
    elif shape.point_values is not None:
        mesh = Triangulation(*shape.points.T, shape.triangles)
        axes.tripcolor(mesh, shape.point_values, shading="gouraud", cmap=_STRESS, norm=norm, zorder=4)
        face = "none"
    axes.add_patch(PathPatch(_rim(shape), fc=face, ec=FLEXIBLE_RIM, lw=0.9, joinstyle="round", zorder=4))


def _draw_arrow(axes: Axes, arrow: Arrow, scale: float) -> None:
    length = float(np.hypot(*arrow.vector))
    if length == 0.0:
        return
    tail, head = arrow_ends(arrow, scale)
    axes.add_patch(
        FancyArrowPatch(
            tail, head, arrowstyle="-|>,head_length=0.5,head_width=0.26", mutation_scale=15, lw=2.2, color=_FORCE,
            shrinkA=0, shrinkB=0, joinstyle="miter", zorder=8,
        )
    )  # fmt: skip
    if arrow.label:
        free, side = (tail, -arrow.vector / length) if arrow.pushes else (head, arrow.vector / length)
        axes.annotate(
            arrow.label, free, xytext=5.0 * side, textcoords="offset points", color=_FORCE, fontweight="bold",
            ha="right" if side[0] < -0.5 else "left" if side[0] > 0.5 else "center",
            va="top" if side[1] < -0.5 else "bottom" if side[1] > 0.5 else "center",
            path_effects=HALO, zorder=9,
        )  # fmt: skip


def _draw_colour_bar(layout: MechanismLayout, norm: Normalize, values: np.ndarray, label: str) -> None:
    over, under = values.max() > norm.vmax, values.min() < norm.vmin
    extend = "both" if over and under else "max" if over else "min" if under else "neither"
    bar = layout.page.figure.colorbar(ScalarMappable(norm, _STRESS), cax=layout.bar, extend=extend, extendfrac=0.04)
    bar.locator, bar.formatter = MaxNLocator(5), FuncFormatter(lambda value, _: f"{value:.3g}")
    bar.set_label(label)
    bar.outline.set_linewidth(0.6)


def _legend(panels: Sequence[Panel]) -> dict[str, str]:
    """Colours of the labelled traces; a label of several panels appears once."""
    return {
        trace.label: _trace_colour(index) for panel in panels for index, trace in enumerate(panel.traces) if trace.label
    }


def _trace_colour(index: int) -> str:
    return _TRACES[index % len(_TRACES)]
