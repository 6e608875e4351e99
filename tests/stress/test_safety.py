"""Factors of safety, safe ranges and lives against figures computed by hand."""

import math

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

LENGTH, BASQUIN = 20.0, fm.Basquin(900.0, -0.1)
STRENGTH = fm.Strength(yield_stress=20.0, ultimate_stress=400.0, fatigue=BASQUIN)


def beam(
    strength: fm.Strength | None = STRENGTH, *, modulus: float = 1e5, second: fm.Material | None = None
) -> tuple[fm.Simulation, fm.mechanism.Force, fm.mechanism.Force]:
    """A bar of section 1 x 1, clamped at x = 0, with forces across and along it at its end; a second one, if given,
    continues it, as long again and twice as thick."""
    mechanism = fm.Mechanism("beam")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    clamp = fm.Rectangle(1.0, 3.0)

    def link(name, start, end, thickness, material):
        return mechanism.flexible(name, fm.strip([(start, 0), (end, 0)], thickness=thickness, depth=1.0), material)

    bar = link("bar", -1, LENGTH + 1, 1.0, fm.Material("plastic", modulus, 0.3, strength=strength))
    mechanism.weld(base, bar, at=(-0.5, 0), region=clamp)
    mechanism.weld(bar, hand, at=(LENGTH + 0.5, 0), region=clamp)
    end = LENGTH
    if second is not None:
        other, end = link("other", LENGTH, 2 * LENGTH + 2, 2.0, second), 2 * LENGTH + 1
        hand_2 = mechanism.rigid("hand 2")
        mechanism.weld(hand, other, at=(LENGTH + 0.5, 0), region=clamp)
        mechanism.weld(other, hand_2, at=(end + 0.5, 0), region=clamp)
        hand = hand_2
    across = mechanism.force(on=hand, at=(end, 0), direction=(0, 1), name="across")
    along = mechanism.force(on=hand, at=(end, 0), direction=(1, 0), name="along")
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, comm=MPI.COMM_SELF), across, along


def last(simulation: fm.Simulation, force: fm.mechanism.Force, value: float) -> fm.Frame:
    return simulation.load_displacement(force, forces=[value]).frames[-1]


def test_safety_of_a_cantilever_is_that_of_beam_theory():
    simulation, across, _ = beam()
    safety = last(simulation, across, 0.01).safety
    # σ b h² / 6 F (L − x)
    assert safety.factor == pytest.approx(20.0 / (6.0 * 0.01 * (LENGTH - safety.place[0])), rel=0.01)
    assert (safety.link, safety.unknown, safety.least.allowable.name) == ("bar", (), "yield stress")
    assert 0.0 < safety.error < 0.05 * safety.factor
    assert "yield stress 20" in str(safety)


def test_safety_of_links_of_different_materials():
    for strength, least in ((fm.Strength(yield_stress=3.0), "other"), (None, "bar")):
        simulation, _, along = beam(second=fm.Material("soft", 1e5, 0.3, strength=strength))
        frame = last(simulation, along, 5.0)
        # F / b h of each link, away from its clamps, where contraction is held
        peaks = frame.peaks
        assert peaks["bar"].value == pytest.approx(2.0 * peaks["other"].value, rel=0.1)
        assert frame.safety.link == least
        assert frame.safety.unknown == (() if strength else ("other",))
        bar = next(link for link in frame.safety.links if link.link == "bar")
        assert bar.factor == pytest.approx(20.0 / peaks["bar"].value, rel=1e-12)
        assert frame.peak.value == max(peak.value for peak in peaks.values())


def test_strain_is_compared_with_a_strain():
    simulation, across, _ = beam(fm.Strength(ultimate_strain=0.01))
    frame = last(simulation, across, 0.01)
    least = frame.safety.least
    # at a free edge ε₁ = σ / E on the side in tension
    assert least.peak.value == pytest.approx(6.0 * 0.01 * (LENGTH - least.place[0]) / 1e5, rel=0.01)
    assert least.factor == pytest.approx(0.01 / least.peak.value, rel=1e-12)
    assert least.peak == frame.strain_peak == frame.strain_peaks["bar"]
    assert least.error == pytest.approx(least.factor * frame.strain_peak.error / frame.strain_peak.value, rel=1e-12)
    assert f"ultimate strain 0.01, reached {frame.strain_peak.value:.4g}" in str(frame.safety)


def test_cycles_by_hand():
    strength = fm.Strength(ultimate_stress=400.0, fatigue=BASQUIN, endurance_stress=100.0)
    # σ_a / (1 − σ_m / σ_u) = 150 / (1 − 100 / 400) = 200,     N = ½ (200 / 900)^(−10)
    assert strength.cycles(150.0, 100.0) == pytest.approx(0.5 * (200.0 / 900.0) ** -10, rel=1e-12)
    assert strength.cycles(75.0, 100.0) == math.inf
    assert strength.cycles(150.0, -100.0) == strength.cycles(150.0, 0.0)
    assert strength.cycles(1.0, 400.0) == 0.0


