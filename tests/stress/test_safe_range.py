"""Safe ranges against beam theory, and the reasons why they end."""

import math

import pytest

import fenicsmech as fm

from ..equilibrium.arch import RISE, STEEL, arch
from .test_safety import LENGTH, beam


def test_safe_range_of_a_cantilever_is_that_of_beam_theory():
    simulation, across, _ = beam(fm.Strength(yield_stress=20.0))
    found = simulation.safe_range(across)
    for end, sense in ((found.lower, -1.0), (found.upper, 1.0)):
        assert end.reached and end.safety.factor == pytest.approx(1.0, rel=1e-3)
        # σ I / (M y) with I / y = b h² / 6
        force = sense * 20.0 / (6.0 * (LENGTH - end.place[0]))
        assert end.force == pytest.approx(force, rel=0.01)
        assert end.displacement == pytest.approx(4.0 * force * LENGTH**3 / 1e5, rel=0.03)
    assert "'bar'" in str(found)
    half = simulation.safe_range(across, factor=2.0)
    assert half.upper.force == pytest.approx(0.5 * found.upper.force, rel=1e-3)


def test_twice_the_modulus_and_the_strength_move_as_far():
    ends = [
        simulation.safe_range(across).upper
        for simulation, across, _ in (beam(fm.Strength(yield_stress=20.0 * k), modulus=1e5 * k) for k in (1.0, 2.0))
    ]
    assert ends[1].force == pytest.approx(2.0 * ends[0].force, rel=1e-6)
    assert ends[1].displacement == pytest.approx(ends[0].displacement, rel=1e-6)


def test_large_deflections_end_where_the_curve_says():
    simulation, across, _ = beam(fm.Strength(yield_stress=4000.0))
    end = simulation.safe_range(across).upper
    assert end.displacement > 0.3 * LENGTH
    frames = simulation.load_displacement(across, forces=[f * end.force for f in (0.5, 0.999, 1.001)]).frames
    assert frames[1].safety.factor > 1.0 > frames[2].safety.factor


def test_weaker_links_end_the_range():
    for strength, link, stress in ((9.0, "other", 18.0), (11.0, "bar", 20.0)):
        weak = fm.Material("weak", 1e5, 0.0, strength=fm.Strength(yield_stress=strength))
        simulation, _, along = beam(fm.Strength(yield_stress=20.0), second=weak)
        end = simulation.safe_range(along, forces=(0.0, 100.0)).upper
        assert end.link == link
        # F / b h, the second one twice as thick
        assert end.force == pytest.approx(stress, rel=0.05)


def test_struts_end_at_their_euler_load():
    simulation, _, along = beam(fm.Strength(yield_stress=200.0))
    found = simulation.safe_range(along)
    assert found.lower.reason == "bifurcation" and not found.lower.reached
    # π² E I / 4 L²
    assert found.lower.force == pytest.approx(-(math.pi**2) * 1e5 / 12.0 / (4.0 * LENGTH**2), rel=0.01)
    assert found.upper.reached and found.upper.force == pytest.approx(200.0, rel=0.01)


@pytest.mark.thorough
def test_arch_ends_at_its_limit_point_unless_its_displacement_is_prescribed():
    simulation, push = arch()
    strong = fm.Material("strong", law=STEEL.law, strength=fm.Strength(yield_stress=100.0))
    simulation = simulation.with_material(STEEL, strong)
    end = simulation.safe_range(push, forces=(0.0, 1.0)).upper
    assert (end.reason, end.reached) == ("limit point", False)
    limit = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE)).limit_points[0].frame
    assert end.force == pytest.approx(limit.force, rel=1e-4)
    past = simulation.safe_range(push, displacements=(0.0, 2.0 * RISE)).upper
    assert past.reason == "end of the range" and past.displacement == pytest.approx(2.0 * RISE)


@pytest.mark.thorough
def test_a_snap_under_constant_loads_does_not_end_the_range():
    simulation, push = arch()
    strong = fm.Material("strong", law=STEEL.law, strength=fm.Strength(yield_stress=100.0))
    simulation, mechanism = simulation.with_material(STEEL, strong), simulation.scene.mechanism
    weight = mechanism.force(on=push.on, at=push.at[:2], direction=push.direction[:2], name="weight")
    hung = {weight: 0.3}  # beyond the limit load
    (rest,) = simulation.load_displacement(push, forces=[0.0], others=hung).frames
    assert rest.snapped_through and rest.stable
    end = simulation.safe_range(push, forces=(0.0, 100.0), others=hung).upper
    assert end.reached
    assert simulation.load_displacement(push, forces=[end.force], others=hung).frames[0].safety.factor == pytest.approx(
        1.0, rel=1e-2
    )


@pytest.mark.parametrize("bounds", [(1.0, 2.0), (0.0, 0.0), (3.0,), "x"])
def test_ranges_lie_on_both_sides_of_zero(bounds):
    simulation, across, _ = beam()
    with pytest.raises(fm.DescriptionError, match="Give .*ends"):
        simulation.safe_range(across, forces=bounds)


def test_unknown_strengths_are_named_before_anything_is_solved():
    simulation, across, _ = beam(None)
    with pytest.raises(fm.DescriptionError, match="'plastic'"):
        simulation.safe_range(across)
    assert "newton" not in simulation.clock.seconds
