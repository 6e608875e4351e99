"""Positions of parts: in the dimension of a model, and which of them count as one place."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fenicsmech.mechanism.mechanism import Mechanism

_SAME = 1e-9  # of the mechanism's length


def in_dimension(position: Sequence[float], dim: int) -> tuple[float, ...]:
    """``position`` with ``dim`` coordinates; a missing z is 0."""
    return (*position, 0.0)[:dim]


def mechanism_length(mechanism: Mechanism) -> float:
    """Diagonal of the box around all joints, forces and outputs; 1 if it has no size."""
    places = [in_dimension(part.at, 3) for part in (*mechanism.joints, *mechanism.forces, *mechanism.outputs)]
    sides = [max(axis) - min(axis) for axis in zip(*places, strict=True)]
    return math.hypot(*sides) or 1.0


def same_place(a: Sequence[float], b: Sequence[float], *, dim: int, length: float) -> bool:
    """Whether two positions in a mechanism of size ``length`` differ by rounding only."""
    return math.dist(in_dimension(a, dim), in_dimension(b, dim)) <= _SAME * length
