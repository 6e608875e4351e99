"""Cards of materials: every figure has its source, and describes the same material in all units."""

import pickle
import runpy
import tomllib
from dataclasses import replace
from fnmatch import fnmatch
from importlib import resources
from pathlib import Path

import pytest

import fenicsmech as fm

ROOT = Path(__file__).parents[2]
CARDS = {name: fm.material_card(name) for name in fm.material_names()}
MILLIMETRES, METRES = fm.Units(), fm.Units("m", "N", "Pa")

CARD = """
name = "Clay"
about = "a material of tests"

[sources.book]
title = "Clay"
by = "nobody"
at = "nowhere"

[figures.E]
value = 2.0
unit = "MPa"
test = "tension"
source = "book"

[figures.nu]
value = 0.3
unit = "1"
test = "tension"
source = "book"

[missing]
density = "unknown"
"""


def figure(card: str, name: str) -> fm.Figure:
    found = fm.material_card(card).figure(name)
    assert found is not None
    return found


@pytest.mark.parametrize("name", CARDS)
def test_every_figure_has_a_source_and_a_test_and_lies_in_its_range(name):
    card = CARDS[name]
    assert card.figure("E") is not None
    for each in card.figures:
        assert each.test and each.source.title and each.source.by and each.source.at
        assert each.si < 0.0 if each.name == "fatigue_exponent" else each.si > 0.0
        assert each.low is None or each.low <= each.value
        assert each.high is None or each.high >= each.value
    fatigue = ("fatigue_coefficient", "fatigue_exponent")
    for wanted in ("nu", "density", "expansion", "ultimate_stress", "ultimate_strain", *fatigue):
        assert (card.figure(wanted) is None) == (wanted in dict(card.missing)), f"{wanted} is neither given nor missing"


def test_the_materials_of_compliant_mechanisms_are_there_by_their_usual_names():
    usual = (
        ["spring steel", "aluminium", "POM", "PP", "PA", "PLA", "PETG", "TPU"],
        ["onyx", "Smooth-Sil 950", "Ecoflex", "Dragon Skin"],
    )
    assert len({fm.material_card(name).name for names in usual for name in names}) == 12


