"""Loads: forces of given direction at material points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.multibody import MaterialPoint


@dataclass(frozen=True)
class PointLoad:
    """A dead force along ``direction``, of as many coordinates as u(point): work f · direction · u(point)."""

    name: str
    point: MaterialPoint
    direction: np.ndarray
