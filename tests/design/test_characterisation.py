"""Young's modulus from measurements: exact for exact data, with the interval of a fitted parameter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import Experiment, fit_modulus
from fenicsmech.errors import DescriptionError

TRUE = fm.Material("nylon", 1500.0, 0.4)
GUESS = replace(TRUE, law=replace(TRUE.law, E=600.0))
FORCES = (0.1, 0.3, 0.5, 0.7)


def bench(material: fm.Material, thickness: float = 1.0, samples: int = 1):
    """A cantilever, or two in parallel under one grip, and the force across."""
    rig = fm.Mechanism("bench")
    ground, grip = rig.rigid("ground", fixed=True), rig.rigid("grip")
    for k in range(samples):
        y = 10.0 * k
        sample = rig.flexible(f"sample {k}", fm.strip([(-2, y), (32, y)], thickness=thickness, depth=4.0), material)
        rig.weld(ground, sample, at=(-1, y), region=fm.Rectangle(2, 2 * thickness))
        rig.weld(sample, grip, at=(31, y), region=fm.Rectangle(2, 2 * thickness))
    push = rig.force(on=grip, at=(30, 0), direction=(0, 1))
    return fm.Simulation(fm.Scene(rig), space="plane-stress", size=2.0), push


def exact(thickness: float = 1.0, samples: int = 1) -> np.ndarray:
    simulation, push = bench(TRUE, thickness, samples)
    return simulation.load_displacement(push, forces=FORCES).displacements


def experiment(displacements, thickness: float = 1.0, samples: int = 1) -> Experiment:
    simulation, push = bench(GUESS, thickness, samples)
    return Experiment(simulation, push, FORCES, displacements)


@pytest.mark.thorough
def test_modulus_of_exact_data_is_found_again():
    fit = fit_modulus([experiment(exact()), experiment(exact(2.0), 2.0)], GUESS)
    assert fit.youngs_modulus == pytest.approx(1500.0, rel=1e-6)
    assert fit.spread < 1e-6
    assert fit.curves[0].displacements == pytest.approx(exact(), rel=1e-6)


def test_measurements_of_something_else_are_refused():
    simulation, _ = bench(GUESS)
    for given, problem in (((simulation, "push"), "'push' is not a force"), ((3, None), "3 is not a simulation")):
        with pytest.raises(DescriptionError, match=problem):
            Experiment(*given, FORCES, FORCES)


def test_a_fit_leaves_simulations_and_their_curves_as_they_are():
    simulation, push = bench(GUESS)
    before = simulation.load_displacement(push, forces=FORCES)
    fit = fit_modulus([Experiment(simulation, push, FORCES, exact())], GUESS)
    assert simulation.load_displacement(push, forces=FORCES).displacements == pytest.approx(
        before.displacements, rel=1e-12
    )
    (soft, soft_push), (stiff, stiff_push) = bench(GUESS), bench(fit.material)
    wanted = soft.load_displacement(soft_push, forces=FORCES).error_estimates()
    assert before.error_estimates() == pytest.approx(wanted, rel=1e-8)
    wanted = stiff.load_displacement(stiff_push, forces=FORCES).error_estimates()
    assert fit.curves[0].error_estimates() == pytest.approx(wanted, rel=1e-4)


def test_a_simulation_continues_with_the_fitted_material():
    simulation, push = bench(GUESS)
    fit = fit_modulus([Experiment(simulation, push, FORCES, exact())], GUESS)
    fitted = simulation.with_material(GUESS, fit.material)
    assert fitted.load_displacement(push, forces=FORCES).displacements == pytest.approx(exact(), rel=1e-6)


@pytest.mark.thorough
def test_all_links_of_the_material_change_together():
    fit = fit_modulus([experiment(exact(samples=2), samples=2)], GUESS)
    assert fit.youngs_modulus == pytest.approx(1500.0, rel=1e-6)


@pytest.mark.thorough
def test_interval_shrinks_with_the_noise():
    pattern = np.array([1.0, -1.0, 1.0, -1.0])
    widths = []
    for noise in (0.02, 0.01):
        low, high = fit_modulus([experiment(exact() + noise * pattern)], GUESS).interval
        widths.append(high - low)
    assert widths[0] == pytest.approx(2.0 * widths[1], rel=0.02)


@pytest.mark.parametrize(
    ("forces", "displacements", "message"),
    [
        ((1.0, 2.0), (1.0,), "2 forces for 1 displacement"),
        ((1.0, float("nan")), (1.0, 2.0), "nan"),
        ((0.0, 0.0), (0.0, 1.0), "no force moves anything"),
    ],
)
def test_invalid_measurements_are_refused(forces, displacements, message):
    simulation, push = bench(GUESS)
    with pytest.raises(DescriptionError, match=message):
        Experiment(simulation, push, forces, displacements)


def test_specimens_of_another_design_are_refused():
    simulation, push = bench(GUESS)
    changed = simulation.with_design(np.zeros_like(simulation.model.elastic.shape.x.array))
    with pytest.raises(DescriptionError, match="another design than the drawn one"):
        Experiment(changed, push, (1.0,), (1.0,))


def test_a_material_that_no_sample_is_made_of_is_refused():
    with pytest.raises(DescriptionError, match="no link of 'bench' is made of it"):
        fit_modulus([experiment(exact())], fm.ONYX)


def test_measurements_against_the_force_have_no_modulus():
    with pytest.raises(fm.EquilibriumError, match="modulus of 'nylon'.*still changes"):
        fit_modulus([experiment(-exact())], GUESS)


def test_the_error_of_a_modulus_counts_from_a_configuration_that_it_strains_too():
    rig = fm.Mechanism("clamped between")
    ground, hub, hand = rig.rigid("ground", fixed=True), rig.rigid("hub"), rig.rigid("hand")
    motor = rig.motor(rig.revolute(ground, hub, at=(0, 0)))
    specimen = rig.flexible("specimen", fm.strip([(0, 0), (30, 0)], thickness=2.0, depth=4.0), GUESS)
    brace = rig.flexible("brace", fm.strip([(30, 0), (60, 0)], thickness=2.0, depth=4.0), fm.ONYX)
    for rigid, link, x in ((hub, specimen, 1), (hand, specimen, 29), (hand, brace, 31), (ground, brace, 59)):
        rig.weld(rigid, link, at=(x, 0), region=fm.Rectangle(2, 4))
    push = rig.force(on=hand, at=(30, 0), direction=(0, 1))
    scene = fm.Scene(rig)
    turned = scene.configuration("turned", {motor: 0.2})
    sim = fm.Simulation(scene, space="plane-stress", size=3.0)

    def travel(modulus: float) -> np.ndarray:
        other = sim.with_material(GUESS, replace(GUESS, law=replace(GUESS.law, E=modulus)))
        return other.load_displacement(push, forces=FORCES, configuration=turned).displacements

    true = travel(1500.0)
    noisy = true + 0.01 * true.max() * np.array([1.0, -1.0, 1.0, -1.0])
    fit = fit_modulus([Experiment(sim, push, FORCES, noisy, configuration=turned)], GUESS)
    step = 1e-3
    slope = (travel(fit.youngs_modulus * (1.0 + step)) - travel(fit.youngs_modulus * (1.0 - step))) / (2.0 * step)
    wanted = fit.spread / np.linalg.norm(slope / np.abs(noisy).max())
    assert fit.standard_error / fit.youngs_modulus == pytest.approx(wanted, rel=1e-4)


@pytest.mark.thorough
@pytest.mark.parallel
def test_parameters_are_found_together():
    # pulled with free and with held sides: E and E / (1 − ν²) at small strain
    def rig(material: fm.Material, space: str):
        mechanism = fm.Mechanism("pull")
        ground, grip = mechanism.rigid("ground", fixed=True), mechanism.rigid("grip")
        sample = mechanism.flexible("sample", fm.strip([(-2, 0), (22, 0)], thickness=4.0, depth=4.0), material)
        mechanism.weld(ground, sample, at=(-1, 0), region=fm.Rectangle(2, 6))
        mechanism.weld(sample, grip, at=(21, 0), region=fm.Rectangle(2, 6))
        pull = mechanism.force(on=grip, at=(20, 0), direction=(1, 0))
        return fm.Simulation(fm.Scene(mechanism), space=space, size=4.0), pull

    forces, experiments, guess = (200.0, 800.0), [], replace(GUESS, law=fm.NeoHookean(1200.0, 0.3))
    for space in ("plane-stress", "plane-strain"):
        simulation, pull = rig(TRUE, space)
        measured = simulation.load_displacement(pull, forces=forces).displacements
        simulation, pull = rig(guess, space)
        experiments.append(Experiment(simulation, pull, forces, measured))
    fit = fm.fit_parameters(experiments, {guess: ["E", "nu"]})
    assert fit.values[guess] == pytest.approx({"E": 1500.0, "nu": 0.4}, rel=1e-5)
    assert fit.curves[0].displacements == pytest.approx(experiments[0].displacements, rel=1e-6)


def test_a_parameter_alone_has_the_interval_of_the_modulus():
    bent = [experiment(exact() * [1.0, 1.01, 0.99, 1.0])]
    alone, modulus = fm.fit_parameters(bent, {GUESS: ["E"]}), fit_modulus(bent, GUESS)
    assert alone.values[GUESS]["E"] == pytest.approx(modulus.youngs_modulus, rel=1e-5)
    assert alone.standard_errors[GUESS]["E"] == pytest.approx(modulus.standard_error, rel=1e-4)
    E = alone.values[GUESS]["E"]
    reach = np.array(alone.intervals[GUESS]["E"]) / E - 1.0  # of ln E where the modulus alone is fitted
    assert modulus.interval == pytest.approx(E * np.exp(reach), rel=1e-5)
    assert alone.materials[GUESS].law.E == alone.values[GUESS]["E"]
