"""Life under cycles between two equilibria.

At each point of the surface, with the stresses σ₁ and σ₂ turned back with the material, the amplitude and the mean are
those of octahedral shear and of the first invariant,

    σ_a = σ_vM((σ₂ − σ₁) / 2),     σ_m = tr (σ₁ + σ₂) / 2.

Where the stress has one direction, as at free edges, they are half the difference of the two stresses and their mean.

Source: N. E. Dowling, Mechanical Behavior of Materials, section 9.8 (Sines 1955).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenicsmech.collective import from_one
from fenicsmech.equilibrium import State
from fenicsmech.errors import DescriptionError, point_text
from fenicsmech.mechanism import FlexibleLink, Material
from fenicsmech.model import Design
from fenicsmech.stress.peak import StressRecovery
from fenicsmech.stress.recovered import von_mises
from fenicsmech.stress.surface import SurfaceStress

Links = str | FlexibleLink | Sequence[str | FlexibleLink]
"""Flexible links, or their names."""


@dataclass(frozen=True)
class LinkLife:
    """The life of a flexible link where it is shortest.

    Attributes:
        link: its name.
        cycles: to failure, infinite up to the endurance limit.
        amplitude: of the stress.
        mean: of the stress.
        reversed_amplitude: of the fully reversed stress of equal life, by Goodman.
        place: point of the unloaded link, (dim,).
    """

    link: str
    cycles: float
    amplitude: float
    mean: float
    reversed_amplitude: float
    place: tuple[float, ...]

    def __str__(self) -> str:
        return (
            f"{self.cycles:.3g} cycles in {self.link!r} at {point_text(self.place)} "
            f"(amplitude {self.amplitude:.4g} about {self.mean:.4g})"
        )


@dataclass(frozen=True)
class Life:
    """Cycles to failure of a mechanism, those of the link that fails first; prints as a sentence.

    Attributes:
        links: lives of the links, the shortest first.
        unknown: names of the flexible links that are left out, as the fatigue of their materials is not known.
    """

    links: tuple[LinkLife, ...]
    unknown: tuple[str, ...] = ()

    @property
    def least(self) -> LinkLife:
        """That of the link that fails first."""
        return self.links[0]

    @property
    def cycles(self) -> float:
        """The fewest cycles to failure."""
        return self.least.cycles

    @property
    def link(self) -> str:
        """The link that fails first."""
        return self.least.link

    @property
    def place(self) -> tuple[float, ...]:
        """Point of the unloaded link where it fails, (dim,)."""
        return self.least.place

    def __str__(self) -> str:
        unknown = f"; not known of {', '.join(self.unknown)}" if self.unknown else ""
        return f"life {self.least}{unknown}"


def life_between(
    stresses: StressRecovery, first: tuple[State, Design], second: tuple[State, Design], links: Links | None
) -> Life:
    """The life under cycles between two equilibria, see ``Frame.life``."""
    materials = dict(stresses.materials)
    names = None if links is None else _names(links, materials)
    chosen = {name: own for name, own in materials.items() if names is None or name in names}
    if names is None and (known := {name: own for name, own in chosen.items() if not _missing(own)}):
        chosen = known
    _check_data(chosen)
    unknown = tuple(name for name in materials if names is None and name not in chosen)
    one, other = stresses.surface_stress(*first), stresses.surface_stress(*second)

    def find() -> Life:
        assert one is not None and other is not None  # on the first process
        if not np.array_equal(one.nodes, other.nodes):
            raise DescriptionError("life", "the frames belong to different designs", "Take both at one design")
        numbers = {name: number for number, name in enumerate(materials) if name in chosen}
        found = [
            _life(name, own, one, other, one.links == numbers[name])
            for name, own in chosen.items()
            if (one.links == numbers[name]).any()
        ]
        return Life(tuple(sorted(found, key=lambda own: (own.cycles, -own.reversed_amplitude))), unknown)

    return from_one(stresses.comm, find)


def _life(name: str, material: Material, one: SurfaceStress, other: SurfaceStress, mask: np.ndarray) -> LinkLife:
    strength = material.strength
    assert strength is not None, "checked before"
    kept = np.flatnonzero(mask & one.kept) if (mask & one.kept).any() else np.flatnonzero(mask)
    s1, s2 = one.stress[kept], other.stress[kept]
    amplitude, mean = von_mises(0.5 * (s2 - s1)), 0.5 * np.trace(s1 + s2, axis1=-2, axis2=-1)
    worst = strength.reversed_amplitude(amplitude, mean)
    k = int(np.argmax(worst))
    cycles = float(strength.cycles(amplitude[k], mean[k]))
    if np.isnan(cycles):
        raise DescriptionError(
            f"life of {name!r}",
            f"its reversed amplitude {worst[k]:.4g} is above the endurance limit {strength.endurance_stress:.4g} of "
            f"{material.name!r}, whose line of Basquin is not known",
            "Give Strength(…, fatigue=Basquin(σ_f′, b)), or smaller loads",
        )
    place = tuple(one.points[kept[k]].tolist())
    return LinkLife(name, cycles, float(amplitude[k]), float(mean[k]), float(worst[k]), place)


def _names(links: Links, materials: Mapping[str, Material]) -> tuple[str, ...]:
    """Names of flexible links, given by themselves or by name."""
    given = (links,) if isinstance(links, str | FlexibleLink) else tuple(links)
    names = tuple(link.name if isinstance(link, FlexibleLink) else link for link in given)
    choice = f"Choose from {', '.join(materials)}"
    if not names:
        raise DescriptionError("life", "no link is named", choice)
    for name in names:
        if name not in materials:
            raise DescriptionError("life", f"{name!r} is not a flexible link", choice)
    return names


def _missing(material: Material) -> str:
    """What the life of a material needs and is not known; empty if nothing."""
    return "strength" if material.strength is None else material.strength.missing_for_life


def _check_data(materials: Mapping[str, Material]) -> None:
    """Raises a DescriptionError unless all data are known, naming the material."""
    for name, material in materials.items():
        if missing := _missing(material):
            remedy = "Give Strength(ultimate_stress=…, fatigue=Basquin(σ_f′, b)), or name other links with links=[…]"
            raise DescriptionError(f"life of {name!r}", f"material {material.name!r} has no {missing}", remedy)
