"""The size of a picture and the places of its panels: equal scales in x and y, small margins, room for all labels.

A page is a row of panels of equal height. Above it stands a heading, below it a legend. Pictures of mechanisms have one
panel per configuration, all with the same limits; those of designs have the mechanism in place on the left and every
link laid down on the right.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fenicsmech.plot.shapes import Arrow, DesignShape, MechanismShape, Panel
from fenicsmech.plot.style import HEADING, LEGEND, LENGTHS, NAME, TITLE, new_figure, text_size

Reals = NDArray[np.float64]
Handle: TypeAlias = Artist | tuple[Artist, ...]


@dataclass(frozen=True, eq=False)
class Page:
    """A figure with a row of axes, a line for the heading above and one for the legend below.

    Attributes:
        figure: all of it.
        row: the axes, from left to right.
        line: height of a line of text, relative to the figure's.
    """

    figure: Figure
    row: tuple[Axes, ...]
    line: float

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
            self.figure.legend(
                list(handles.values()), list(handles),
                loc="lower center", bbox_to_anchor=(0.5, 0.0), ncol=len(handles), frameon=False,
            )  # fmt: skip


def legend_width(labels: Iterable[str]) -> float:
    """Inches of a legend in one line."""
    return sum(text_size(label, **LEGEND)[0] + LENGTHS.key for label in labels)


# -- mechanisms ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MechanismLayout:
    """An empty picture of mechanisms.

    Attributes:
        page: the figure.
        axes: one per panel.
        size: diagonal of the mechanism, in the user's unit.
        arrow_scale: length drawn per unit of force.
        bar: axes of the colour bar, or None.
    """

    page: Page
    axes: tuple[Axes, ...]
    size: float
    arrow_scale: float
    bar: Axes | None


def arrow_ends(arrow: Arrow, scale: float) -> tuple[Reals, Reals]:
    """(2,) tail and (2,) head of ``arrow``; ``scale`` is the length per unit of force."""
    along = scale * arrow.vector
    return (arrow.at - along, arrow.at) if arrow.pushes else (arrow.at, arrow.at + along)


def lay_out(panels: Sequence[Panel], *, colour_bar: bool, heading: str, legend: Sequence[str]) -> MechanismLayout:
    """A figure in which all ``panels`` fit, all with the same limits and the same scale.

    Args:
        panels: those to be drawn.
        colour_bar: whether room is needed for it.
        heading: the line above all panels; may be empty.
        legend: the entries in the line below all panels.
    """
    points = np.concatenate([p for panel in panels for p in _extent(panel)])
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high > low).any():  # a single point
        low, high = low - 0.5, high + 0.5
    size = float(np.hypot(*(high - low)))
    strongest = max((float(np.hypot(*a.vector)) for panel in panels for a in panel.arrows), default=0.0)
    arrow_scale = LENGTHS.longest_arrow * size / strongest if strongest > 0.0 else 0.0

    widest = min(LENGTHS.panel[0], LENGTHS.row / len(panels))
    low, high, scale = _limits(panels, low, high, arrow_scale, (widest, LENGTHS.panel[1]))
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
    return MechanismLayout(page, axes, size, arrow_scale, page.row[-1] if colour_bar else None)


def _limits(
    panels: Sequence[Panel], low: Reals, high: Reals, arrow_scale: float, largest: tuple[float, float]
) -> tuple[Reals, Reals, float]:
    """Corners of the limits and inches per unit; the room for labels depends on the scale and it on the room."""
    inner_low, inner_high = low, high
    for _ in range(3):
        scale = float(min(np.array(largest) / np.maximum(high - low, 1e-6 * (high - low).max())))
        ends = [end for panel in panels for a in panel.arrows for end in _arrow_extent(a, arrow_scale, scale)]
        corners = np.array([inner_low, inner_high, *ends])
        padding = LENGTHS.padding / scale
        low, high = corners.min(axis=0) - padding, corners.max(axis=0) + padding
    return low, high, float(min(np.array(largest) / (high - low)))


def _extent(panel: Panel) -> Iterator[Reals]:
    for state in (panel.undeformed, *panel.deformed):
        yield from _state_extent(state)
    for trace in panel.traces:
        yield from (trace.points, trace.marks)
    for arrow in panel.arrows:
        yield arrow.at[None, :]


def _state_extent(state: MechanismShape) -> Iterator[Reals]:
    for flexible in state.flexible:
        yield flexible.points[np.unique(flexible.triangles)]
    for rigid in state.rigid:
        yield rigid.outline
    for pin in state.pins:
        yield pin.at + (pin.radius or 0.0) * np.array([[-1.0, -1.0], [1.0, 1.0]])


def _arrow_extent(arrow: Arrow, arrow_scale: float, scale: float) -> Iterator[Reals]:
    """Corners of ``arrow`` and of the label at its free end."""
    tail, head = arrow_ends(arrow, arrow_scale)
    yield from (tail, head)
    if arrow.label:
        room = np.array(text_size(arrow.label, **NAME)) / scale
        free, side = (tail, -arrow.vector) if arrow.pushes else (head, arrow.vector)
        side = side / (np.hypot(*side) or 1.0)
        centre = free + side * (0.5 * room + 0.1 / scale)
        yield from (centre - 0.5 * room, centre + 0.5 * room)


# -- designs ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class View:
    """A rigid motion in the plane: x ↦ R x + shift."""

    turn: Reals
    shift: Reals

    def __call__(self, points: Reals) -> Reals:
        return points @ self.turn.T + self.shift


IN_PLACE = View(np.eye(2), np.zeros(2))


@dataclass(frozen=True, eq=False)
class DesignLayout:
    """An empty picture of a design.

    Attributes:
        page: the figure.
        place: axes of the mechanism.
        place_scale: its inches per unit of length.
        details: axes of the links laid down, in the same unit; None for a single link.
        details_scale: its inches per unit of length.
        views: how each link gets there.
        captions: (2,) upper left corner of each caption in ``details``.
    """

    page: Page
    place: Axes
    place_scale: float
    details: Axes | None
    details_scale: float
    views: tuple[View, ...] = ()
    captions: tuple[Reals, ...] = ()


def lay_out_designs(
    designs: Sequence[DesignShape], *, captions: Sequence[float], heading: float, legend: float, subtitle: float
) -> DesignLayout:
    """A figure in which all ``designs`` fit.

    Args:
        designs: at least one.
        captions: width of each link's caption, in inches.
        heading: width of the line above all, in inches, or 0.
        legend: width of the line below all, in inches.
        subtitle: width of the line above the mechanism, in inches, or 0.
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
    place = page.row[0]
    place.set(xlim=centre[0] + (-0.5, 0.5) * size[:1], ylim=centre[1] + (-0.5, 0.5) * size[1:])
    place.tick_params(length=3.0)
    if rows is None:
        return DesignLayout(page, place, scale, None, scale)
    details = page.row[1]
    details.set(xlim=(0.0, rows.width / rows.scale), ylim=(0.0, tall / rows.scale))
    details.set_axis_off()
    return DesignLayout(page, place, scale, details, rows.scale, *rows.spread(tall))


class _Rows:
    """Links laid down in rows, all at the same scale, as large as the room allows.

    Attributes:
        scale: inches per unit of length.
        width, height: in inches, of all rows and the scale bar below them.
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

    def spread(self, tall: float) -> tuple[tuple[View, ...], tuple[Reals, ...]]:
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
        links = range(len(views))
        return tuple(views[link] for link in links), tuple(corners[link] for link in links)


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
