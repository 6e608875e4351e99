"""Links whose strain-free state is not the one drawn: F = F_e F_p, and only F_e strains the material.

    F_p = I + s (λ − 1) N,     N = e ⊗ e or I,
    H_e = F_e − I = H + Γ + H Γ,     Γ = F_p⁻¹ − I = −s (λ − 1) / (1 + s (λ − 1)) N,

and W counts per strain-free volume, which is det F_p times the drawn one: (1 + s (λ − 1)) to the power of 1 or 3. s is
the share that acts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem


@dataclass(frozen=True)
class Stretch:
    """How much longer a link is without strain than drawn.

    Attributes:
        ratio: λ.
        along: e, a unit vector of the drawn link, (dim,); None for all directions.
    """

    ratio: float
    along: tuple[float, ...] | None


UNSTRETCHED = Stretch(1.0, None)


class Growth:
    """F_p as a field with one value per cell.

    Args:
        stretches: of each link.
        cellwise: makes a field with one value per cell from one value per link, (links,).
        free: whether each local cell can deform; the others do not grow, (cells,).
        dim: of the model; planar ones are free to grow in depth.
        share: s, as a constant.
    """

    def __init__(
        self,
        stretches: Sequence[Stretch],
        cellwise: Callable[[Sequence[float]], fem.Function],
        *,
        free: np.ndarray,
        dim: int,
        share: fem.Constant,
    ) -> None:
        self.share = ufl.variable(share)
        self._excess = cellwise([stretch.ratio - 1.0 for stretch in stretches])
        self._excess.x.array[np.flatnonzero(~free)] = 0.0
        self._power = cellwise([3.0 if stretch.along is None else 1.0 for stretch in stretches])
        tensors = np.array([np.eye(dim) if s.along is None else np.outer(s.along, s.along) for s in stretches])
        parts = {(i, j): cellwise(tensors[:, i, j]) for i in range(dim) for j in range(i, dim)}
        self._tensor = ufl.as_matrix([[parts[min(i, j), max(i, j)] for j in range(dim)] for i in range(dim)])

    def elastic(self, H):
        """H_e in UFL."""
        grown = self.share * self._excess
        inverse = -grown / (1 + grown) * self._tensor
        return H + inverse + ufl.dot(H, inverse)

    @property
    def volume(self):
        """det F_p in UFL, the growth of depth included."""
        return (1 + self.share * self._excess) ** self._power
