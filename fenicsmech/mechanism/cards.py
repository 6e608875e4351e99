"""Cards of materials: plain data, each figure with the unit, the test and the public source it was taken from.

A card is a TOML file; those of the package are in ``materials/``:

    name = "Onyx"
    also = ["markforged onyx"]              # other names; case does not matter
    about = "nylon with short carbon fibres, printed"

    [sources.sheet]
    title = "Composites Material Datasheet"
    by = "Markforged"
    date = "2019"                           # absent where the source has none
    at = "https://…"                        # or doi:…, ISBN …
    seen = "…"                              # absent where the figures were read in the source itself

    [figures.E]
    value = 1.4
    unit = "GPa"
    low = 1.4                               # how sure: the range known, or absent
    high = 3.6
    test = "tension, ASTM D638"
    source = "sheet"

    [missing]
    fatigue_exponent = "no public figure found"

Figures stay in the unit of their source and are converted to SI, then to the units of the scene. A figure without a
public source is left out, and ``missing`` tells of it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from fenicsmech.errors import DescriptionError, expect, finite
from fenicsmech.laws import Law, NeoHookean, Yeoh
from fenicsmech.mechanism.parts import Material
from fenicsmech.mechanism.strength import Basquin, Strength
from fenicsmech.mechanism.units import MILLIMETRES, PSI, Units

FOLDER = Path(__file__).parent / "materials"

POUND = 0.45359237  # kg
_STRESS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": PSI, "ksi": 1e3 * PSI, "Msi": 1e6 * PSI}
_DENSITY = {"kg/m³": 1.0, "g/cm³": 1e3, "slug/ft³": POUND * 9.80665 / 0.3048**4}
_RATIO = {"1": 1.0, "%": 0.01}
_EXPANSION = {"1/K": 1.0, "µm/(m K)": 1e-6, "µin/(in °F)": 1.8e-6}

QUANTITIES: dict[str, tuple[str, Mapping[str, float]]] = {
    "E": ("Young's modulus", _STRESS),
    "nu": ("Poisson's ratio", _RATIO),
    "density": ("density", _DENSITY),
    "expansion": ("coefficient of linear thermal expansion", _EXPANSION),
    "yield_stress": ("yield stress", _STRESS),
    "yield_strain": ("strain at yield", _RATIO),
    "ultimate_stress": ("ultimate stress", _STRESS),
    "ultimate_strain": ("strain at break", _RATIO),
    "fatigue_coefficient": ("σ_f′ of Basquin's line", _STRESS),
    "fatigue_exponent": ("b of Basquin's line", _RATIO),
    "endurance_stress": ("endurance limit, amplitude", _STRESS),
    "stress_at_100": ("stress at 100 % strain", _STRESS),
    "yeoh_1": ("C₁ of Yeoh's law, Σ Cᵢ (I₁ − 3)ⁱ", _STRESS),
    "yeoh_2": ("C₂ of Yeoh's law", _STRESS),
    "yeoh_3": ("C₃ of Yeoh's law", _STRESS),
}
"""What a card may hold: by name the words for it, and its units in SI."""

ANY_SIGN = ("yeoh_2", "yeoh_3", "expansion", "nu")
"""Figures that may be zero or below."""

INCOMPRESSIBLE = 0.49
"""Poisson's ratio of the law where a card says 0.5: volumes of real rubber change, and laws need resistance to it."""


@dataclass(frozen=True)
class Source:
    """A public source of figures.

    Attributes:
        title, by: title, and author or publisher.
        at: URL, DOI or ISBN.
        date: as the source gives it, "" if it has none.
        seen: in which other public text its figures were read; "" if in the source itself, or a copy of it.
    """

    title: str
    by: str
    at: str
    date: str = ""
    seen: str = ""


@dataclass(frozen=True)
class Figure:
    """A number of a card, in the unit of its source.

    Attributes:
        name: as among the figures of a card.
        value: in ``unit``.
        unit: as in the source.
        test: how it was measured, and on what.
        source: where it was published.
        low, high: range in ``unit``; None where nothing is known of it.
    """

    name: str
    value: float
    unit: str
    test: str
    source: Source
    low: float | None = None
    high: float | None = None

    @staticmethod
    def quantity(name: str) -> str:
        """What a figure of this name is."""
        return QUANTITIES[name][0]

    @property
    def words(self) -> str:
        """What it is."""
        return self.quantity(self.name)

    @property
    def si(self) -> float:
        """Its value in Pa, kg/m³, 1/K or without a dimension."""
        return self.value * QUANTITIES[self.name][1][self.unit]


