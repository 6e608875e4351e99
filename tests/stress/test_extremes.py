"""Extremes of stress, strain, safety and life as quantities of designs are those of frames, and limits on them hold."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..ranks import EACH_COMM

LENGTH = 20.0
STRENGTH = fm.Strength(yield_strain=1e-3, ultimate_stress=40.0, fatigue=fm.Basquin(90.0, -0.1))
PLASTIC = fm.Material("plastic", 1e4, 0.3, strength=STRENGTH)


def bar(
    comm: MPI.Comm,
    material: fm.Material = PLASTIC,
    direction: tuple[float, float] = (0.0, 1.0),
    stress: fm.StressOptions | None = None,
) -> tuple[fm.Simulation, fm.mechanism.Force]:
    """A bar of section 1 x 1, clamped at x = 0, with a force across it, or in a ``direction``, at its end."""
    mechanism = fm.Mechanism("bar")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    link = mechanism.flexible("bar", fm.strip([(-1, 0), (LENGTH + 1, 0)], thickness=1.0, depth=1.0), material)
    mechanism.weld(base, link, at=(-0.5, 0), region=fm.Rectangle(1.0, 3.0))
    mechanism.weld(link, hand, at=(LENGTH + 0.5, 0), region=fm.Rectangle(1.0, 3.0))
    across = mechanism.force(on=hand, at=(LENGTH, 0), direction=direction)
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, comm=comm, stress=stress), across


def true(quantity: fm.Quantity, simulation: fm.Simulation, frame: fm.Frame) -> float:
    """Its value at a frame, which the smooth one is near."""
    quantity.check(simulation.scene, 2)
    own = quantity.on(simulation.model)
    simulation.model.load(frame.state)
    smooth, missing = own.values(frame.state)[0], own.smoothing_errors(frame.state)[0]
    assert 0.0 < abs(missing) < 0.1 * abs(smooth)
    return float(smooth + missing)


@pytest.mark.parametrize("comm", EACH_COMM)
def test_extremes_are_those_of_frames(comm):
    simulation, across = bar(comm)
    rest, frame = simulation.load_displacement(across, forces=[0.0, 0.01]).frames
    peak = frame.peak
    found = [
        true(kind(margin=0.0), simulation, frame)
        for kind in (fm.LargestStress, fm.LargestStrain, fm.LeastSafety, fm.LeastLife)
    ]
    life = np.log10(rest.life(frame).cycles)
    expected = (peak.value, frame.safety.least.peak.value, frame.safety.factor, life)
    assert found == pytest.approx(expected, rel=1e-9)
    # σ b h² / 6 F (L − x)
    assert found[0] == pytest.approx(6.0 * 0.01 * (LENGTH - peak.place[0]), rel=0.01)


@pytest.mark.parametrize("margin", [1.0, 2.0])
def test_margins_are_multiples_of_the_estimated_error_on_the_safe_side(margin):
    simulation, across = bar(MPI.COMM_SELF)
    frame = simulation.load_displacement(across, forces=[0.01]).frames[-1]
    stress = true(fm.LargestStress(margin=margin), simulation, frame)
    assert stress == pytest.approx(frame.peak.value + margin * frame.peak.error, rel=1e-9)
    assert true(fm.LeastSafety(margin=margin), simulation, frame) < frame.safety.factor


@pytest.mark.parametrize("nu", [-0.3, 0.0])
def test_strains_that_are_all_compressive_count_as_none(nu):
    simulation, push = bar(MPI.COMM_SELF, fm.Material("foam", 1e4, nu), (-1.0, 0.0))
    frame = simulation.load_displacement(push, forces=[1.0]).frames[-1]
    own = fm.LargestStrain(margin=0.0).on(simulation.model)
    simulation.model.load(frame.state)
    value, missing = own.values(frame.state)[0], own.smoothing_errors(frame.state)[0]
    assert 0.0 <= value < 1e-6 and 0.0 <= value + missing < 1e-6
    (partial,) = own.partials(simulation.solver(push).system, frame.state)
    assert np.all(np.isfinite(partial.links)) and np.all(np.isfinite(partial.design))


def test_extremes_are_of_the_materials_and_options_of_the_simulation():
    wide = fm.StressOptions(singularity=fm.SingularityOptions(reach=3.0))
    putty = fm.Material("putty", 1e4, 0.3)
    simulation, across = bar(MPI.COMM_SELF, putty, stress=wide)
    link, sample = simulation.scene.mechanism.flexible_links[0], fm.Sample({across: 0.01})
    strong = simulation.with_material(putty, replace(PLASTIC, density=2e-9))
    frame = strong.load_displacement(across, forces=[0.01]).frames[-1]
    assert frame.peak.place[0] > 2.9  # farther from the clamp than by default
    assert true(fm.LargestStress(margin=0.0), strong, frame) == pytest.approx(frame.peak.value, rel=1e-9)
    assert true(fm.LeastSafety(margin=0.0), strong, frame) == pytest.approx(frame.safety.factor, rel=1e-9)
    mass, volume = (own.on(strong.model).value() for own in (fm.LinkMass(), fm.LinkVolume()))
    assert mass == pytest.approx(2e-9 * volume, rel=1e-12)
    targets = [fm.Target(fm.LeastSafety(link), sample, at_least=1.0), fm.Target(fm.LinkMass(), least=True)]
    for quantity in (own.quantity for own in targets):
        quantity.check_materials(strong.materials)
    with pytest.raises(fm.DescriptionError, match="'putty' has no allowable"):
        fm.DesignProblem(simulation, [fm.SplineDesign(link, 2)], targets=targets)
    with pytest.raises(fm.DescriptionError, match="3 is not a material"):
        simulation.with_material(putty, 3)
    with pytest.raises(fm.DescriptionError, match="link 'bar'.*'plastic' is in m, N, Pa, the scene in mm"):
        simulation.with_material(putty, replace(PLASTIC, units=fm.Units("m", "N", "Pa")))


def test_what_materials_lack_is_named():
    simulation, across = bar(MPI.COMM_SELF, fm.Material("putty", 1e4, 0.3))
    link, sample = simulation.scene.mechanism.flexible_links[0], fm.Sample({across: 0.01})
    for quantity, lacks in ((fm.LeastSafety(), "no allowable"), (fm.LeastLife(link), "no ultimate stress")):
        with pytest.raises(fm.DescriptionError, match=f"'putty' has {lacks}"):
            fm.DesignProblem(
                simulation, [fm.SplineDesign(link, 2)], targets=[fm.Target(quantity, sample, at_least=1.0)]
            )
    with pytest.raises(fm.DescriptionError, match="margin of the largest stress"):
        fm.LargestStress(margin=-1.0)
    with pytest.raises(fm.DescriptionError, match="3 is not StressOptions"):
        fm.LargestStress(options=3)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "quantity, bound",
    [
        (fm.LargestStress(), {"at_most": 4.0}),
        (fm.LargestStrain(), {"at_most": 4e-4}),
        (fm.LeastSafety(), {"at_least": 2.5}),
    ],
    ids=lambda own: "" if isinstance(own, dict) else type(own).__name__,
)
def test_the_lightest_bar_bears_what_it_is_allowed_to(quantity, bound):
    """Also in the exported part, remeshed with smaller elements."""
    simulation, across = bar(MPI.COMM_SELF)
    link, sample = simulation.scene.mechanism.flexible_links[0], fm.Sample({across: 0.02})
    targets = [fm.Target(fm.LinkVolume(link), least=True), fm.Target(quantity, sample, **bound)]
    problem = fm.DesignProblem(simulation, [fm.SplineDesign(link, 2, thickness=(0.8, 2.0))], targets=targets)
    result = problem.verify(problem.optimise(), finer=2.0)
    volume, limited = result.targets
    assert result.converged and limited.met and volume.corrected < 0.9 * volume.started
    assert limited.part is not None and limited.part.met


@pytest.mark.thorough
def test_the_lightest_bar_bears_cycles_between_two_forces():
    simulation, across = bar(MPI.COMM_SELF)
    link = simulation.scene.mechanism.flexible_links[0]
    low, high = (fm.Sample({across: force}) for force in (-0.01, 0.02))
    life = fm.Target(fm.LeastLife(since=low), high, at_least=15.8)
    problem = fm.DesignProblem(
        simulation,
        [fm.SplineDesign(link, 2, thickness=(0.8, 2.0))],
        targets=[fm.Target(fm.LinkVolume(link), least=True), life],
    )
    result = problem.verify(problem.optimise(), finer=2.0)
    volume, limited = result.targets
    assert result.converged and limited.met and volume.corrected < 0.9 * volume.started
    assert limited.part is not None and limited.part.met
    below, above = simulation.with_design(result).load_displacement(across, forces=[-0.01, 0.02]).frames
    # with a margin for the error of recovery
    assert 15.8 <= np.log10(below.life(above).cycles) < 16.1
