"""Parameters of laws from tests of specimens: exact ones recovered, Treloar's rubber, intervals, remarks, refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

import fenicsmech as fm

TRELOAR = [fm.SpecimenTest.read(path.stem, path) for path in sorted((Path(__file__).parent / "treloar").glob("*.csv"))]
ONE = fm.LawFitOptions(starts=1)
# Ogden 1972 for these tests, in MPa
PUBLISHED = fm.Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.45)


def sides(kind: str, pull: float, side: float) -> np.ndarray:
    return np.array([pull, {"uniaxial": side, "planar": 1.0, "equibiaxial": pull}[kind], side])


def by_hand(law: fm.Ogden, kind: str, pull: float) -> float:
    """Nominal stress of a specimen from derivatives by hand: the free side's stress vanishes."""

    def cauchy(side: float) -> np.ndarray:
        stretches = sides(kind, pull, side)
        J = np.prod(stretches)
        s = stretches * J ** (-1.0 / 3.0)
        slopes = sum(mu * s**alpha for mu, alpha in law.terms)
        return (slopes - slopes.mean()) / J + law.E / (3.0 * (1.0 - 2.0 * law.nu)) * (J - 1.0)

    side = brentq(lambda s: cauchy(s)[2], 0.3 * pull**-2, 1.1 * max(1.0, 1.0 / pull), xtol=1e-16, rtol=1e-15)
    stretches = sides(kind, pull, side)
    return cauchy(side)[0] * np.prod(stretches) / pull


def exact(law: fm.Ogden, kind: str, stretches) -> fm.SpecimenTest:
    return fm.SpecimenTest(kind, stretches, [by_hand(law, kind, stretch) for stretch in stretches])


def incompressible(kind: str, stretches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """I₁ − 3, and the nominal stress per 2 ∂W/∂I₁."""
    other = {"uniaxial": -0.5, "planar": 0.0, "equibiaxial": 1.0}[kind]
    across = -1.0 - other
    invariant = stretches**2 + stretches ** (2.0 * other) + stretches ** (2.0 * across) - 3.0
    return invariant, stretches - stretches ** (2.0 * across - 1.0)


def test_exact_stresses_give_back_the_law():
    tests = [
        exact(PUBLISHED, "uniaxial", np.linspace(0.8, 7.0, 12)),
        exact(PUBLISHED, "planar", np.linspace(1.2, 5.0, 8)),
        exact(PUBLISHED, "equibiaxial", np.linspace(1.1, 4.5, 8)),
    ]
    for test in tests:
        stresses = fm.specimen_stress(PUBLISHED, test.kind, test.stretches)
        assert stresses == pytest.approx(test.stresses, rel=1e-9, abs=1e-11)
    fit = fm.fit_law(fm.Ogden((0.6, 0.0015, -0.012), (1.35, 4.9, -1.95), 0.45), tests, options=ONE)
    assert fit.law.parameters == pytest.approx(PUBLISHED.parameters, rel=1e-6)
    assert max(fit.relative_rms) < 1e-8


def test_further_starts_leave_a_local_minimum_at_the_guess(monkeypatch):
    wanted, starts = fm.Ogden((0.5,), (3.0,), 0.45), []
    tests = [exact(wanted, "uniaxial", np.linspace(0.8, 2.0, 8))]

    def trapped(residuals, start, *args, **options):
        found = least_squares(residuals, start, *args, **options)
        if not starts:
            found.x, found.cost = start, 0.5 * float(np.sum(residuals(start) ** 2))
        starts.append(start)
        return found

    monkeypatch.setattr("fenicsmech.design.law_fit.least_squares", trapped)
    fit = fm.fit_law(fm.Ogden((0.4,), (2.5,), 0.45), tests, held=("nu",))
    assert fit.law.parameters == pytest.approx(wanted.parameters, rel=1e-6)


def test_yeoh_on_treloar_is_the_linear_least_squares_fit():
    fit = fm.fit_law(fm.Yeoh(0.3, 0.0, 0.0, nu=0.4999999), TRELOAR)
    rows, values = [], []
    for test in TRELOAR:
        i, stress = incompressible(test.kind, test.stretches)
        largest = test.stresses.max()
        rows.append(2.0 * stress[:, None] * np.column_stack([np.ones_like(i), 2.0 * i, 3.0 * i**2]) / largest)
        values.append(test.stresses / largest)
    A, b = np.concatenate(rows), np.concatenate(values)
    expected, (squares,), *_ = np.linalg.lstsq(A, b, rcond=None)
    assert [fit.law.C1, fit.law.C2, fit.law.C3] == pytest.approx(expected, rel=1e-4)
    variance = squares / (len(b) - 3)
    assert fit.spread**2 == pytest.approx(variance, rel=1e-4)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(A.T @ A)))
    assert list(fit.standard_errors.values()) == pytest.approx(errors, rel=1e-4)


