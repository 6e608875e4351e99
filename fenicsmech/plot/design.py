"""The picture of a design: the links of a mechanism before and after an optimisation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Polygon
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from fenicsmech.errors import DescriptionError
from fenicsmech.plot.labels import Labels, Spot
from fenicsmech.plot.layout import IN_PLACE, DesignLayout, Handle, View, lay_out_designs, legend_width
from fenicsmech.plot.outlines import path_of
from fenicsmech.plot.shapes import DesignShape, LinkOutline, RigidShape
from fenicsmech.plot.style import (
    FLEXIBLE,
    FLEXIBLE_RIM,
    HEADING,
    INK,
    LENGTHS,
    NAME,
    SMALL,
    TITLE,
    draw_pin,
    house_style,
    save_png,
    text_size,
)
from fenicsmech.polygons import signed_area

_BEFORE, _BEFORE_RIM = "#dfe2e6", "#6b7078"
_DASHES = (0, (3.5, 2.0))
_RIGID, _RIGID_RIM = "#f4f5f6", "#d3d6da"
_CONTROL = {"marker": "o", "ms": 4.2, "mfc": INK, "mec": "white", "mew": 0.7}


def draw_designs(
    path: str | Path,
    designs: Sequence[DesignShape],
    *,
    rigid: Sequence[RigidShape] = (),
    unit: str = "mm",
    title: str = "",
) -> None:
    """Draws links before and after an optimisation in one picture.

    On the left all links are in place: light grey with a dashed rim before, orange after. When there are several, each
    is laid down beside it, all at the same larger scale. Where thicknesses are known, the thinnest and the thickest
    place of the new shape are dimensioned.

    Args:
        path: the PNG file.
        designs: the links.
        rigid: links that stay as they are, drawn pale behind the others as far as the picture reaches.
        unit: of lengths, for axes and thicknesses.
        title: a line above all.

    Raises:
        DescriptionError: there are no links, or the name does not end in .png.
    """
    if not designs:
        raise DescriptionError(f"picture '{path}'", "there is nothing to draw", "Give at least one link")
    thicknesses = [_thickness_line(design, unit) for design in designs]
    with house_style():
        handles, subtitle = _handles(designs), ""
        if len(designs) == 1:  # several links have name and thickness beside their details
            subtitle = ": ".join(words for words in (designs[0].name, thicknesses[0]) if words)
        layout = lay_out_designs(
            designs,
            captions=[
                max(text_size(design.name, **NAME)[0], text_size(line, **SMALL)[0])
                for design, line in zip(designs, thicknesses, strict=True)
            ],
            heading=text_size(title, **HEADING)[0],
            legend=legend_width(handles),
            subtitle=text_size(subtitle, **TITLE)[0],
        )
        _draw_in_place(layout, designs, rigid, unit, subtitle)
        if layout.details is not None:
            _draw_details(layout.details, layout, designs, thicknesses, unit)
        layout.page.write(title, handles)
        save_png(layout.page.figure, path)


def _draw_in_place(
    layout: DesignLayout, designs: Sequence[DesignShape], rigid: Sequence[RigidShape], unit: str, subtitle: str
) -> None:
    """All links where they are in the mechanism, the rigid ones behind, with dimensions if there is one, else names."""
    axes, scale, alone = layout.place, layout.place_scale, layout.details is None
    for shape in rigid:
        axes.add_patch(Polygon(shape.outline, closed=True, fc=_RIGID, ec=_RIGID_RIM, lw=0.8, zorder=1.5))
    for design in designs:
        _draw_link(axes, design, IN_PLACE, scale, detailed=alone)
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.set_title(subtitle, loc="left")
    axes.grid(True, color="#ededed")
    labels = Labels(axes, [shape for design in designs for shape in _shapes(design, IN_PLACE)])
    for design in designs:
        if alone:
            _draw_dimensions(labels, axes, design, IN_PLACE, scale)
        else:
            labels.add(design.name, _beside(design), **NAME)


def _draw_link(axes: Axes, design: DesignShape, view: View, scale: float, *, detailed: bool) -> None:
    before, after = design.before, design.after
    axes.add_patch(PathPatch(_path(before, view), fc=_BEFORE, ec="none", zorder=2))
    axes.add_patch(PathPatch(_path(after, view), fc=FLEXIBLE, ec=FLEXIBLE_RIM, lw=1.0, joinstyle="round", zorder=3))
    # over the new shape too: shows where it is thicker than before
    axes.add_patch(PathPatch(_path(before, view), fc="none", ec=_BEFORE_RIM, lw=0.8, ls=_DASHES, zorder=4))
    if detailed:
        axes.plot(*view(after.centreline).T, color=FLEXIBLE_RIM, lw=0.8, ls=(0, (9, 2, 1.5, 2)), zorder=4.5)
    axes.plot(*view(before.controls).T, lw=0, zorder=4.5, **(_CONTROL | {"mfc": _BEFORE_RIM, "ms": 3.4}))
    axes.plot(*view(after.controls).T, lw=0, zorder=5, **_CONTROL)
    for at in view(design.joints):
        draw_pin(axes, at, LENGTHS.pin / scale)


def _path(outline: LinkOutline, view: View) -> Outline:
    """The loops as one path; holes run against the outer rim, so that they stay empty."""
    loops = []
    for index, loop in enumerate(outline.loops):
        points = view(loop)
        loops.append(points if (signed_area(points) > 0.0) == (index == 0) else points[::-1])
    return path_of(loops)


def _draw_details(
    axes: Axes, layout: DesignLayout, designs: Sequence[DesignShape], thicknesses: Sequence[str], unit: str
) -> None:
    shapes = [s for design, view in zip(designs, layout.views, strict=True) for s in _shapes(design, view)]
    labels = Labels(axes, shapes)
    for design, view, corner, line in zip(designs, layout.views, layout.captions, thicknesses, strict=True):
        _draw_link(axes, design, view, layout.details_scale, detailed=True)
        axes.text(*corner, design.name, va="top", **NAME)
        axes.annotate(line, corner, xytext=(0.0, -14.0), textcoords="offset points", va="top", **SMALL)
        _draw_dimensions(labels, axes, design, view, layout.details_scale)
    _draw_scale_bar(axes, layout.details_scale, unit)


def _shapes(design: DesignShape, view: View) -> list[NDArray[np.float64]]:
    return [view(loop) for loop in (*design.before.loops, *design.after.loops)]


def _beside(design: DesignShape) -> list[Spot]:
    """Places around the new outline, those far from joints first."""
    loop = design.after.loops[0]
    along = _unit(np.roll(loop, -1, axis=0) - np.roll(loop, 1, axis=0))
    normals = np.column_stack((along[:, 1], -along[:, 0]))
    normals = normals if signed_area(loop) > 0.0 else -normals
    picked = np.arange(0, len(loop), max(1, len(loop) // 80))
    if len(design.joints):
        away = np.min([np.hypot(*(loop[picked] - joint).T) for joint in design.joints], axis=0)
        picked = picked[np.argsort(-away, kind="stable")]
    return [Spot(loop[k], normals[k]) for k in picked]


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) vectors of length one; zero stays zero, as where points coincide."""
    return vectors / np.maximum(np.hypot(*vectors.T), np.finfo(float).tiny)[:, None]


