"""Parameters of several materials from forces at displacements, from files, and with tests of specimens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm

from ..equilibrium.bistable import PLASTIC, RISE, four_bar

BAND, STRIP = fm.Material("band", 1.2, 0.4), fm.Material("strip", 60.0, 0.3)
DISPLACEMENTS = np.array([1.0, 3.0, 6.0, 9.0, 12.0])


def seesaw(band: fm.Material = BAND, strip: fm.Material = STRIP):
    """A lever on a soft band and a stiffer strip, which a motor winds up before the lever is pulled."""
    mechanism = fm.Mechanism("seesaw")
    ground, lever, horn = mechanism.rigid("ground", fixed=True), mechanism.rigid("lever"), mechanism.rigid("horn")
    right = mechanism.flexible("right", fm.strip([(30, 0), (30, 20)], thickness=4.0, depth=4.0), band)
    left = mechanism.flexible("left", fm.strip([(-20, 20), (-20, 0)], thickness=2.0, depth=4.0), strip)
    mechanism.revolute(ground, lever, at=(0, 0))
    motor = mechanism.motor(mechanism.revolute(ground, horn, at=(-24, 18)))
    for rigid, link, at in (
        (lever, right, (30, 1)),
        (ground, right, (30, 19)),
        (horn, left, (-20, 19)),
        (lever, left, (-20, 1)),
    ):
        mechanism.weld(rigid, link, at=at, region=fm.Rectangle(6, 2))
    pull = mechanism.force(on=lever, at=(30, 0), direction=(0, -1), name="pull")
    scene = fm.Scene(mechanism)
    return fm.Simulation(scene, space="plane-stress", size=4.0), pull, scene.configuration("wound", {motor: 0.1})


def pulled(band: fm.Material = BAND, strip: fm.Material = STRIP) -> np.ndarray:
    """Forces of the seesaw."""
    simulation, pull, wound = seesaw(band, strip)
    return simulation.load_displacement(pull, displacements=DISPLACEMENTS, configuration=wound).forces


def measured(forces: np.ndarray, band: fm.Material, strip: fm.Material) -> fm.Experiment:
    simulation, pull, wound = seesaw(band, strip)
    return fm.Experiment(simulation, pull, forces, DISPLACEMENTS, wound, fm.Unknown.FORCE)


def of_modulus(material: fm.Material, E: float) -> fm.Material:
    return replace(material, law=replace(material.law, E=E))


def noisy(values: np.ndarray, seed: int = 2) -> np.ndarray:
    """With errors of 1 % of the largest."""
    return values + 0.01 * np.abs(values).max() * np.random.default_rng(seed).standard_normal(len(values))


def test_moduli_of_two_materials_with_intervals_by_differences_contain_the_truth():
    band, strip = of_modulus(BAND, 1.0), of_modulus(STRIP, 45.0)
    fit = fm.fit_parameters([measured(noisy(pulled()), band, strip)], {band: ["E"], strip: ["E"]})
    for guess, truth in ((band, BAND), (strip, STRIP)):
        low, high = fit.intervals[guess]["E"]
        assert low < truth.law.E < high
    found = fit.materials[band], fit.materials[strip]
    moduli, step = np.array([own.law.E for own in found]), 1e-3

    def slope(k: int) -> np.ndarray:
        ends = []
        for sign in (1.0, -1.0):
            changed = moduli * np.where(np.arange(2) == k, 1.0 + sign * step, 1.0)
            ends.append(pulled(*map(of_modulus, found, changed)))
        return (ends[0] - ends[1]) / (2.0 * step * moduli[k])

    (curve,), (residuals,) = fit.curves, fit.residuals
    J = np.column_stack([slope(0), slope(1)])
    assert np.linalg.norm(J.T @ residuals) < 1e-5 * np.linalg.norm(J) * np.linalg.norm(residuals)
    variance = np.dot(residuals, residuals) / (len(residuals) - 2)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J)))
    assert [fit.standard_errors[own]["E"] for own in (band, strip)] == pytest.approx(errors, rel=1e-5)
    assert curve.forces == pytest.approx(pulled(*found), rel=1e-8)


@pytest.mark.thorough
def test_intervals_of_two_moduli_cover_the_truth_as_often_as_they_say(rounds=10):
    true, band, strip, covered = pulled(), of_modulus(BAND, 1.1), of_modulus(STRIP, 55.0), 0
    simulation, pull, wound = seesaw(band, strip)
    for seed in range(rounds):
        read = fm.Experiment(simulation, pull, noisy(true, seed), DISPLACEMENTS, wound, fm.Unknown.FORCE)
        intervals = fm.fit_parameters([read], {band: ["E"], strip: ["E"]}).intervals
        ends = [(own.law.E, *intervals[guess]["E"]) for own, guess in ((BAND, band), (STRIP, strip))]
        covered += all(low <= truth <= high for truth, low, high in ends)
    assert covered >= 6  # P(fewer of 10 at 90 %, the least of two intervals at 95 %) = 0.2 %


@pytest.mark.thorough
def test_three_constants_of_a_law_and_a_modulus_are_found_together():
    rubber = replace(BAND, law=fm.Yeoh(0.30, -0.02, 0.005, 0.45))
    band, strip = replace(BAND, law=fm.Yeoh(0.25, 0.0, 0.0, 0.45)), of_modulus(STRIP, 40.0)
    forces = pulled(rubber)
    fit = fm.fit_parameters([measured(forces, band, strip)], {band: ["C1", "C2", "C3"], strip: ["E"]})
    assert fit.values[band] == pytest.approx({"C1": 0.30, "C2": -0.02, "C3": 0.005}, rel=1e-4)
    assert fit.values[strip] == pytest.approx({"E": 60.0}, rel=1e-4)


def test_a_bistable_mechanism_is_fitted_through_its_snap():
    displacements, case = np.linspace(0.2, 1.8, 5) * RISE, four_bar()
    true = case.simulation.load_displacement(case.push, displacements=displacements).forces
    assert min(true) < -0.5 * max(true)
    guess = replace(PLASTIC, law=replace(PLASTIC.law, E=1200.0))
    case = four_bar(material=guess)
    through = fm.Experiment(case.simulation, case.push, noisy(true), displacements, unknown=fm.Unknown.FORCE)
    fit = fm.fit_parameters([through], {guess: ["E"]})
    low, high = fit.intervals[guess]["E"]
    assert low < PLASTIC.law.E < high < 1.05 * low
    assert fm.fit_modulus([through], guess).youngs_modulus == pytest.approx(fit.values[guess]["E"], rel=1e-6)


def test_push_and_pull_are_two_runs_from_zero():
    case = four_bar()
    displacements = np.array([-0.1, 0.2, -0.4, 1.6, 0.0]) * RISE  # beyond the snap and back
    runs = [
        case.simulation.load_displacement(case.push, displacements=own)
        for own in (displacements[[1, 3]], displacements[[0, 2]])
    ]
    forces = np.zeros(5)
    forces[[1, 3]], forces[[0, 2]] = runs[0].forces, runs[1].forces
    read = fm.Experiment(case.simulation, case.push, forces, displacements, unknown=fm.Unknown.FORCE)
    assert [[own.prescribed / RISE for own in run.controls] for run in read.requests] == [
        pytest.approx([0.0, 0.2, 1.6]),
        pytest.approx([-0.1, -0.4]),
    ]
    fit = fm.fit_modulus([read], PLASTIC)
    assert fit.youngs_modulus == pytest.approx(PLASTIC.law.E, rel=1e-6)
    assert [len(curve.frames) for curve in fit.curves] == [3, 2]
    assert fit.residuals[0] == pytest.approx(np.zeros(5), abs=1e-6 * np.abs(forces).max())


def test_readings_of_large_error_hardly_count():
    forces, errors = pulled(), np.ones(len(DISPLACEMENTS))
    forces[2], errors[2] = 2.0 * forces[2], 1e4
    guess = of_modulus(BAND, 1.0)
    simulation, pull, wound = seesaw(guess)
    read = fm.Experiment(simulation, pull, forces, DISPLACEMENTS, wound, fm.Unknown.FORCE, errors)
    assert fm.fit_parameters([read], {guess: ["E"]}).values[guess]["E"] == pytest.approx(BAND.law.E, rel=1e-4)


def test_tests_of_specimens_and_mechanisms_are_fitted_together():
    # strips that bend in plane stress do not know Poisson's ratio
    rubber, guess = (fm.Material("rubber", *own) for own in ((2.0, 0.3), (3.0, 0.2)))

    def bent(material: fm.Material):
        rig = fm.Mechanism("bench")
        ground, grip = rig.rigid("ground", fixed=True), rig.rigid("grip")
        sample = rig.flexible("sample", fm.strip([(-2, 0), (22, 0)], thickness=2.0, depth=4.0), material)
        for rigid, x in ((ground, -1), (grip, 21)):
            rig.weld(rigid, sample, at=(x, 0), region=fm.Rectangle(2, 4))
        push = rig.force(on=grip, at=(20, 0), direction=(0, 1))
        return fm.Simulation(fm.Scene(rig), space="plane-stress", size=3.0), push

    forces, stretches = [0.001, 0.002, 0.004], np.linspace(1.2, 2.4, 6)
    simulation, push = bent(rubber)
    displacements = simulation.load_displacement(push, forces=forces).displacements
    stresses = fm.specimen_stress(rubber.law, "uniaxial", stretches)
    read = fm.Experiment(*bent(guess), forces, displacements)
    pull = fm.SpecimenTest("uniaxial", stretches, stresses)
    fit = fm.fit_parameters([read], {guess: ["E", "nu"]}, tests={guess: [pull]})
    assert fit.values[guess] == pytest.approx({"E": 2.0, "nu": 0.3}, rel=1e-5)
    assert [len(own) for own in fit.residuals] == [3, 6]


def test_tests_alone_give_the_fit_of_the_law():
    stretches = np.linspace(1.1, 2.4, 8)
    stresses = noisy(fm.specimen_stress(fm.MooneyRivlin(0.3, 0.1, 0.45), "uniaxial", stretches))
    pull, guess = fm.SpecimenTest("uniaxial", stretches, stresses), fm.MooneyRivlin(0.4, 0.05, 0.45)
    rubber = fm.Material("rubber", law=guess)
    fit, law = fm.fit_parameters([], {rubber: ["C10", "C01"]}, tests={rubber: [pull]}), fm.fit_law(guess, [pull])
    assert fit.values[rubber] == pytest.approx(law.values, rel=1e-6)
    assert fit.standard_errors[rubber] == pytest.approx(law.standard_errors, rel=1e-6)


@pytest.mark.parametrize("unknown", fm.Unknown)
def test_curves_that_were_written_are_read_as_measurements(tmp_path, unknown):
    simulation, pull, wound = seesaw()
    curve = simulation.load_displacement(pull, displacements=DISPLACEMENTS[:2], configuration=wound)
    curve.write_csv(tmp_path / "curve.csv")
    read = fm.Experiment.read(simulation, pull, tmp_path / "curve.csv", configuration=wound, unknown=unknown)
    assert read.forces == pytest.approx(curve.forces, rel=1e-15)
    assert read.displacements == pytest.approx(curve.displacements, rel=1e-15)
    assert (read.configuration, read.unknown) == (wound, unknown)
    assert max(read.errors) == np.abs(read.measured).max()


def test_files_without_both_columns_are_refused(tmp_path):
    path = tmp_path / "pull.csv"
    path.write_text("time [s],Force [N],force of the machine [N],displacement [mm]\n0,1,1,1\n")
    simulation, pull, _ = seesaw()
    with pytest.raises(fm.DescriptionError, match="2 columns of force among time.*Give one column"):
        fm.Experiment.read(simulation, pull, path)


@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        ({BAND: ["C1"]}, "there is no 'C1'"),
        ({BAND: ["E", "E"]}, "the names are E, E"),
        ({BAND: []}, "the names are missing"),
        ({}, "they are {}. Give names by material"),
        ({"band": ["E"]}, "'band' is not a material"),
        ({BAND: ["E"], of_modulus(BAND, 2.0): ["E"]}, "two materials have one name"),
        ({BAND: ["E"], fm.ONYX: ["E"]}, "no link of an experiment, and no test, is of 'Onyx'"),
        ({fm.ONYX: ["E"]}, "no link of 'seesaw' is made of it"),
        ({BAND: ["E", "nu"], STRIP: ["E", "nu"]}, "3 readings for 4 parameters"),
    ],
)
def test_parameters_that_cannot_be_fitted_are_refused(parameters, problem):
    simulation, pull, _ = seesaw()
    with pytest.raises(fm.DescriptionError, match=problem):
        fm.fit_parameters([fm.Experiment(simulation, pull, [1.0, 2.0, 3.0], [1.0, 2.0, 3.0])], parameters)


def test_tests_and_errors_that_cannot_be_are_refused():
    simulation, pull, _ = seesaw()
    with pytest.raises(fm.DescriptionError, match="errors of measurements of 'seesaw': one is -1"):
        fm.Experiment(simulation, pull, [1.0, 2.0], [1.0, 2.0], errors=-1.0)
    with pytest.raises(fm.DescriptionError, match="'force' is not what is compared. Give Unknown"):
        fm.Experiment(simulation, pull, [1.0, 2.0], [1.0, 2.0], unknown="force")
    chains = fm.Material("chains", law=fm.Gent(0.2, 0.1, 0.49))
    test = fm.SpecimenTest("uniaxial", [1.2, 1.5, 2.0], [0.1, 0.2, 0.4])
    with pytest.raises(fm.DescriptionError, match="test 'uniaxial': no parameter of 'chains' is fitted"):
        fm.fit_parameters([], {BAND: ["E"]}, tests={chains: [test]})
    with pytest.raises(fm.EquilibriumError, match="the law of 'chains' has no equilibrium at stretch"):
        fm.fit_parameters([], {chains: ["mu", "Jm"]}, tests={chains: [test]})