def test_fits_to_one_of_treloars_tests_are_those_of_the_literature():
    # Steinmann, Hossain & Possart (doi:10.1007/s00419-012-0610-z): μ, C₁₀ + C₀₁ and C₁₀, C₀₁, to the digits they give
    equibiaxial, planar, uniaxial = (replace(test, errors=1.0) for test in TRELOAR)
    one_term, two_terms = fm.MooneyRivlin(0.2, 0.0, 0.4999999), fm.MooneyRivlin(0.2, 0.01, 0.4999999)
    alone = {"held": ("C01", "nu"), "options": ONE}
    assert fm.fit_law(one_term, [uniaxial], **alone).law.C10 == pytest.approx(0.5 * 0.5673, abs=1e-4)
    assert fm.fit_law(one_term, [planar], **alone).law.C10 == pytest.approx(0.2348 - 0.065, abs=2e-4)
    both = fm.fit_law(two_terms, [equibiaxial], options=ONE).law
    assert (both.C10, both.C01) == pytest.approx((0.1713, 0.0047), abs=5e-5)


def test_ogden_on_treloar_is_better_than_the_published_coefficients():
    guess = fm.Ogden((0.4, 5e-6, -0.005), (1.8, 7.5, -2.2), 0.4999)
    fit = fm.fit_law(guess, TRELOAR, options=ONE)
    published = fm.Ogden((0.63, 0.0012, -0.01), (1.3, 5.0, -2.0), 0.4999)
    for test, size, residuals in zip(fit.tests, fit.relative_rms, fit.residuals, strict=True):
        stresses = fm.specimen_stress(fit.law, test.kind, test.stretches)
        assert residuals == pytest.approx(stresses - test.stresses, rel=1e-9, abs=1e-12)
        by_published = fm.specimen_stress(published, test.kind, test.stretches) - test.stresses
        assert size < np.linalg.norm(by_published) / np.linalg.norm(test.stresses)
        assert size < 0.035
    assert not any("unstable" in remark for remark in fit.remarks)


@pytest.mark.thorough
def test_intervals_cover_the_truth_as_often_as_they_say(monkeypatch, draws=60):
    monkeypatch.setattr("fenicsmech.design.law_fit._Search._remarks", lambda *_: [])  # which take most of the time
    truth, stretches = fm.MooneyRivlin(0.2, 0.02, 0.49), np.linspace(1.1, 2.5, 12)
    exact = fm.specimen_stress(truth, "uniaxial", stretches)
    generator, covered = np.random.default_rng(1), np.zeros(2)
    for _ in range(draws):
        noisy = exact + 0.01 * generator.standard_normal(len(exact))
        fit = fm.fit_law(truth, [fm.SpecimenTest("uniaxial", stretches, noisy)], options=ONE)
        covered += [low < truth.parameters[name] < high for name, (low, high) in fit.intervals.items()]
    # three standard deviations of a binomial count
    assert np.all(np.abs(covered / draws - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / draws))


def test_remarks_tell_what_the_tests_do_not_cover():
    # Yeoh's stress falls where C₂ is too low
    stretches = np.linspace(1.0, 3.0, 20)
    falling = fm.Yeoh(1.0, -0.1, 0.0, 0.49)
    test = fm.SpecimenTest("uniaxial", stretches, fm.specimen_stress(falling, "uniaxial", stretches))
    stable, tested = fm.fit_law(fm.NeoHookean(1.0, 0.49), [test], options=ONE), "beyond stretches of 1 to 3"
    assert tested in stable.remarks[0]
    assert [remark for remark in stable.remarks if "not tested" in remark] == [
        "planar: not tested",
        "equibiaxial: not tested",
    ]
    unstable = fm.fit_law(fm.Yeoh(0.5, -0.01, 0.0, 0.49), [test], held=("C3", "nu"), options=ONE)
    assert unstable.values == pytest.approx({"C1": 1.0, "C2": -0.1}, rel=1e-6)
    (remark,) = [remark for remark in unstable.remarks if remark.startswith("uniaxial") and "falls" in remark]
    peak = stretches[np.argmax(test.stresses)]
    assert float(remark.split("stretch ")[1].split()[0]) == pytest.approx(peak, abs=0.2)