@dataclass(frozen=True)
class MaterialCard:
    """A material as its sources describe it.

    Attributes:
        name: its name.
        also: other names.
        about: what it is.
        figures: its figures, each name once.
        missing: (name, reason) pairs of figures without a public source.
    """

    name: str
    also: tuple[str, ...]
    about: str
    figures: tuple[Figure, ...]
    missing: tuple[tuple[str, str], ...]

    def figure(self, name: str) -> Figure | None:
        """A figure by name, as ``E`` or ``yield_stress``; None if the card has none."""
        return next((figure for figure in self.figures if figure.name == name), None)

    def material(self, *, units: Units = MILLIMETRES, nu: float | None = None, law: type[Law] = NeoHookean) -> Material:
        """The material of the card; as ``material``. *Local.*"""
        expect(f"card {self.name!r}", units, Units, "a set of units", "Give units=Units(…)")
        density = self._si("density")
        return Material(
            self.name,
            law=self._law(law, units, nu),
            density=None if density is None else units.density_of(density),
            expansion=self._si("expansion"),
            strength=self._strength(units),
            units=units,
        )

    def _law(self, law: type[Law], units: Units, nu: float | None) -> Law:
        part = f"card {self.name!r}"
        if law not in (NeoHookean, Yeoh):
            problem = f"it has no constants of {getattr(law, '__name__', repr(law))}"
            raise DescriptionError(part, problem, "Use law=NeoHookean or law=Yeoh, or fit a law by fit_law")
        own = self._si("nu")
        poisson = (INCOMPRESSIBLE if own == 0.5 else own) if nu is None else nu
        if poisson is None:
            remedy = f"Give one: material({self.name!r}, nu=…); strips that bend in plane stress hardly depend on it"
            raise DescriptionError(part, self._without("nu"), remedy)
        first = "E" if law is NeoHookean else "yeoh_1"
        if (modulus := self._stress(first, units)) is None:
            remedy = "Make a Material(name, E, ν)" if first == "E" else "Use law=NeoHookean, or fit a law by fit_law"
            raise DescriptionError(part, self._without(first), remedy)
        if law is NeoHookean:
            return NeoHookean(modulus, poisson)
        return Yeoh(modulus, self._stress("yeoh_2", units) or 0.0, self._stress("yeoh_3", units) or 0.0, poisson)

    def _without(self, name: str) -> str:
        return f"it has no {Figure.quantity(name)} ({dict(self.missing).get(name, 'no public figure found')})"

    def _strength(self, units: Units) -> Strength:
        coefficient, exponent = self._stress("fatigue_coefficient", units), self._si("fatigue_exponent")
        return Strength(
            yield_stress=self._stress("yield_stress", units),
            ultimate_stress=self._stress("ultimate_stress", units),
            yield_strain=self._si("yield_strain"),
            ultimate_strain=self._si("ultimate_strain"),
            fatigue=None if coefficient is None or exponent is None else Basquin(coefficient, exponent),
            endurance_stress=self._stress("endurance_stress", units),
        )

    def _stress(self, name: str, units: Units) -> float | None:
        value = self._si(name)
        return None if value is None else units.stress_of(value)

    def _si(self, name: str) -> float | None:
        figure = self.figure(name)
        return None if figure is None else figure.si


def material(
    name: str | Path, *, units: Units = MILLIMETRES, nu: float | None = None, law: type[Law] = NeoHookean
) -> Material:
    """A material from its card: ``material("Onyx")``, ``material("Ecoflex", law=Yeoh)``. *Local.*

    Args:
        name: that of a card of the package, or the path of a TOML file of your own, as ``cards`` describes it.
        units: those of the scene; mm, N and MPa unless given.
        nu: Poisson's ratio, in place of that of the card; the law has it as it is.
        law: ``NeoHookean``, with the modulus at small strain, or ``Yeoh``, with the constants of a card that has them;
            those of higher order that it leaves out are zero.

    Returns:
        the material, with density, thermal expansion and strength as far as known.
        Poisson's ratio is 0.49 where the card says 0.5.

    Raises:
        DescriptionError: there is no such card, it is not as it should be, it has no constants of the law or no
            Poisson's ratio, or the units cannot be converted.
    """
    return material_card(name).material(units=units, nu=nu, law=law)


def material_card(name: str | Path) -> MaterialCard:
    """The card of a material, with the sources of its figures; ``name`` as for ``material``. *Local.*

    Raises:
        DescriptionError: there is no such card, or it is not as it should be.
    """
    if isinstance(name, Path) or str(name).endswith(".toml"):
        return _read(Path(name))
    cards = _cards()
    if (found := cards.get(str(name).casefold())) is None:
        remedy = f"Use one of {', '.join(material_names())}, the path of a TOML file, or a Material(name, E, ν)"
        raise DescriptionError(f"material {name!r}", "there is no card of this name", remedy)
    return found


