"""The picture of a design: the links of a mechanism before and after an optimisation.

On the left all links stand in place; several links are laid down once more on the right, at a larger scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from fenicsmech.errors import DescriptionError
from fenicsmech.plot.library import mpl
from fenicsmech.plot.page import (
    FLEXIBLE,
    FLEXIBLE_RIM,
    HEADING,
    INK,
    LENGTHS,
    NAME,
    SMALL,
    TITLE,
    Handle,
    Labels,
    Page,
    Spot,
    draw_pin,
    house_style,
    legend_width,
    normalised,
    path_of,
    save_png,
    text_size,
)
from fenicsmech.plot.shapes import DesignShape, OutlineShape, Reals, RigidShape
from fenicsmech.polygons import signed_area

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path as Outline

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
    """
    if not designs:
        raise DescriptionError(f"picture '{path}'", "there is nothing to draw", "Give at least one link")
    thicknesses = [_thickness_line(design, unit) for design in designs]
    with house_style():
        handles, subtitle = _handles(designs), ""
        if len(designs) == 1:  # several links have name and thickness beside their details
            subtitle = ": ".join(words for words in (designs[0].name, thicknesses[0]) if words)
        captions = [
            max(text_size(design.name, **NAME)[0], text_size(line, **SMALL)[0])
            for design, line in zip(designs, thicknesses, strict=True)
        ]
        heading, below = text_size(title, **HEADING)[0], text_size(subtitle, **TITLE)[0]
        layout = lay_out_designs(
            designs, captions=captions, heading=heading, legend=legend_width(handles), subtitle=below
        )
        _draw_in_place(layout.place, designs, rigid, unit, subtitle, alone=layout.details is None)
        if layout.details is not None:
            _draw_details(layout.details, layout.captions, designs, thicknesses, unit)
        layout.page.write(title, handles)
        save_png(layout.page.figure, path)


def _draw_in_place(
    stage: Stage, designs: Sequence[DesignShape], rigid: Sequence[RigidShape], unit: str, subtitle: str, *, alone: bool
) -> None:
    """All links where they are in the mechanism, the rigid ones behind, with dimensions if there is one, else names."""
    for shape in rigid:
        stage.axes.add_patch(mpl.Polygon(shape.outline, closed=True, fc=_RIGID, ec=_RIGID_RIM, lw=0.8, zorder=1.5))
    labels = _draw_links(stage, designs, detailed=alone)
    stage.axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    stage.axes.set_title(subtitle, loc="left")
    stage.axes.grid(True, color="#ededed")
    for design, view in zip(designs, stage.views, strict=True):
        if alone:
            _draw_dimensions(labels, stage, design, view)
        else:
            labels.add(design.name, _beside(design), **NAME)


def _draw_details(
    stage: Stage, captions: Sequence[Reals], designs: Sequence[DesignShape], thicknesses: Sequence[str], unit: str
) -> None:
    labels = _draw_links(stage, designs, detailed=True)
    for design, view, corner, line in zip(designs, stage.views, captions, thicknesses, strict=True):
        stage.axes.text(*corner, design.name, va="top", **NAME)
        stage.axes.annotate(line, corner, xytext=(0.0, -14.0), textcoords="offset points", va="top", **SMALL)
        _draw_dimensions(labels, stage, design, view)
    # a bar of 1, 2 or 5 × 10ⁿ units, at most 1.2 inches long
    power = 10.0 ** np.floor(np.log10(1.2 / stage.scale))
    length = power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power * stage.scale <= 1.2)
    low = 0.04 / stage.scale
    stage.axes.plot([0, length], [low, low], color=INK, lw=1.6, marker="|", ms=7.0, mew=1.6, clip_on=False)
    stage.axes.text(length + 0.1 / stage.scale, low, f"{length:g} {unit}", va="center", **SMALL)


