"""The page of the material cards, docs/materials.md.

    python3 docs/material_page.py        from the project's root

``tests/mechanism/test_cards.py`` compares the page with the cards.
"""

from collections.abc import Iterator
from pathlib import Path

import fenicsmech as fm

PAGE = Path(__file__).with_name("materials.md")

HEAD = """# Materials

Cards of materials are plain data, TOML files in `fenicsmech/mechanism/materials`, and `fm.material("Onyx")` is a
material of one. `python3 docs/material_page.py` writes this page from them. Every figure has a public source; a figure
without one is left out. Figures are those of the specimens of their tests, and nobody guarantees them: the range tells
how far sources, specimens or directions differ. Moduli of plastics and silicones fall with temperature, moisture and
time under load, which cards leave out.

Laws are neo-Hookean with the modulus at small strain; `fm.material("Ecoflex", law=fm.Yeoh)` has the constants of Yeoh's
law, for large strain, of a card that gives them. Poisson's ratio is 0.49 where a card says 0.5; a card without one asks
for it: `fm.material("PETG", nu=…)`. Strengths are data of the material, `fm.Strength`; stresses and strains are
nominal.
"""

SUMMARY = ("E", "nu", "density", "yield_stress", "ultimate_stress", "ultimate_strain")
MEGA = {"Pa", "kPa", "MPa", "GPa", "psi", "ksi", "Msi"}


def rows(lines: list[tuple[str, ...]]) -> str:
    head, *body = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in [head, ["---"] * len(head), *body])


def number(figure: fm.Figure | None) -> str:
    """In MPa, kg/m³ or without a dimension."""
    if figure is None:
        return "–"
    value = figure.si / (1e6 if figure.unit in MEGA else 1.0)
    return f"{value:.0f}" if value >= 1000 else f"{value:.4g}"


def extent(figure: fm.Figure) -> str:
    if figure.low is None and figure.high is None:
        return "not told"
    if figure.high is None:
        return f"at least {figure.low:g}"
    return f"{figure.low:g} to {figure.high:g}"


def summary(cards: list[fm.MaterialCard]) -> str:
    head = ("card", "E, MPa", "ν", "density, kg/m³", "yield, MPa", "ultimate, MPa", "strain at break")
    body = [(f"[{c.name}](#{anchor(c.name)})", *(number(c.figure(name)) for name in SUMMARY)) for c in cards]
    return rows([head, *body])


def anchor(name: str) -> str:
    kept = "".join(letter for letter in name.lower() if letter.isalnum() or letter in " -_")
    return kept.replace(" ", "-")


def section(card: fm.MaterialCard) -> Iterator[str]:
    yield f"## {card.name}\n"
    names = f" Also {', '.join(f'`{name}`' for name in card.also)}." if card.also else ""
    yield f"{card.about[0].upper()}{card.about[1:]}.{names}\n"
    sources = list(dict.fromkeys(figure.source for figure in card.figures))
    lines = [("figure", "value", "range", "test", "source")]
    for f in card.figures:
        unit = "" if f.unit == "1" else f" {f.unit}"
        lines.append((f.words, f"{f.value:g}{unit}", extent(f), f.test, str(sources.index(f.source) + 1)))
    yield rows(lines) + "\n"
    for count, source in enumerate(sources, 1):
        place = f"<{source.at}>" if source.at.startswith("http") else source.at
        date = f", {source.date}" if source.date else ""
        seen = f"; read in {source.seen}" if source.seen else ""
        yield f"{count}. {source.by}: {source.title}{date}. {place}{seen}"
    yield ""
    if card.missing:
        reasons: dict[str, list[str]] = {}
        for name, reason in card.missing:
            reasons.setdefault(reason, []).append(fm.Figure.quantity(name))
        told = "; ".join(f"{', '.join(names)}: {reason}" for reason, names in reasons.items())
        yield f"Left out – {told}.\n"


def page() -> str:
    cards = [fm.material_card(name) for name in fm.material_names()]
    parts = [HEAD, summary(cards), ""]
    for card in cards:
        parts += section(card)
    return "\n".join(parts).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