def test_laws_without_a_ratio_of_poisson_hold_nothing_by_default():
    fibres = fm.TransverselyIsotropic(30.0, 2.0, 0.3, 0.3, 0.9)
    stretches = np.linspace(1.01, 1.2, 20)
    pull = fm.SpecimenTest("uniaxial", stretches, fm.specimen_stress(fibres, "uniaxial", stretches))
    others = tuple(name for name in fibres.constants if name != "E_along")
    fit = fm.fit_law(replace(fibres, E_along=20.0), pull, held=others, options=ONE)
    assert fit.values == pytest.approx({"E_along": 30.0}, rel=1e-6)
    with pytest.raises(fm.FenicsmechError) as caught:  # one test does not determine all of them
        fm.fit_law(replace(fibres, E_along=20.0), pull, options=replace(ONE, evaluations=20))
    assert "held" not in str(caught.value)
    hooke = fm.NeoHookean(2.0, 0.4)
    stresses = fm.specimen_stress(hooke, "uniaxial", stretches)
    test = fm.SpecimenTest("uniaxial", stretches, stresses)
    for held in (None, "nu", ["nu"]):
        assert fm.fit_law(fm.NeoHookean(1.0, 0.4), test, held=held, options=ONE).values == pytest.approx({"E": 2.0})


def test_a_search_that_does_not_end_is_no_fit():
    few = fm.LawFitOptions(starts=2, evaluations=1)
    with pytest.raises(fm.EquilibriumError, match="not at a minimum after 1 evaluation.*evaluations="):
        fm.fit_law(fm.Yeoh(0.9, -0.01, 0.001, 0.49), TRELOAR, options=few)


def test_tests_are_read_from_files(tmp_path):
    path = tmp_path / "pull.csv"
    path.write_text("time [s],Strain [%],Stress [MPa]\n0,0,0\n1,50,0.4\n2,100,0.7\n")
    test = fm.SpecimenTest.read("uniaxial", path)
    assert (test.name, test.stretches.tolist(), test.stresses.tolist()) == ("pull", [1.0, 1.5, 2.0], [0.0, 0.4, 0.7])
    fm.fit_law(fm.NeoHookean(1.0, 0.49), [test]).plot(tmp_path / "fit.png", stress="nominal stress [MPa]")
    assert (tmp_path / "fit.png").stat().st_size > 0
    path.write_text("force,stress\n1,1\n")
    with pytest.raises(fm.DescriptionError, match="0 columns of stretch or strain among force, stress"):
        fm.SpecimenTest.read("uniaxial", path)


def test_refused_tests_and_fits():
    pull = fm.SpecimenTest("uniaxial", [1.2, 1.5, 2.0], [0.1, 0.2, 0.4])
    with pytest.raises(fm.DescriptionError, match="there is no 'shear'"):
        fm.SpecimenTest("shear", [1.0], [1.0])
    with pytest.raises(fm.DescriptionError, match="stretches of test 'pull': one is -0.1"):
        fm.SpecimenTest("uniaxial", [-0.1, 0.2], [0.0, 1.0], name="pull")
    with pytest.raises(fm.DescriptionError, match="'mu' is held"):
        fm.fit_law(fm.Yeoh(0.2, 0.0, 0.0, 0.49), [pull], held=("mu",))
    with pytest.raises(fm.DescriptionError, match="3 readings for 3 parameters"):
        fm.fit_law(fm.Yeoh(0.2, 0.0, 0.0, 0.49), [pull])
    # two equal terms of Ogden's law
    with pytest.raises(fm.DescriptionError, match="do not determine mu0, mu1"):
        fm.fit_law(fm.Ogden((0.1, 0.1), (2.0, 2.0), 0.49), [pull], held=("alpha0", "alpha1", "nu"), options=ONE)
    # chains of Gent's law end before the tests do
    with pytest.raises(fm.EquilibriumError, match="nearer to the tests"):
        fm.fit_law(fm.Gent(0.2, 0.1, 0.49), [pull], options=ONE)