def _draw_links(stage: Stage, designs: Sequence[DesignShape], *, detailed: bool) -> Labels:
    """Draws the links; returns the labels to be placed around them."""
    axes, loops = stage.axes, []
    for design, view in zip(designs, stage.views, strict=True):
        before, after = design.before, design.after
        axes.add_patch(mpl.PathPatch(_path(before, view), fc=_BEFORE, ec="none", zorder=2))
        axes.add_patch(
            mpl.PathPatch(_path(after, view), fc=FLEXIBLE, ec=FLEXIBLE_RIM, lw=1.0, joinstyle="round", zorder=3)
        )
        # over the new shape too: shows where it is thicker than before
        axes.add_patch(mpl.PathPatch(_path(before, view), fc="none", ec=_BEFORE_RIM, lw=0.8, ls=_DASHES, zorder=4))
        if detailed:
            axes.plot(*view(after.centreline).T, color=FLEXIBLE_RIM, lw=0.8, ls=(0, (9, 2, 1.5, 2)), zorder=4.5)
        axes.plot(*view(before.controls).T, lw=0, zorder=4.5, **(_CONTROL | {"mfc": _BEFORE_RIM, "ms": 3.4}))
        axes.plot(*view(after.controls).T, lw=0, zorder=5, **_CONTROL)
        for at in view(design.joints):
            draw_pin(axes, at, LENGTHS.pin / stage.scale)
        loops += [view(loop) for loop in (*before.loops, *after.loops)]
    return Labels(axes, loops)


def _path(outline: OutlineShape, view: View) -> Outline:
    """The loops as one path; holes run against the outer rim, so that they stay empty."""
    wrong = [(signed_area(loop) > 0.0) != (index == 0) for index, loop in enumerate(outline.loops)]
    return path_of(view(loop[::-1] if turn else loop) for loop, turn in zip(outline.loops, wrong, strict=True))


