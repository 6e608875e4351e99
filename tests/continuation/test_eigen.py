"""Buckling loads by eigenvalues of the KKT matrix, and its softest modes."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..equilibrium import column, toggle
from ..equilibrium.struts import Hold, strut
from ..simulation.clamped import YOUNG, cantilever


@pytest.mark.parametrize("hold", Hold)
def test_buckling_load_of_a_strut_is_that_of_euler(hold):
    case = strut(hold)
    curve = case.simulation.load_displacement(case.push, forces=[0.0])
    (found,) = curve.buckling_points(count=1)
    assert found.value == pytest.approx(case.euler, rel=1e-3)
    assert found.mode.link == "beam" and found.mode.out_of_plane == 0.0


@pytest.mark.parametrize("slides", [1, 3])
def test_higher_modes_and_redundant_joints(slides):
    case = column.column(slides=slides)
    curve = case.simulation.load_displacement(case.push, forces=[0.0])
    found = curve.buckling_points(count=3)
    first = column.critical_load(0.5 * column.THICKNESS)
    assert [load.value / first for load in found] == pytest.approx([1.0, 4.0, 9.0], rel=1e-3)


def test_buckling_load_hardly_depends_on_the_load_it_is_computed_at():
    case = strut(Hold.CLAMPED_CLAMPED)
    loads = [-0.5 * case.euler, 0.9 * case.euler, 1.1 * case.euler]
    curve = case.simulation.load_displacement(case.push, forces=loads)
    for frame in curve.frames:
        (found,) = curve.buckling_points(frame=frame, count=1)
        assert found.value == pytest.approx(case.euler, rel=1e-3)


def test_buckling_load_of_a_toggle_tends_to_its_limit_load():
    case = toggle.toggle(stilt_modulus=200.0)
    curve = case.simulation.follow(case.push, until=fm.Until(displacement=5.0), steps=fm.ArcSteps(largest=0.03))
    limit = curve.limit_points[0]
    errors = []
    for frame in curve.frames[: limit.index : 2]:
        ahead = min(abs(load.value / limit.frame.force - 1.0) for load in curve.buckling_points(frame=frame))
        errors.append(ahead)
    assert np.all(np.diff(errors) < 0.0) and errors[-1] < 0.02


def test_softest_mode_vanishes_at_a_bifurcation_and_is_unstable_beyond():
    case = column.column()
    critical = column.critical_load(0.5 * column.THICKNESS)
    curve = case.simulation.load_displacement(case.push, forces=[0.0, 0.5 * critical, 0.99 * critical, 1.5 * critical])
    stiffness = [curve.soft_modes(frame=frame, count=1)[0].stiffness for frame in curve.frames]
    # the mode of a pinned column keeps its shape: μ = μ₀ (1 − P / P_cr)
    assert np.array(stiffness) / stiffness[0] == pytest.approx([1.0, 0.5, 0.01, -0.5], abs=2e-3)


def test_deep_strip_buckles_sideways_at_the_load_of_prandtl_and_michell():
    # P = 4.013 √(E I₂ G J) / L² of a cantilever under a force at the centroid of its end, with Timoshenko's factor for
    # the warping that the clamp prevents, Γ = h³ b³ / 144, and Michell's for the bending before
    length, height, width = 100.0, 8.0, 0.8
    case = cantilever("3d", length=length, thickness=height, depth=width, poisson=0.0, size=2.5, rigid_tip=False)
    curve = case.simulation.load_displacement(case.force, forces=[0.0])
    sideways, upright = (YOUNG * a * b**3 / 12.0 for a, b in ((height, width), (width, height)))
    torsion = 0.5 * YOUNG * height * width**3 / 3.0 * (1.0 - 0.63 * width / height)
    warping = YOUNG * (height * width) ** 3 / 144.0
    slender = 4.013 * np.sqrt(sideways * torsion) / length**2
    expected = slender / (1.0 - np.sqrt(warping / torsion) / length) ** 2
    expected /= np.sqrt((1.0 - sideways / upright) * (1.0 - torsion / upright))
    pair = curve.buckling_points(count=2)
    assert sorted(load.value for load in pair) == pytest.approx([-expected, expected], rel=0.03)
    assert all(load.mode.out_of_plane > 0.9 for load in pair)


@pytest.mark.parallel
def test_buckling_loads_are_the_same_on_any_number_of_ranks():
    case = strut(Hold.CLAMPED_CLAMPED, comm=MPI.COMM_WORLD)
    curve = case.simulation.load_displacement(case.push, forces=[0.0])
    alone = strut(Hold.CLAMPED_CLAMPED)
    reference = alone.simulation.load_displacement(alone.push, forces=[0.0])
    found = [load.value for load in curve.buckling_points(count=3)]
    assert found == pytest.approx([load.value for load in reference.buckling_points(count=3)], rel=1e-6)