def _draw_dimensions(labels: Labels, axes: Axes, design: DesignShape, view: View, scale: float) -> None:
    """The thinnest and the thickest place: a line across, with the number at one of its ends.

    None is drawn at a joint, which determines the thickness there.
    """
    thickness = design.after.thickness
    if thickness is None:
        return
    line, joints = view(design.after.centreline), view(design.joints)
    away = np.min([np.hypot(*(line - joint).T) for joint in joints] or np.full((1, len(line)), np.inf), axis=0)
    tangents = _unit(np.gradient(line, axis=0))
    for k, extreme in _extremes(thickness, away):
        if away[k] <= thickness[k]:
            continue
        normal = np.array([-tangents[k, 1], tangents[k, 0]])
        ends = line[k] + 0.5 * thickness[k] * np.array([[-1.0], [1.0]]) * normal
        for stroke in (ends, *(end + LENGTHS.tick / scale * np.array([[-1.0], [1.0]]) * tangents[k] for end in ends)):
            axes.plot(*stroke.T, color=INK, lw=1.1, zorder=5)
        places = [Spot(ends[1], normal), Spot(ends[0], -normal)]
        labels.add(f"{extreme:.3g}", places, leader=True, color=INK, **SMALL)


def _extremes(thickness: NDArray[np.float64], away: NDArray[np.float64]) -> list[tuple[int, float]]:
    """Index and thickness of the thinnest and the thickest place; one entry if the thickness is constant.

    Of places of the same thickness it is the one that is most ``away``.
    """
    least, most = float(thickness.min()), float(thickness.max())
    tolerance = 1e-3 * most  # of equal thicknesses
    extremes = [(thickness <= least + tolerance, least)]
    if most - least > tolerance:
        extremes.append((thickness >= most - tolerance, most))
    return [(int(np.argmax(np.where(places, away, -np.inf))), value) for places, value in extremes]


def _thickness_line(design: DesignShape, unit: str) -> str:
    after, before = _span(design.after), _span(design.before)
    if not after:
        return ""
    return f"{after} {unit} thick" + (f", before {before} {unit}" if before else "")


def _span(outline: LinkOutline) -> str:
    if outline.thickness is None:
        return ""
    numbers = (f"{number:.3g}" for number in (outline.thickness.min(), outline.thickness.max()))
    return "–".join(dict.fromkeys(numbers))


def _draw_scale_bar(axes: Axes, scale: float, unit: str) -> None:
    """A bar of 1, 2 or 5 × 10ⁿ units, at most 1.2 inches long."""
    power = 10.0 ** np.floor(np.log10(1.2 / scale))
    length = power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power * scale <= 1.2)
    low = 0.04 / scale
    axes.plot([0, length], [low, low], color=INK, lw=1.6, marker="|", ms=7.0, mew=1.6, clip_on=False)
    axes.text(length + 0.1 / scale, low, f"{length:g} {unit}", va="center", **SMALL)


def _handles(designs: Sequence[DesignShape]) -> dict[str, Handle]:
    """Legend handles by their label."""
    handles: dict[str, Handle] = {
        "before": Patch(fc=_BEFORE, ec=_BEFORE_RIM, lw=0.8, ls=_DASHES),
        "after": Patch(fc=FLEXIBLE, ec=FLEXIBLE_RIM, lw=1.0),
    }
    if any(len(design.after.controls) for design in designs):
        handles["control point"] = Line2D([], [], lw=0, **_CONTROL)
    if any(len(design.joints) for design in designs):
        ring = Line2D([], [], lw=0, marker="o", ms=9.0, mfc="white", mec=INK, mew=1.0)
        handles["joint"] = (ring, Line2D([], [], lw=0, marker="o", ms=3.2, mfc=INK, mec="none"))
    return handles