def test_no_name_stands_for_two_cards():
    names = [name.casefold() for card in CARDS.values() for name in (card.name, *card.also)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", CARDS)
def test_a_material_is_the_same_in_metres_and_millimetres(name):
    small, large = (fm.material(name, units=units, nu=0.4) for units in (MILLIMETRES, METRES))
    assert small.law.E == pytest.approx(1e-6 * large.law.E, rel=1e-14)
    if (heavy := CARDS[name].figure("density")) is None:
        assert small.density is large.density is None
    else:
        # the height at which a column of the material is pressed by its own weight as by E, in mm and in m
        heights = small.law.E / (small.density * 9810.0), large.law.E / (large.density * 9.81)
        assert heights[0] == pytest.approx(1e3 * heights[1], rel=1e-14)
        assert large.density == pytest.approx(heavy.si, rel=1e-14)
    for quantity in ("yield_stress", "ultimate_stress", "endurance_stress"):
        ours, theirs = getattr(small.strength, quantity), getattr(large.strength, quantity)
        assert ours is theirs is None or ours == pytest.approx(1e-6 * theirs, rel=1e-14)
    assert small.strength.ultimate_strain == large.strength.ultimate_strain


def test_units_of_sources_are_converted_as_defined():
    assert figure("PP", "E").si == pytest.approx(195e3 * 6894.757293, rel=1e-9)  # NIST SP 811: 1 psi in Pa
    assert figure("titanium", "density").si == pytest.approx(8.7 * 515.3788, rel=1e-6)  # slug/ft³ in kg/m³
    assert figure("POM", "yield_strain").si == pytest.approx(0.09)
    assert fm.material("POM", units=METRES).expansion == pytest.approx(1.1e-4)
    inches = fm.Units("in", "lbf", "psi")
    steel = fm.material("spring steel", units=inches)
    assert steel.law.E == pytest.approx(206e9 / 6894.757293, rel=1e-9)
    assert steel.density == pytest.approx(7850.0 / 1.0686895e7, rel=1e-6)  # lbf s²/in⁴ in kg/m³


def test_figures_tell_how_sure_they_are():
    onyx, least = figure("Onyx", "E"), figure("301", "yield_stress")
    assert (onyx.low, onyx.high) == (1.4, 3.6)
    assert (least.low, least.high) == (965.0, None)


def test_packages_hold_the_cards():
    """``importlib.resources`` finds them, and each matches a pattern of the data that wheels hold."""
    package = resources.files("fenicsmech")
    cards = [each.name for each in (package / "mechanism" / "materials").iterdir()]
    assert len(cards) == len(CARDS)
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["fenicsmech"]
    assert all(any(fnmatch(f"mechanism/materials/{card}", pattern) for pattern in patterns) for card in cards)


def test_lines_of_basquin_are_read_from_the_material():
    small, large = (fm.material("SAE 4142", units=units).strength.fatigue for units in (MILLIMETRES, METRES))
    assert small.coefficient == pytest.approx(1e-6 * large.coefficient, rel=1e-14)
    assert small.exponent == large.exponent == figure("SAE 4142", "fatigue_exponent").value
    assert fm.material("POM").strength.fatigue is None


def test_cards_agree_with_the_materials_of_the_method():
    onyx, silicone = fm.material("Onyx"), fm.material("Smooth-Sil 950")
    assert onyx == fm.ONYX and replace(silicone, density=1.24e-9) == fm.SMOOTH_SIL_950
    # to the last digit, as examples were computed with them
    assert (fm.ONYX.law, fm.ONYX.density) == (fm.NeoHookean(1770.0, 0.42), 1.2e-9)
    assert fm.SMOOTH_SIL_950.law == fm.NeoHookean(1.9, 0.475)
    with pytest.raises(fm.DescriptionError, match="ν|nu|ratio is 0.5"):
        fm.material("Onyx", nu=0.5)


def test_moduli_of_the_wire_are_those_of_an_isotropic_material():
    E, nu = figure("spring steel", "E").si, figure("spring steel", "nu").si
    assert E / (2.0 * (1.0 + nu)) == pytest.approx(81.5e9, rel=1e-3)


@pytest.mark.parametrize("name", ["Ecoflex", "Dragon Skin"])
def test_constants_of_silicones_describe_one_curve(name):
    E, C1, C2, at_100 = (figure(name, each).si for each in ("E", "yeoh_1", "yeoh_2", "stress_at_100"))
    stretch = 2.0
    slope, i = 2.0 * (stretch - stretch**-2), stretch**2 + 2.0 / stretch - 3.0  # of uniaxial tension
    assert slope * (C1 + 2.0 * C2 * i) == pytest.approx(at_100, rel=0.1)
    assert 6.0 * C1 == pytest.approx(E, rel=0.1)


@pytest.mark.parametrize("name", ["Ecoflex", "Dragon Skin"])
@pytest.mark.parametrize("units", [MILLIMETRES, METRES], ids=["mm", "m"])
def test_cards_with_constants_of_yeoh_give_that_law_when_asked_for_it(name, units):
    law = fm.material(name, units=units, law=fm.Yeoh).law
    C1, C2, at_100 = (units.stress_of(figure(name, each).si) for each in ("yeoh_1", "yeoh_2", "stress_at_100"))
    assert law == fm.Yeoh(C1, C2, 0.0, 0.49)
    assert isinstance(fm.material(name).law, fm.NeoHookean)
    (stress,) = fm.specimen_stress(law, "uniaxial", [2.0])
    assert stress == pytest.approx(at_100, rel=0.1)


def test_constants_of_higher_order_may_be_negative_and_are_zero_where_left_out(tmp_path):
    path, constant = tmp_path / "clay.toml", '[figures.{}]\nvalue = {}\nunit = "kPa"\ntest = "fit"\nsource = "book"\n\n'
    yeoh = constant.format("yeoh_1", 200.0) + constant.format("yeoh_3", -2.0)
    path.write_text(CARD.replace("[missing]", yeoh + "[missing]"))
    assert fm.material(path, law=fm.Yeoh).law.parameters == pytest.approx(
        {"C1": 0.2, "C2": 0.0, "C3": -0.002, "nu": 0.3}
    )


def test_fibres_may_shrink_when_warm_and_foams_widen_when_stretched(tmp_path):
    path, figure = tmp_path / "felt.toml", '[figures.expansion]\nvalue = -0.6\nunit = "µm/(m K)"\n'
    figure += 'test = "dilatometer"\nsource = "book"\n\n'
    card = CARD.replace("value = 0.3", "value = -0.3").replace("[missing]", figure + "[missing]")
    path.write_text(card, encoding="utf-8")
    felt = fm.material(path)
    assert (felt.law.nu, felt.expansion) == pytest.approx((-0.3, -6e-7))


def test_silicones_break_at_the_strain_that_their_maker_gives():
    assert fm.material("Ecoflex").strength.ultimate_strain == 9.0
    assert fm.material("Dragon Skin").strength.ultimate_strain == 3.64


def test_laws_that_a_card_has_no_constants_of_are_refused():
    with pytest.raises(fm.DescriptionError, match=r"'Onyx': it has no C₁ of Yeoh's law.*fit_law"):
        fm.material("Onyx", law=fm.Yeoh)
    with pytest.raises(fm.DescriptionError, match=r"'Onyx': it has no constants of Ogden. Use law=NeoHookean or"):
        fm.material("Onyx", law=fm.Ogden)


def test_fatigue_lines_bear_a_usual_share_of_the_ultimate_stress():
    lines = [strength for card in CARDS.values() if (strength := card.material(nu=0.3).strength).fatigue is not None]
    assert len(lines) >= 3
    for strength in lines:
        amplitude = strength.fatigue.coefficient * (2.0 * 1e6) ** strength.fatigue.exponent
        assert 0.25 < amplitude / strength.ultimate_stress < 0.6


def test_rubber_is_nearly_incompressible_and_a_ratio_given_counts():
    assert figure("Ecoflex", "nu").value == 0.5
    assert fm.material("Ecoflex").law.nu == 0.49
    assert fm.material("Ecoflex", nu=0.499).law.nu == 0.499


def test_materials_of_cards_are_plain_data():
    onyx = fm.material("Onyx")
    assert pickle.loads(pickle.dumps(onyx)) == onyx == fm.material("ONYX")
    assert hash(onyx) == hash(fm.material("Markforged Onyx"))
    assert replace(onyx, name="mine").strength == onyx.strength


def test_a_scene_refuses_materials_in_other_units():
    beam = fm.Mechanism("beam")
    beam.flexible("strip", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=10.0), fm.material("POM", units=METRES))
    with pytest.raises(fm.DescriptionError, match=r"link 'strip'.*'POM Hostaform C 9021' is in m, N, Pa.*mm, N, MPa"):
        fm.Scene(beam)
    assert fm.Scene(beam, units=METRES).units == METRES
    beam.flexible("rod", fm.strip([(0, 9), (60, 9)], thickness=3.0, depth=10.0), fm.ONYX)
    with pytest.raises(fm.DescriptionError, match="link 'rod'.*'Onyx' is in mm, N, MPa, the scene in m, N, Pa"):
        fm.Scene(beam, units=METRES)