def _beside(design: DesignShape) -> list[Spot]:
    """Places around the new outline, those far from joints first."""
    loop = design.after.loops[0]
    along = normalised(np.roll(loop, -1, axis=0) - np.roll(loop, 1, axis=0))
    normals = np.column_stack((along[:, 1], -along[:, 0]))
    normals = normals if signed_area(loop) > 0.0 else -normals
    picked = np.arange(0, len(loop), max(1, len(loop) // 80))
    picked = picked[np.argsort(-_away(loop[picked], design.joints), kind="stable")]
    return [Spot(loop[k], normals[k]) for k in picked]


def _away(points: Reals, joints: Reals) -> Reals:
    """(n,) distances of ``points`` from the nearest joint, infinite without joints."""
    return cdist(points, joints).min(axis=1, initial=np.inf)


def _draw_dimensions(labels: Labels, stage: Stage, design: DesignShape, view: View) -> None:
    """The thinnest and the thickest place: a line across, with the number at one of its ends.

    None is drawn at a joint, which determines the thickness there.
    """
    thickness = design.after.thickness
    if thickness is None:
        return
    line = view(design.after.centreline)
    away, tangents = _away(line, view(design.joints)), normalised(np.gradient(line, axis=0))
    for k, extreme in _extremes(thickness, away):
        if away[k] <= thickness[k]:
            continue
        normal = np.array([-tangents[k, 1], tangents[k, 0]])
        ends = line[k] + 0.5 * thickness[k] * np.array([[-1.0], [1.0]]) * normal
        tick = LENGTHS.tick / stage.scale * np.array([[-1.0], [1.0]]) * tangents[k]
        for stroke in (ends, *(end + tick for end in ends)):
            stage.axes.plot(*stroke.T, color=INK, lw=1.1, zorder=5)
        places = [Spot(ends[1], normal), Spot(ends[0], -normal)]
        labels.add(f"{extreme:.3g}", places, leader=True, color=INK, **SMALL)


def _extremes(thickness: Reals, away: Reals) -> list[tuple[int, float]]:
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
    return after and f"{after} {unit} thick" + (f", before {before} {unit}" if before else "")


def _span(outline: OutlineShape) -> str:
    if outline.thickness is None:
        return ""
    numbers = (f"{number:.3g}" for number in (outline.thickness.min(), outline.thickness.max()))
    return "–".join(dict.fromkeys(numbers))


def _handles(designs: Sequence[DesignShape]) -> dict[str, Handle]:
    """Legend handles by their label."""
    handles: dict[str, Handle] = {
        "before": mpl.Patch(fc=_BEFORE, ec=_BEFORE_RIM, lw=0.8, ls=_DASHES),
        "after": mpl.Patch(fc=FLEXIBLE, ec=FLEXIBLE_RIM, lw=1.0),
    }
    if any(len(design.after.controls) for design in designs):
        handles["control point"] = mpl.Line2D([], [], lw=0, **_CONTROL)
    if any(len(design.joints) for design in designs):
        ring = mpl.Line2D([], [], lw=0, marker="o", ms=9.0, mfc="white", mec=INK, mew=1.0)
        handles["joint"] = (ring, mpl.Line2D([], [], lw=0, marker="o", ms=3.2, mfc=INK, mec="none"))
    return handles


# -- layout ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class View:
    """A rigid motion in the plane: x ↦ R x + shift."""

    turn: Reals
    shift: Reals

    def __call__(self, points: Reals) -> Reals:
        return points @ self.turn.T + self.shift


IN_PLACE = View(np.eye(2), np.zeros(2))


@dataclass(frozen=True, eq=False)
class Stage:
    """Axes in which every link is drawn once."""

    axes: Axes
    scale: float  # inches per unit of length
    views: Sequence[View]  # how each link gets there


@dataclass(frozen=True, eq=False)
class DesignLayout:
    """An empty picture of a design."""

    page: Page
    place: Stage  # of the mechanism
    details: Stage | None = None  # of the links laid down; None for a single link
    captions: Sequence[Reals] = ()  # (2,) upper left corner of each caption in ``details``


def lay_out_designs(
    designs: Sequence[DesignShape], *, captions: Sequence[float], heading: float, legend: float, subtitle: float
) -> DesignLayout:
    """A figure in which all ``designs`` fit.

    In inches: the width of each link's caption, of the heading above all, the legend below all, and the subtitle above
    the mechanism.
    """
    corners = np.concatenate([_corners(design) for design in designs])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = _scale(high - low, LENGTHS.panel)
    rows, beside = None, 0.0
    if len(designs) > 1:
        rows = _Rows(designs, captions, scale)
        beside = rows.width + LENGTHS.details_gap
        # as tall as the rows if that is wide enough, but not larger than them
        tallest = LENGTHS.panel[0], max(LENGTHS.panel[1], rows.height)
        scale = max(scale, min(_scale(high - low, tallest), rows.scale))
    wide, tall = scale * (high - low) + 2.0 * LENGTHS.details_padding
    wide = max(wide, LENGTHS.smallest, subtitle, max(heading, legend) - beside)
    tall = max(tall, LENGTHS.smallest, rows.height if rows else 0.0)
    centre, size = 0.5 * (low + high), np.array([wide, tall]) / scale

    widths, gaps = ([wide, rows.width], [LENGTHS.details_gap]) if rows else ([wide], [])
    page = Page.of(widths, gaps, tall, above=bool(heading) + bool(subtitle), below=1, right=LENGTHS.right)
    place = Stage(page.row[0], scale, [IN_PLACE] * len(designs))
    place.axes.set(xlim=centre[0] + (-0.5, 0.5) * size[:1], ylim=centre[1] + (-0.5, 0.5) * size[1:])
    place.axes.tick_params(length=3.0)
    if rows is None:
        return DesignLayout(page, place)
    details = page.row[1]
    details.set(xlim=(0.0, rows.width / rows.scale), ylim=(0.0, tall / rows.scale))
    details.set_axis_off()
    views, starts = rows.spread(tall)
    return DesignLayout(page, place, Stage(details, rows.scale, views), starts)


class _Rows:
    """Links laid down in rows, at one ``scale``, in inches per unit of length, as large as the room allows.

    ``width`` and ``height``, in inches, are those of all rows and the scale bar below them.
    """

    def __init__(self, designs: Sequence[DesignShape], captions: Sequence[float], place_scale: float) -> None:
        self._turns = [_lay_down(design) for design in designs]
        turned = [_corners(design) @ turn.T for design, turn in zip(designs, self._turns, strict=True)]
        self._centres = [0.5 * (points.min(axis=0) + points.max(axis=0)) for points in turned]
        self._sizes = np.array([np.ptp(points, axis=0) for points in turned])
        self._captions = captions
        widest, tallest = LENGTHS.details
        self.scale = min((widest - 2.0 * LENGTHS.side) / self._sizes[:, 0].max(), LENGTHS.zoom * place_scale)
        self._fill()
        while self.height > tallest and self.scale > place_scale:
            self.scale = max(0.95 * self.scale, place_scale)
            self._fill()

    def _fill(self) -> None:
        drawn = self.scale * self._sizes
        self._widths = np.maximum(drawn[:, 0] + 2.0 * LENGTHS.side, self._captions)
        self._heights = LENGTHS.caption + drawn[:, 1] + 2.0 * LENGTHS.above
        self._rows: list[list[int]] = []
        room: list[float] = []  # left in each row
        for link, width in enumerate(self._widths):
            row = next((k for k, left in enumerate(room) if width <= left), len(room))
            if row == len(room):
                self._rows.append([])
                room.append(LENGTHS.details[0])
            self._rows[row].append(link)
            room[row] -= width + LENGTHS.details_gap
        self.width = max(self._widths[row].sum() + LENGTHS.details_gap * (len(row) - 1) for row in self._rows)
        self.height = sum(self._heights[row].max() + LENGTHS.rows for row in self._rows) + LENGTHS.scale_bar

    def spread(self, tall: float) -> tuple[list[View], list[Reals]]:
        """Views and upper left corners of captions of all links, with the rows spread over ``tall`` inches."""
        views, corners = {}, {}
        top, air = tall, LENGTHS.rows + (tall - self.height) / len(self._rows)
        for row in self._rows:
            left = 0.0
            for link in row:
                wide, deep = self.scale * self._sizes[link]
                low = top - LENGTHS.caption - LENGTHS.above - 0.5 * deep
                middle = np.array([left + LENGTHS.side + 0.5 * wide, low])
                views[link] = View(self._turns[link], middle / self.scale - self._centres[link])
                corners[link] = np.array([left, top]) / self.scale
                left += self._widths[link] + LENGTHS.details_gap
            top -= self._heights[row].max() + air
        return [views[link] for link in sorted(views)], [corners[link] for link in sorted(corners)]


def _scale(size: Reals, largest: tuple[float, float]) -> float:
    """Inches per unit at which ``size`` (2,) with its padding fills a panel of ``largest`` inches."""
    room = np.array(largest) - 2.0 * LENGTHS.details_padding
    return float(np.min(room / np.maximum(size, 1e-6 * size.max())))


def _corners(design: DesignShape) -> Reals:
    return np.concatenate([*design.before.loops, *design.after.loops, design.joints])


def _lay_down(design: DesignShape) -> Reals:
    """(2, 2) the rotation that turns a link's longest direction to x, by less than a quarter turn or little more."""
    _, axes = np.linalg.eigh(np.cov(design.before.loops[0].T))
    along = axes[:, 1]
    x, y = along if along @ (1.0, 0.5) >= 0.0 else -along  # directions up or right become right
    return np.array([[x, y], [-y, x]])
