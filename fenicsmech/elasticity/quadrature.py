"""How finely integrals over cells are computed."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

from fenicsmech.errors import DescriptionError


@dataclass(frozen=True)
class Quadrature:
    """Degree of the quadrature, per order of the displacement field.

    Raises:
        DescriptionError: it is not a whole number of at least 1.
    """

    degree: int

    def __post_init__(self) -> None:
        if not isinstance(self.degree, Integral) or self.degree < 1:
            raise DescriptionError("quadrature", f"degree {self.degree!r}", "Give a whole number of at least 1")

    @staticmethod
    def for_order(order: int, dim: int) -> Quadrature:
        """The cheapest degree whose error lies well below the discretisation error (measured)."""
        return Quadrature({1: 1, 2: 3 if dim == 3 else 4}.get(order, 2 * order))
