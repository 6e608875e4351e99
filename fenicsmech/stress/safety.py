"""Factors of safety: what a material bears over what its link has to bear.

    S = σ_allowable / max σ_vM,     or     S = ε_allowable / max ε₁

with the von Mises stress and the largest principal nominal strain recovered at the surface, singular places left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fenicsmech.errors import DescriptionError, point_text
from fenicsmech.mechanism import Allowable, Material
from fenicsmech.stress.surface import StressPeak


@dataclass(frozen=True)
class LinkSafety:
    """The factor of safety of a flexible link.

    Attributes:
        allowable: of its material.
        peak: the stress or strain that is compared with it; its error, place and link.
    """

    allowable: Allowable
    peak: StressPeak

    @property
    def link(self) -> str:
        """Name of the link."""
        return self.peak.link

    @property
    def place(self) -> tuple[float, ...]:
        """Point of the unloaded link where the peak is, (dim,)."""
        return self.peak.place

    @property
    def factor(self) -> float:
        """The factor, infinite where nothing is strained."""
        return self.allowable.value / self.peak.value if self.peak.value > 0.0 else math.inf

    @property
    def error(self) -> float:
        """Estimated error of the factor, from that of the peak."""
        return self.factor * self.peak.error / self.peak.value if self.peak.value > 0.0 else 0.0

    def __str__(self) -> str:
        return (
            f"{self.factor:.3g} ± {self.error:.1g} in {self.link!r} at {point_text(self.place)} "
            f"({self.allowable.name} {self.allowable.value:.4g}, reached {self.peak.value:.4g})"
        )


@dataclass(frozen=True)
class Safety:
    """The factor of safety of a mechanism, that of the link nearest to its allowable; prints as a sentence.

    Attributes:
        links: of the links whose materials have an allowable, the least first.
        unknown: names of the other flexible links.
    """

    links: tuple[LinkSafety, ...]
    unknown: tuple[str, ...]

    @property
    def least(self) -> LinkSafety:
        """That of the link nearest to its allowable."""
        return self.links[0]

    @property
    def factor(self) -> float:
        """The least factor."""
        return self.least.factor

    @property
    def error(self) -> float:
        """Its estimated error."""
        return self.least.error

    @property
    def link(self) -> str:
        """The link it belongs to."""
        return self.least.link

    @property
    def place(self) -> tuple[float, ...]:
        """Point of the unloaded link where it is least, (dim,)."""
        return self.least.place

    def __str__(self) -> str:
        unknown = f"; not known of {', '.join(self.unknown)}" if self.unknown else ""
        return f"factor of safety {self.least}{unknown}"


def allowables(materials: Mapping[str, Material]) -> dict[str, Allowable]:
    """Allowables of links by name, where there are any.

    Args:
        materials: of the flexible links, by their names.
    """
    strengths = {name: own.strength for name, own in materials.items()}
    found = {name: own.allowable for name, own in strengths.items() if own is not None}
    return {name: own for name, own in found.items() if own is not None}


def check_allowables(materials: Mapping[str, Material]) -> None:
    """Raises a DescriptionError if no material has an allowable."""
    if not allowables(materials):
        names = ", ".join(dict.fromkeys(repr(material.name) for material in materials.values()))
        raise DescriptionError(
            "factor of safety",
            f"no material of a flexible link has an allowable stress or strain ({names or 'all links are rigid'})",
            "Give Material(…, strength=Strength(yield_stress=…)), or use fm.material(…) of a card that has one",
        )


def safety_of(materials: Mapping[str, Material], peaks: Callable[[Allowable], Mapping[str, StressPeak]]) -> Safety:
    """The factor of safety at an equilibrium.

    Args:
        materials: of the flexible links, by their names.
        peaks: of stress or strain, whichever is compared with an allowable, by names of links.

    Raises:
        DescriptionError: no material has an allowable.
    """
    check_allowables(materials)
    known = allowables(materials)
    links = [LinkSafety(own, found[name]) for name, own in known.items() if name in (found := peaks(own))]
    links.sort(key=lambda link: link.factor)
    return Safety(tuple(links), tuple(name for name in materials if name not in known))