def test_an_unknown_name_lists_those_known():
    with pytest.raises(fm.DescriptionError, match="'Oynx': there is no card.*Aluminium 7075-T6.*Onyx.*Material"):
        fm.material("Oynx")


def test_a_card_without_a_ratio_asks_for_it():
    with pytest.raises(fm.DescriptionError, match=r"it has no Poisson's ratio.*material\('PETG GN071-100', nu=…\)"):
        fm.material("PETG")
    assert fm.material("PETG", nu=0.4).law.nu == 0.4


@pytest.mark.parametrize(
    ("units", "problem"),
    [
        (fm.Units("furlong", "N", "MPa"), "'furlong' cannot be converted. Use one of m, cm, mm"),
        (fm.Units("mm", "N", "Pa"), "Pa is not N/mm²"),
    ],
)
def test_units_that_cannot_be_converted_are_named(units, problem):
    with pytest.raises(fm.DescriptionError, match=problem):
        fm.material("Onyx", units=units)


def test_a_card_of_ones_own(tmp_path):
    path = tmp_path / "clay.toml"
    path.write_text(CARD)
    clay = fm.material(path)
    assert (clay.name, clay.law, clay.density) == ("Clay", fm.NeoHookean(2.0, 0.3), None)
    assert fm.material(str(path)) == clay
    with pytest.raises(fm.DescriptionError, match="no such file"):
        fm.material(tmp_path / "sand.toml")


@pytest.mark.parametrize(
    ("good", "bad", "problem"),
    [
        ('source = "book"', 'source = "hearsay"', "E of card 'Clay': its source is 'hearsay'. Name one of book"),
        ('source = "book"', "", "its source is ''"),
        ('unit = "MPa"', 'unit = "bar"', "E of card 'Clay': its unit is 'bar'. Use one of Pa, kPa, MPa"),
        ("value = 2.0", 'value = "soft"', "E of card 'Clay': 'soft' is not a number"),
        ("value = 2.0", "value = -2.0", "it is -2. Give a number above zero"),
        ("value = 2.0", "value = 2.0\nlow = 3.0", "2 is outside its range, 3.0 to None"),
        ("value = 0.3", "value = 0.6", "nu of card 'Clay': it is 0.6"),
        ('test = "tension"', "", "its test is None"),
        ("figures.E", "figures.Young", "'Young' is not a figure of a card. Use one of E, nu"),
        ('at = "nowhere"', "", "source 'book' of card 'Clay': its at is None"),
        ("[missing]", "[missing]\nE = 'no'", "E is among its figures and missing"),
        ('about = "a material of tests"', "", "card 'Clay': its about is None"),
        ('name = "Clay"', "name = Clay", "it is not TOML"),
    ],
)
def test_what_is_wrong_with_a_card_is_told(tmp_path, good, bad, problem):
    path = tmp_path / "clay.toml"
    path.write_text(CARD.replace(good, bad, 1))
    with pytest.raises(fm.DescriptionError) as told:
        fm.material(path)
    assert problem in str(told.value)


@pytest.mark.parametrize(
    ("numbers", "problem"),
    [
        ({"yield_stress": -1.0}, "yield_stress of a strength: -1 is not positive"),
        ({"fatigue": 3.0}, "3.0 is not a line of Basquin"),
    ],
)
def test_strengths_are_positive(numbers, problem):
    with pytest.raises(fm.DescriptionError, match=problem):
        fm.Strength(**numbers)


@pytest.mark.parametrize("exponent", [0.1, 0.0, -1.0])
def test_lines_of_basquin_fall(exponent):
    with pytest.raises(fm.DescriptionError, match="between −1 and 0"):
        fm.Basquin(900.0, exponent)


def test_the_page_of_the_cards_is_up_to_date():
    page = runpy.run_path(str(ROOT / "docs" / "material_page.py"))["page"]()
    assert (ROOT / "docs" / "materials.md").read_text(encoding="utf-8") == page, "run python3 docs/material_page.py"
