"""Planar linkages in closed form: every pivot is an intersection of two circles, on a side fixed once and for all.

A linkage keeps its assembly branch as long as no dyad is stretched or folded flat, that is, as long as each triangle
keeps its orientation; with the side of each intersection fixed, the positions are continuous over the turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LEFT, RIGHT = 1.0, -1.0


def circle_intersection(
    first: np.ndarray, first_radius: float, second: np.ndarray, second_radius: float, *, side: float
) -> np.ndarray:
    """Points (..., 2) at the given distances from ``first`` and ``second`` (..., 2).

    side: LEFT or RIGHT of the line from first to second. Raises ValueError where the circles do not meet.
    """
    first, second = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    line = second - first
    distance = np.linalg.norm(line, axis=-1, keepdims=True)
    along = (distance**2 + first_radius**2 - second_radius**2) / (2.0 * distance)
    across_squared = first_radius**2 - along**2
    if np.any(across_squared < 0.0):
        raise ValueError(f"circles of radius {first_radius} and {second_radius} do not meet: the loop cannot close")
    unit = line / distance
    normal = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    return first + along * unit + side * np.sqrt(across_squared) * normal


def crank_pin(shaft: Sequence[float], radius: float, angle: float | np.ndarray) -> np.ndarray:
    """End (..., 2) of a crank at ``angle`` (...) rad from x."""
    return np.asarray(shaft, dtype=float) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@dataclass(frozen=True)
class FourBar:
    """Four-bar linkage: ground pivots ``shaft`` (of the crank) and ``axle`` (of the rocker), three lengths, a side.

    side: LEFT or RIGHT, where the joint of coupler and rocker lies as seen from the crank pin towards the axle.
    """

    shaft: tuple[float, float]
    axle: tuple[float, float]
    crank: float
    coupler: float
    rocker: float
    side: float = LEFT

    def positions(self, angle: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Crank pin (..., 2) and coupler–rocker joint (..., 2) at the crank ``angle`` (...) in rad."""
        pin = crank_pin(self.shaft, self.crank, angle)
        axle = np.broadcast_to(np.asarray(self.axle, dtype=float), pin.shape)
        return pin, circle_intersection(pin, self.coupler, axle, self.rocker, side=self.side)

    def coupler_point(self, angle: float | np.ndarray, *, along: float, across: float) -> np.ndarray:
        """Point (..., 2) of the coupler, ``along`` it from the crank pin and ``across`` to its left."""
        pin, joint = self.positions(angle)
        unit = (joint - pin) / self.coupler
        normal = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
        return pin + along * unit + across * normal
