"""Stability of the laws of flexible links at an equilibrium, see ``laws.stability``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.errors import point_text
from fenicsmech.laws import drucker_stability
from fenicsmech.mechanism import FlexibleLink, Material


@dataclass(frozen=True)
class LawStability:
    """Drucker's stability of the law of a link where it is least; prints as a sentence.

    Attributes:
        value: least eigenvalue of the stiffness against further strain, over that of the undeformed material: 1 at
            rest, not above zero where the law is unstable.
        link: name of the link.
        law: name of its law.
        place: point of the unloaded link where it is least, (dim,).
    """

    value: float
    link: str
    law: str
    place: tuple[float, ...]

    @property
    def stable(self) -> bool:
        """Whether every further strain takes more stress."""
        return self.value > 0.0

    def __str__(self) -> str:
        text = (
            f"{self.law} of {self.link!r} has a stability of {self.value:.2g} (1 at rest) at {point_text(self.place)}"
        )
        if self.stable:
            return text
        remedy = "fit a law to tests that cover these strains (fm.fit_law), or keep strains smaller"
        return f"{text}: further strain takes less stress, and a real material would not follow; {remedy}"


def least_stable(
    links: Sequence[FlexibleLink],
    materials: Sequence[Material],
    link_of_cell: np.ndarray,
    places: np.ndarray,
    gradients: np.ndarray,
) -> tuple[LawStability, ...]:
    """The least stability of each link that deforms.

    Args:
        links, materials: of the mechanism.
        link_of_cell: (cells,).
        places: of samples in the unloaded links, (cells, q, dim).
        gradients: elastic part of F there, (cells, q, 3, 3), zero in cells that cannot deform.
    """
    found, deforms = [], np.any(gradients != 0.0, axis=(1, 2, 3))
    for k, (link, material) in enumerate(zip(links, materials, strict=True)):
        cells = np.flatnonzero((link_of_cell == k) & deforms)
        if len(cells):
            values = drucker_stability(material.law, gradients[cells].reshape(-1, 3, 3))
            least = int(np.argmin(values))
            place = tuple(places[cells].reshape(-1, places.shape[-1])[least].tolist())
            found.append(LawStability(float(values[least]), link.name, type(material.law).__name__, place))
    return tuple(found)
