"""How large a picture is and where its panels sit: one scale, small margins, room for the arrows' labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fenicsmech.report.canvas import new_figure
from fenicsmech.report.shapes import Arrow, MechanismShape, Panel

_LARGEST = 5.6, 5.2  # in, of one panel
_WIDEST = 13.0  # in, of all panels
_SMALLEST = 1.3  # in, of one panel
_PADDING = 0.12  # in, around the mechanism
_LEFT, _RIGHT, _BOTTOM, _TOP, _GAP = 0.62, 0.18, 0.52, 0.12, 0.16  # in
_LINE = 0.27  # in, height of a title or legend
_BAR, _BAR_ROOM = 0.14, 1.1  # in, width of the colour bar and of all it needs
_LETTER = 0.078, 0.15  # in, width and height of a letter in a label
_TITLE_LETTER, _HEADING_LETTER, _LEGEND_LETTER = 0.095, 0.104, 0.07  # in, widths
_LEGEND_KEY = 0.6  # in, line and gap of one entry
ARROW_SHARE = 0.17  # of the mechanism's diagonal, for the largest force


@dataclass(frozen=True, eq=False)
class Frame:
    """An empty figure with axes of equal scale.

    Attributes:
        figure, axes: what to draw on; one of ``axes`` per panel.
        size: diagonal of the mechanism, in the user's unit.
        arrow_scale: length drawn per unit of force.
        bar: axes of the colour bar, or None.
        line: height of a line of text, as a share of the figure.
    """

    figure: Figure
    axes: tuple[Axes, ...]
    size: float
    arrow_scale: float
    bar: Axes | None
    line: float


def arrow_ends(arrow: Arrow, scale: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(2,) tail and (2,) head of ``arrow``; ``scale`` is the length per unit of force."""
    along = scale * arrow.vector
    return (arrow.at - along, arrow.at) if arrow.pushes else (arrow.at, arrow.at + along)


def lay_out(panels: Sequence[Panel], *, colour_bar: bool, heading: str, legend: Sequence[str]) -> Frame:
    """A figure in which all ``panels`` fit, all with the same limits and the same scale.

    Args:
        panels: what will be drawn.
        colour_bar: whether room is needed for it.
        heading: the line above all panels, or nothing.
        legend: the entries in the line below all panels.
    """
    points = np.concatenate([p for panel in panels for p in _extent(panel)])
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high > low).any():  # a single point
        low, high = low - 0.5, high + 0.5
    size = float(np.hypot(*(high - low)))
    strongest = max((float(np.hypot(*a.vector)) for panel in panels for a in panel.arrows), default=0.0)
    arrow_scale = ARROW_SHARE * size / strongest if strongest > 0.0 else 0.0

    widest = min(_LARGEST[0], _WIDEST / len(panels))
    low, high, scale = _limits(panels, low, high, arrow_scale, (widest, _LARGEST[1]))
    # what is slender or small keeps its scale and gets air on both sides
    lines = _HEADING_LETTER * len(heading), sum(_LEGEND_KEY + _LEGEND_LETTER * len(entry) for entry in legend)
    least = max(_SMALLEST, max(lines) / len(panels), *(_TITLE_LETTER * len(panel.title) for panel in panels))
    lack = np.maximum(np.array([least, _SMALLEST]) / scale - (high - low), 0.0)
    low, high = low - 0.5 * lack, high + 0.5 * lack
    wide, tall = scale * (high - low)

    subtitles = any(panel.title for panel in panels)
    top = _TOP + _LINE * (bool(heading) + subtitles)
    bottom = _BOTTOM + (_LINE if legend else 0.0)
    width = _LEFT + len(panels) * wide + (len(panels) - 1) * _GAP + (_BAR_ROOM if colour_bar else _RIGHT)
    height = bottom + tall + top
    figure = new_figure(width, height)
    axes = []
    for index in range(len(panels)):
        left = _LEFT + index * (wide + _GAP)
        axes.append(figure.add_axes((left / width, bottom / height, wide / width, tall / height)))
        axes[-1].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes[-1].tick_params(labelleft=index == 0, length=3.0)
    bar = None
    if colour_bar:
        left = _LEFT + len(panels) * wide + (len(panels) - 1) * _GAP + 0.14
        bar = figure.add_axes((left / width, bottom / height, _BAR / width, tall / height))
    return Frame(figure, tuple(axes), size, arrow_scale, bar, _LINE / height)


def _limits(
    panels: Sequence[Panel],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    arrow_scale: float,
    largest: tuple[float, float],
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Corners of the limits and inches per unit; the room for labels depends on the scale and it on the room."""
    inner_low, inner_high = low, high
    for _ in range(3):
        scale = float(min(np.array(largest) / np.maximum(high - low, 1e-6 * (high - low).max())))
        ends = [end for panel in panels for a in panel.arrows for end in _arrow_extent(a, arrow_scale, scale)]
        corners = np.array([inner_low, inner_high, *ends])
        low, high = corners.min(axis=0) - _PADDING / scale, corners.max(axis=0) + _PADDING / scale
    return low, high, float(min(np.array(largest) / (high - low)))


def _extent(panel: Panel) -> Iterator[NDArray[np.float64]]:
    for state in (panel.undeformed, *panel.deformed):
        yield from _state_extent(state)
    for trace in panel.traces:
        yield from (trace.points, trace.marks)
    for arrow in panel.arrows:
        yield arrow.at[None, :]


def _state_extent(state: MechanismShape) -> Iterator[NDArray[np.float64]]:
    for flexible in state.flexible:
        yield flexible.points[np.unique(flexible.triangles)]
    for rigid in state.rigid:
        yield rigid.outline
    for pin in state.pins:
        yield pin.at + (pin.radius or 0.0) * np.array([[-1.0, -1.0], [1.0, 1.0]])


def _arrow_extent(arrow: Arrow, arrow_scale: float, scale: float) -> Iterator[NDArray[np.float64]]:
    """Corners of ``arrow`` and of the label at its free end."""
    tail, head = arrow_ends(arrow, arrow_scale)
    yield from (tail, head)
    if arrow.label:
        room = np.array([_LETTER[0] * len(arrow.label), _LETTER[1]]) / scale
        free, side = (tail, -arrow.vector) if arrow.pushes else (head, arrow.vector)
        side = side / (np.hypot(*side) or 1.0)
        centre = free + side * (0.5 * room + 0.1 / scale)
        yield from (centre - 0.5 * room, centre + 0.5 * room)