def test_life_of_a_bar_between_two_forces():
    simulation, across, _ = beam()
    low, high = (last(simulation, across, force) for force in (0.2, 0.6))
    life = low.life(high)
    # σ = 6 F (L − x) / b h², in tension below, in compression above
    per_force = 6.0 * (LENGTH - life.place[0])
    amplitude, mean = 0.2 * per_force, 0.4 * per_force
    assert life.place[1] == pytest.approx(-0.5, rel=1e-9)
    assert life.least.amplitude == pytest.approx(amplitude, rel=0.02)
    assert life.least.mean == pytest.approx(mean, rel=0.02)
    assert life.cycles == pytest.approx(float(STRENGTH.cycles(life.least.amplitude, life.least.mean)), rel=1e-12)
    assert high.life(low).cycles == pytest.approx(life.cycles, rel=1e-9)
    assert low.life(low).cycles == math.inf


def test_lives_leave_out_links_whose_fatigue_is_not_known():
    simulation, _, along = beam(second=fm.Material("soft", 1e5, 0.3))
    bar, other = simulation.scene.mechanism.flexible_links
    low, high = simulation.load_displacement(along, forces=[1.0, 5.0]).frames
    life = low.life(high)
    assert (life.link, life.unknown) == ("bar", ("other",)) and str(life).endswith("; not known of other")
    for links in (bar, [bar], "bar", ["bar"]):
        assert low.life(high, links=links).links == life.links
    for links, problem in (([], "no link is named"), ([3], "3 is not a flexible"), (other, "'soft' has no strength")):
        with pytest.raises(fm.DescriptionError, match=problem):
            low.life(high, links=links)


def test_turning_as_a_rigid_body_is_no_cycle():
    mechanism = fm.Mechanism("pendulum")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    shape = fm.strip([(-1, 0), (11, 0)], thickness=1.0, depth=1.0)
    bar = mechanism.flexible("bar", shape, fm.Material("plastic", 1e4, 0.3, strength=STRENGTH))
    crank = mechanism.rigid("crank")
    motor = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    mechanism.weld(crank, bar, at=(-0.5, 0), region=fm.Rectangle(1.0, 3.0))
    mechanism.weld(bar, hand, at=(10.5, 0), region=fm.Rectangle(1.0, 3.0))
    scene = fm.Scene(mechanism)
    pull = [mechanism.force(on=hand, at=(10, 0), direction=(x, y), name=f"{x}") for x, y in ((1, 0), (0, 1))]
    simulation = fm.Simulation(scene, space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    turned = scene.configuration("turned", {motor: 0.5 * np.pi})
    first = last(simulation, pull[0], 10.0)
    second = simulation.load_displacement(pull[1], forces=[10.0], configuration=turned).frames[-1]
    assert first.life(second).least.amplitude < 1e-6 * first.peak.value


def test_missing_data_are_named():
    simulation, across, _ = beam(None)
    frame = last(simulation, across, 0.01)
    with pytest.raises(fm.DescriptionError, match="plastic.*yield_stress"):
        _ = frame.safety
    with pytest.raises(fm.DescriptionError, match="'plastic' has no strength"):
        frame.life(frame)
    simulation, across, _ = beam(fm.Strength(ultimate_stress=40.0))
    frame = last(simulation, across, 0.01)
    with pytest.raises(fm.DescriptionError, match="'plastic' has no line of Basquin"):
        frame.life(frame)
    assert frame.safety.least.allowable.name == "ultimate stress"


def test_explanations_and_reports_speak_of_safety_where_strengths_are_known(tmp_path):
    for strength, factor in ((STRENGTH, 20.0 / 119.0), (None, None)):
        simulation, across, _ = beam(strength)
        curve = simulation.load_displacement(across, forces=[0.0, 1.0])
        assert "stress" not in simulation.clock.seconds
        (hint,) = [own for own in curve.explain().left_out if own.what == "yield and fracture"] or [None]
        assert ("stress" in simulation.clock.seconds) is (strength is not None)
        report = fm.write_report(tmp_path / str(factor), simulation, [curve])
        unloaded, loaded = (frame["safety"] for frame in report.summary["frames"])
        if strength is None:
            assert (hint, unloaded, loaded) == (None, None, None)
            assert "factor of safety" not in str(report)
        else:
            assert hint.matters and "yield stress 20" in hint.text
            assert loaded["factor"] == pytest.approx(factor, rel=0.05) and unloaded["factor"] is None
            assert f"factor of safety {loaded['factor']:.3g}" in str(report)


@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
def test_free_expansion_is_no_strain(space):
    mechanism = fm.Mechanism("bar")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    material = fm.Material("hot", 1e5, 0.0, expansion=1e-4, strength=fm.Strength(ultimate_strain=0.01))
    bar = mechanism.flexible("bar", fm.strip([(-1, 0), (7, 0)], thickness=1.0, depth=1.0), material)
    mechanism.weld(base, bar, at=(-0.5, 0), region=fm.Rectangle(1.0, 3.0))
    mechanism.weld(bar, hand, at=(6.5, 0), region=fm.Rectangle(1.0, 3.0))
    pull = mechanism.force(on=hand, at=(6, 0), direction=(1, 0))
    scene = fm.Scene(mechanism, effects=[fm.Temperature(100.0)])
    frame = last(fm.Simulation(scene, space=space, size=1.0, comm=MPI.COMM_SELF), pull, 200.0)
    # in the middle F / E b h = 0.002 beside the free 0.01; clamps hold the width, which adds less than as much
    assert 0.0018 < frame.safety.least.peak.value < 0.009
    assert frame.displacement == pytest.approx(6.0 * 0.012, rel=0.01)
