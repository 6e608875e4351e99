"""The C² barrier β(x) = m ((x − x_max) / ε)³ beyond x_max, zero before (the paper's equation 15)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Barrier:
    """Penalises x > ``limit``; ``width`` ε and ``strength`` m control how fast it grows.

    For a lower bound, give −x the limit −x_min.
    """

    limit: float
    width: float
    strength: float = 1.0

    def value(self, x: np.ndarray) -> np.ndarray:
        """β."""
        return self.strength * self._excess(x) ** 3

    def slope(self, x: np.ndarray) -> np.ndarray:
        """dβ/dx."""
        return 3.0 * self.strength / self.width * self._excess(x) ** 2

    def curvature(self, x: np.ndarray) -> np.ndarray:
        """d²β/dx²."""
        return 6.0 * self.strength / self.width**2 * self._excess(x)

    def _excess(self, x: np.ndarray) -> np.ndarray:
        return np.maximum(np.asarray(x, dtype=float) - self.limit, 0.0) / self.width
