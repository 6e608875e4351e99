"""How thick a link typically is in the plane, as far as its description tells."""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Arc, Outline, Shape, Strip


@singledispatch
def typical_thickness(shape: Shape, part: str) -> float:
    """The thickness of a strip, or of the strip with the area and the perimeter of an outline.

    Args:
        shape: of the link.
        part: its name, for messages.

    Raises:
        DescriptionError: the shape is known from a file only.
    """
    raise DescriptionError(part, "its thickness is not known, as it comes from a file", "Give size=… for it")


@typical_thickness.register
def _(shape: Strip, part: str) -> float:
    return shape.thickness


@typical_thickness.register
def _(shape: Outline, part: str) -> float:
    # t = 2 A / P for long strips; arcs count as the two chords that they are given by
    corners = [shape.start]
    for segment in shape.segments:
        corners += [segment.via, segment.end] if isinstance(segment, Arc) else [segment.end]
    x, y = np.array(corners).T
    area = 0.5 * abs(x @ np.roll(y, -1) - np.roll(x, -1) @ y)
    perimeter = np.hypot(np.roll(x, -1) - x, np.roll(y, -1) - y).sum()
    return float(2.0 * area / perimeter)
