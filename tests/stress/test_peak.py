"""Recovered peaks of stress and strain against exact solutions, and the places that are kept out of them."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from benchmarks.stress_cases import CASES
from fenicsmech.stress import von_mises

from ..simulation.clamped import YOUNG, cantilever

COMMS = (MPI.COMM_SELF, MPI.COMM_WORLD)
STEEL = fm.Material("steel", 1e6, 0.3)
# one each of a clamp, a hole, a re-entrant side and a pressed bore
KINDS = ("cantilever", "plate with a hole", "U notch", "Lamé's tube")
IN_SPACE = [case for case in CASES if case.name in KINDS]


def bent_bar(size: float, *, angle: float = 0.0, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[fm.Simulation, fm.Frame]:
    """Half a ring of radii 2 and 4 with straight ends, clamped at one, under a couple of 0.02 at the other."""
    mechanism, tab, turn = fm.Mechanism("half a ring"), 3.0, np.exp(1j * angle)

    def at(x: float, y: float) -> tuple[float, float]:
        z = complex(x, y) * turn
        return z.real, z.imag

    segments = [
        fm.Line(at(4, 0)), fm.Arc(at(0, 4), at(-4, 0)), fm.Line(at(-4, -tab)), fm.Line(at(-2, -tab)),
        fm.Line(at(-2, 0)), fm.Arc(at(0, 2), at(2, 0)), fm.Line(at(2, -tab)),
    ]  # fmt: skip
    shape = fm.outline(at(4, -tab), segments, depth=1.0)
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    bar = mechanism.flexible("bar", shape, STEEL)
    mechanism.weld(base, bar, at=at(3, -tab), region=fm.Rectangle(3.0, 2.0, angle), name="clamp")
    mechanism.weld(bar, hand, at=at(-3, -tab), region=fm.Rectangle(3.0, 2.0, angle))
    couple = {
        mechanism.force(on=hand, at=at(-3, y), direction=at(x, 0), name=f"{x}"): 1.0 for x, y in ((1, 50), (-1, -50))
    }
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=size, comm=comm)
    return simulation, simulation.load_displacement(fm.ForceGroup("couple", couple), forces=[2e-4]).frames[-1]


def estimated_well(peak: fm.StressPeak, known: float, most: float = 0.01) -> bool:
    """Whether the estimate is within a factor of two of the error; where that is below half of ``most``, no less."""
    estimate, error = peak.error / known, abs(peak.value / known - 1.0)
    return 0.5 * error < estimate < max(2.0 * error, most)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_curved_bar_in_pure_bending(angle):
    simulation, frame = bent_bar(1.0, angle=angle)
    expected = next(case for case in CASES if case.name == "curved bar").reference("plane-stress", simulation)
    assert frame.peak.value == pytest.approx(expected, rel=0.01)
    assert np.linalg.norm(frame.peak.place) == pytest.approx(2.0, rel=1e-3)
    assert frame.peak.link == "bar"


@pytest.mark.parametrize("share", [1.0, pytest.param(0.5, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_peaks_are_those_of_closed_forms_or_fine_elements(case, share):
    simulation, curve = case.solved("plane-stress", share * case.size)
    frame, known = curve.frames[-1], case.reference("plane-stress", simulation)
    error = abs(frame.peak.value / known - 1.0)
    assert error < (0.03 if share == 1.0 else 0.01)
    assert estimated_well(frame.peak, known)
    found = frame.peak.value - curve.in_finer_elements().peak.value
    assert 0.5 < found / (frame.peak.value - known) < 2.0
    # close to a clamp, where stress has no limit, fits of strain know nothing of the surface that is free
    beside = case.name == "cantilever" and share < 1.0
    strain, expected = frame.strain_peak, case.strain(known)
    assert strain.value == pytest.approx(expected, rel=0.012 if beside else 0.01)
    # no smaller than that of the stress there
    assert estimated_well(strain, expected, max(0.01, 1.01 * frame.peak.error / frame.peak.value))


@pytest.mark.slow
@pytest.mark.parametrize("case", IN_SPACE, ids=lambda case: case.name)
def test_peaks_in_space_are_those_of_closed_forms_or_fine_elements(case):
    simulation, curve = case.solved("3d-symmetric", case.size)
    frame, known = curve.frames[-1], case.reference("3d-symmetric", simulation)
    assert frame.peak.value == pytest.approx(known, rel=0.03)
    assert estimated_well(frame.peak, known)
    if abs(error := frame.peak.value - known) > 1e-3 * known:  # edges of second order leave less
        assert 0.5 < (frame.peak.value - curve.in_finer_elements().peak.value) / error < 2.0


def test_estimated_error_falls_as_elements_shrink():
    coarse, fine = (bent_bar(size)[1].peak for size in (1.0, 0.15))
    assert fine.error / fine.value < 0.01
    assert fine.error < 0.5 * coarse.error


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d-symmetric", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("size", [1.0, 0.5])
def test_cantilever(space, size):
    beam = cantilever(space, length=20.0, poisson=0.3, size=size)
    frame = beam.simulation.load_displacement(beam.force, forces=[1e-2]).frames[-1]
    # 6 F (L − x) / b h²
    x, *across = frame.peak.place
    assert frame.peak.value == pytest.approx(6.0 * 1e-2 * (20.0 - x), rel=0.01)
    assert 0.0 < x < 1.5
    assert abs(across[0]) == pytest.approx(0.5, rel=1e-9)
    assert all(place.startswith("rim of") for place in frame.peak.left_out)
    # h / 2 times the curvature 12 F (L − x) / E b h³, on the side in tension
    strain = frame.strain_peak
    assert strain.value == pytest.approx(6.0 * 1e-2 * (20.0 - strain.place[0]) / YOUNG, rel=0.015)
    assert strain.place[1] == pytest.approx(-0.5, rel=1e-9)
    assert strain.left_out == frame.peak.left_out and frame.strain_peaks == {strain.link: strain}


@pytest.mark.parametrize("region", [fm.Face(), fm.Rectangle(0.5, 2.0)])
def test_forces_on_regions_load_the_surface_there_alone(region):
    mechanism = fm.Mechanism("cantilever")
    base = mechanism.rigid("base", fixed=True)
    beam = mechanism.flexible("beam", fm.strip([(-1, 0), (10, 0)], thickness=1.0, depth=1.0), STEEL)
    mechanism.weld(base, beam, at=(-0.5, 0), region=fm.Rectangle(1.0, 1.5))
    push = mechanism.force(on=beam, at=(10, 0), direction=(0, 1), region=region)
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    peak = simulation.load_displacement(push, forces=[1e-2]).frames[-1].peak
    arm = 10.0 if isinstance(region, fm.Face) else 10.0 - 0.125  # the link ends in the middle of the rectangle
    assert peak.value == pytest.approx(6e-2 * (arm - peak.place[0]), rel=0.01)


def test_a_force_that_is_added_after_a_peak_was_read_is_left_out_of_the_next():
    beam = cantilever("plane-stress", length=20.0, poisson=0.3, size=1.0, rigid_tip=False)
    beam.simulation.load_displacement(beam.force, forces=[1e-2]).frames[-1].peak  # noqa: B018
    later = beam.simulation.scene.mechanism.force(on=beam.force.on, at=(10.0, 0.5), direction=(0, -1), name="later")
    places = [place.name for place in beam.simulation.singular_places]
    assert "point of 'later'" in places
    place = beam.simulation.load_displacement(later, forces=[1e-2]).frames[-1].peak.place
    assert np.linalg.norm(np.subtract(place, (10.0, 0.5))) > 0.25


def bracket(size: float) -> tuple[fm.Simulation, fm.Frame]:
    """An L of width 2, its corner re-entrant at (2, 2), under a force along x at the end of the upright arm."""
    mechanism = fm.Mechanism("bracket")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    corners = [(0, 0), (9, 0), (9, 2), (2, 2), (2, 9), (0, 9)]
    arm = mechanism.flexible("arm", fm.polygon(corners, depth=1.0), STEEL)
    mechanism.weld(base, arm, at=(9, 1), region=fm.Rectangle(2, 4), name="clamp")
    mechanism.weld(arm, hand, at=(1, 9), region=fm.Rectangle(4, 2))
    force = mechanism.force(on=hand, at=(1, 9), direction=(1, 0))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=size, comm=MPI.COMM_SELF)
    return simulation, simulation.load_displacement(force, forces=[0.1]).frames[-1]


def test_peak_beside_a_reentrant_corner_has_a_limit():
    peaks, largest = [], []
    for size in (0.4, 0.2):
        simulation, frame = bracket(size)
        peaks.append(frame.peak.value)
        simulation.model.load(frame.state)
        largest.append(von_mises(simulation.model.elastic.stress_samples()[0]).max())
        assert "re-entrant corner at (2, 2)" in frame.peak.left_out
        assert np.linalg.norm(np.subtract(frame.peak.place, (2, 2))) > 0.49
    assert largest[1] > 1.15 * largest[0]
    assert peaks[1] == pytest.approx(peaks[0], rel=0.03)


def test_peak_in_finer_elements_leaves_out_as_much_beside_a_corner():
    simulation, _ = bracket(1.5)
    reach = next(own.reach for own in simulation.singular_places if own.name.startswith("re-entrant"))
    curve = simulation.load_displacement(simulation.scene.mechanism.forces[0], forces=[0.1])
    finer = curve.in_finer_elements().peak
    assert np.linalg.norm(np.subtract(finer.place, (2, 2))) > reach
    assert finer.value == pytest.approx(curve.frames[0].peak.value, rel=0.02)


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_a_link_that_lies_across_another_does_not_thin_it(size):
    """Each is left out up to a quarter of its own thickness beside the pin that they share."""
    mechanism = fm.Mechanism("two leaves")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    first, second = (
        mechanism.flexible(name, fm.strip([(x, 0), (x + 20, 0)], thickness=4.0, depth=1.0), STEEL)
        for name, x in (("first", 0), ("second", 20))
    )
    mechanism.clamp(base, first, end="start", length=2.0)
    mechanism.revolute(first, second, at=(20, 0), interface_radius=3.0)
    mechanism.clamp(hand, second, end="end", length=2.0)
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=size, comm=MPI.COMM_SELF)
    reaches = [place.reach for place in simulation.singular_places if "revolute" in place.name]
    assert len(reaches) == 2 and min(reaches) == pytest.approx(1.0, rel=0.1)


def test_the_number_of_patches_that_are_fitted_together_does_not_matter():
    mechanism = fm.Mechanism("cantilever")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    beam = mechanism.flexible("beam", fm.strip([(0, 0), (10, 0)], thickness=1.0, depth=1.0), STEEL)
    mechanism.clamp(base, beam, end="start", length=1.0)
    mechanism.clamp(hand, beam, end="end", length=1.0)
    push = mechanism.force(on=hand, at=(10, 0), direction=(0, 1))
    peaks = [
        fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, stress=stress, comm=MPI.COMM_SELF)
        .load_displacement(push, forces=[1e-2])
        .frames[-1]
        .peak.value
        for stress in (fm.StressOptions(), fm.StressOptions(recovery=fm.RecoveryOptions(chunk=1)))
    ]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-9)


def test_places_that_hold_the_whole_surface_are_named():
    mechanism = fm.Mechanism("stub")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    stub = mechanism.flexible("stub", fm.strip([(0, 0), (10, 0)], thickness=4.0, depth=1.0), STEEL)
    for link, end in ((base, "start"), (hand, "end")):
        mechanism.clamp(link, stub, end=end, length=4.5)
    push = mechanism.force(on=hand, at=(10, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    peak = simulation.load_displacement(push, forces=[0.1]).frames[-1].peak
    assert sorted(peak.left_out) == sorted(place.name for place in simulation.singular_places)
    assert len(peak.left_out) == 2


def test_smooth_outlines_have_no_corners():
    simulation, _ = bent_bar(1.0)
    names = [place.name for place in simulation.singular_places]
    assert sorted(names) == ["rim of 'clamp'", "rim of 'weld joint bar–hand'"]


def test_stress_is_computed_only_where_it_is_read():
    simulation, frame = bent_bar(1.0)
    assert "stress" not in simulation.clock.seconds
    assert frame.max_stress == frame.peak.value
    assert "stress" in simulation.clock.seconds


def test_reading_a_peak_leaves_the_fields_of_the_model():
    simulation, frame = bent_bar(1.0)
    u = simulation.model.elastic.u.x
    u.array[:] = 1.0
    assert frame.peak.value > 0.0
    assert np.all(u.array == 1.0)


@pytest.mark.parallel
def test_any_number_of_ranks_gives_the_same_peak():
    alone, together = (bent_bar(0.5, comm=comm)[1].peak for comm in COMMS)
    assert together.value == pytest.approx(alone.value, rel=1e-8)
    assert together.place == pytest.approx(alone.place, abs=1e-9)
    assert (together.link, together.left_out) == (alone.link, alone.left_out)


@pytest.mark.thorough
def test_finer_elements_show_what_one_element_through_a_bar_in_torsion_misses():
    """Saint-Venant: τ = T / (0.2082 a³) in the middle of each side of a square bar."""
    side, torque = 3.0, 0.02
    rig = fm.Mechanism("torsion")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    bar = rig.flexible("bar", fm.strip([(0, 0), (40, 0)], thickness=side, depth=side), STEEL)
    rig.clamp(wall, bar, end="start", length=4.0)
    rig.clamp(hand, bar, end="end", length=4.0)
    pair = [(rig.force(on=hand, at=(38, y), direction=(0, 0, z), name=f"{z}"), 1.0) for y, z in ((10, 1), (-10, -1))]
    simulation = fm.Simulation(fm.Scene(rig), space="3d", size=side, layers=1, comm=MPI.COMM_SELF)
    curve = simulation.load_displacement(fm.ForceGroup("couple", pair), forces=[torque / 20.0])
    expected = np.sqrt(3.0) * torque / (0.2082 * side**3)
    coarse, finer = curve.frames[0].peak, curve.in_finer_elements().peak
    assert coarse.value < 0.75 * expected
    assert finer.value == pytest.approx(expected, rel=0.03)