def material_names() -> tuple[str, ...]:
    """Names of the cards of the package. *Local.*"""
    return tuple(sorted({card.name for card in _cards().values()}, key=str.casefold))


@cache
def _cards() -> Mapping[str, MaterialCard]:
    """The package's cards by all their names, in lower case."""
    cards = [_read(path) for path in sorted(FOLDER.glob("*.toml"))]
    return {name.casefold(): card for card in cards for name in (card.name, *card.also)}


def _read(path: Path) -> MaterialCard:
    part = f"card {str(path)!r}"
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DescriptionError(part, "there is no such file", "Give the path of a card") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise DescriptionError(part, f"it is not TOML: {error}", "Write it like those of the package") from None
    name = _text(part, data, "name")
    part = f"card {name!r}"
    also, missing = data.get("also", []), data.get("missing", {})
    if not isinstance(missing, dict):
        raise DescriptionError(part, f"its missing figures are {missing!r}", "Give a table [missing] of reasons")
    if not isinstance(also, list) or not all(isinstance(each, str) for each in also):
        raise DescriptionError(part, f"its other names are {also!r}", 'Give a list: also = ["…"]')
    sources = {key: _source(f"source {key!r} of {part}", each) for key, each in _tables(part, data, "sources").items()}
    figures = tuple(_figure(part, key, each, sources) for key, each in _tables(part, data, "figures").items())
    for key in missing:
        _quantity(part, key)
        if key in data["figures"]:
            raise DescriptionError(part, f"{key} is among its figures and missing", "Remove one of them")
        _text(part, missing, key)
    return MaterialCard(name, tuple(also), _text(part, data, "about"), figures, tuple(missing.items()))


def _source(part: str, data: Mapping[str, Any]) -> Source:
    optional = {key: _text(part, data, key) for key in ("date", "seen") if key in data}
    return Source(_text(part, data, "title"), _text(part, data, "by"), _text(part, data, "at"), **optional)


def _figure(part: str, name: str, data: Mapping[str, Any], sources: Mapping[str, Source]) -> Figure:
    units, own = _quantity(part, name), f"{name} of {part}"
    unit, source = _text(own, data, "unit"), str(data.get("source", ""))
    if unit not in units:
        raise DescriptionError(own, f"its unit is {unit!r}", f"Use one of {', '.join(units)}")
    if source not in sources:
        known = f"one of {', '.join(sources)}" if sources else "an entry of [sources]"
        raise DescriptionError(own, f"its source is {source!r}", f"Name {known}; leave out a figure without a source")
    value = finite(own, data.get("value"))
    low, high = (finite(f"{end} of {own}", data[end]) if end in data else None for end in ("low", "high"))
    signed = -value if name == "fatigue_exponent" else value
    if (signed <= 0.0 and name not in ANY_SIGN) or (name == "nu" and not -1.0 < value <= 0.5):
        wanted = {"fatigue_exponent": "below zero", "nu": "above −1, at most 0.5"}.get(name, "above zero")
        raise DescriptionError(own, f"it is {value:g}", f"Give a number {wanted}")
    if (low is not None and low > value) or (high is not None and high < value):
        raise DescriptionError(own, f"{value:g} is outside its range, {low} to {high}", "Correct the range")
    return Figure(name, value, unit, _text(own, data, "test"), sources[source], low, high)


def _quantity(part: str, name: str) -> Mapping[str, float]:
    """The units that the quantity may have."""
    if name not in QUANTITIES:
        raise DescriptionError(part, f"{name!r} is not a figure of a card", f"Use one of {', '.join(QUANTITIES)}")
    return QUANTITIES[name][1]


def _tables(part: str, data: Mapping[str, Any], key: str) -> Mapping[str, Mapping[str, Any]]:
    tables = data.get(key)
    if not isinstance(tables, dict) or not tables or not all(isinstance(each, dict) for each in tables.values()):
        raise DescriptionError(part, f"its {key} are {tables!r}", f"Give tables [{key}.NAME]")
    return tables


def _text(part: str, data: Mapping[str, Any], key: str) -> str:
    text = data.get(key)
    if not isinstance(text, str) or not text.strip():
        raise DescriptionError(part, f"its {key} is {text!r}", f'Give a text: {key} = "…"')
    return text


ONYX = material(FOLDER / "onyx.toml")
"""Carbon-filled nylon in mm, N and MPa, from its card; modulus fitted by the authors of the method (section VII-B)."""

SMOOTH_SIL_950 = replace(material(FOLDER / "smooth-sil-950.toml"), density=1.24e-9)
"""Platinum-cure silicone in mm, N and MPa, from its card; elastic constants used by the authors of the method.

No source of its density could be read: its card leaves it out.
"""
