"""Prestrain: links whose strain-free state is a stretch of the drawn one.

    E = ∫ W(F F_p⁻¹) det F_p dV,     F_p = λ I or I + (λ − 1) e ⊗ e

replaces the link's strain energy. Models swelling, shrinkage of prints, embedded tendons.
"""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.elasticity import Stretch
from fenicsmech.errors import direction, expect, in_plane, positive, set_fields
from fenicsmech.mechanism import Effect, FlexibleLink, in_dimension


@dataclass(frozen=True)
class Prestrain(Effect):
    """A flexible link whose strain-free state is stretched; its interfaces stay as they are.

    In plane strain the depth may not follow a stretch in all directions, which stresses the link.

    Attributes:
        link: the link.
        stretch: strain-free length over drawn length, λ.
        along: direction of the drawn link in which it is stretched; None: in all directions, depth included.

    Raises:
        DescriptionError: this is not a flexible link, the stretch is not positive, or the direction is zero.
    """

    link: FlexibleLink
    stretch: float
    along: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        expect("prestrain", self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        set_fields(self, stretch=positive(f"prestrain of {self.link.name!r}", self.stretch))
        if self.along is not None:
            set_fields(self, along=direction(f"direction of prestrain of {self.link.name!r}", self.along))

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        in_plane("direction of prestrain", self.along or (), dim)

    def explain(self):
        where = "in all directions" if self.along is None else f"along {self.along}"
        return f"prestrain of {self.link.name}, {self.stretch:g} times as long {where} without strain"

    def growth(self, model, links):
        return {self.link: Stretch(self.stretch, self.along and in_dimension(self.along, model.dim))}
