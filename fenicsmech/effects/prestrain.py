"""Prestrain: a link that would be longer or shorter than drawn if nothing held it.

    E = ∫ W(F F_p⁻¹) det F_p dV,     F_p = λ I or I + (λ − 1) e ⊗ e

replaces the link's strain energy. Swelling, heat, shrinkage of a print, a tendon cast in.
"""

from __future__ import annotations

from dataclasses import dataclass

from fenicsmech.checks import direction, positive
from fenicsmech.elasticity import PLANE_STRAIN, Stretch
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Effect, FlexibleLink, in_dimension


@dataclass(frozen=True)
class Prestrain(Effect):
    """A flexible link whose strain-free state is stretched; its interfaces stay as they are.

    Attributes:
        link: the link.
        stretch: strain-free length over drawn length, λ.
        along: direction of the drawn link in which it is stretched; None: in all directions, depth included.

    Raises:
        DescriptionError: this is not a flexible link, the stretch is not positive, or the direction is none.
    """

    link: FlexibleLink
    stretch: float
    along: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.link, FlexibleLink):
            raise DescriptionError("prestrain", f"{self.link!r} is not a flexible link", "Give one")
        object.__setattr__(self, "stretch", positive(f"prestrain of {self.link.name!r}", self.stretch))
        if self.along is not None:
            object.__setattr__(self, "along", direction(f"direction of prestrain of {self.link.name!r}", self.along))

    def check(self, mechanism, dim):
        super().check(mechanism, dim)
        if dim == 2 and self.along is not None and in_dimension(self.along, 3)[2] != 0.0:
            raise DescriptionError(
                "prestrain",
                f"its direction {self.along} leaves the plane",
                "Simulate in space, or give two coordinates",
            )

    def explain(self):
        where = "in all directions" if self.along is None else f"along {self.along}"
        return f"prestrain of {self.link.name}, {self.stretch:g} times as long {where} without strain"

    def growth(self, model):
        if self.along is None and model is PLANE_STRAIN:
            raise DescriptionError(
                f"prestrain of {self.link.name!r}",
                "in all directions it would also strain the depth, which plane strain holds",
                "Give along=…, or simulate in plane stress or in space",
            )
        return {self.link: Stretch(self.stretch, self.along and in_dimension(self.along, model.dim))}
