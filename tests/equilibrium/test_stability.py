"""The inertia of the KKT matrix counts the unstable modes, whatever the constraints."""

import pytest
from mpi4py import MPI

from ..hard.buckling import LENGTH, euler
from ..hard.buckling import column as hard_column
from .column import EULER, THICKNESS, Column, column, critical_load


def unstable_modes(case: Column, load: float) -> int:
    """Under the dead ``load``, in the straight equilibrium."""
    return case.simulation.load_displacement(case.push, forces=[load]).frames[0].unstable_modes


@pytest.mark.parametrize("slides", [1, 3])
def test_column_is_stable_below_the_euler_load_and_has_one_unstable_mode_above_it(slides):
    case = column(slides=slides)
    below, above, beyond = case.simulation.load_displacement(
        case.push, forces=[0.98 * EULER, 1.02 * EULER, 4.2 * EULER]
    ).frames
    assert (below.unstable_modes, below.stable) == (0, True)
    assert (above.unstable_modes, above.stable) == (1, False)
    assert beyond.unstable_modes == 2  # the second mode buckles at four times the load
    assert not above.stable_under_control


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0.7, 1.0])
def test_straight_column_in_space_stays_straight_beyond_its_euler_load_and_is_reported_unstable(size):
    # meshes without symmetry push it aside by next to nothing, from which Newton's method must come back
    simulation, push = hard_column("3d", MPI.COMM_SELF, [(0, 0), (LENGTH, 0)], poisson=0.3, size=size)
    loads = [0.98 * euler("3d"), 1.02 * euler("3d"), 1.2 * euler("3d")]
    below, *above = simulation.load_displacement(push, forces=loads).frames
    assert below.stable and [frame.unstable_modes for frame in above] == [1, 1]
    softness = [frame.displacement / frame.force for frame in (below, *above)]
    assert softness == pytest.approx([softness[0]] * 3, rel=1e-2)
    assert all(frame.iterations < 10 for frame in above)


def test_incompressible_column_between_walls_buckles_at_its_euler_load_with_one_unstable_mode():
    case = column(poisson=0.4999, space="plane-strain", size=THICKNESS)
    wide = EULER / (1.0 - 0.4999**2)
    below, above, beyond = case.simulation.load_displacement(
        case.push, forces=[0.98 * wide, 1.02 * wide, 4.2 * wide]
    ).frames
    assert case.simulation.model.pressure_dofs > 0
    assert [frame.unstable_modes for frame in (below, above, beyond)] == [0, 1, 2]


def test_discrete_critical_load_is_that_of_the_beam():
    case = column(slides=2)
    low, high = 0.95 * EULER, 1.05 * EULER
    while high - low > 1e-5 * EULER:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable_modes(case, middle) else (middle, high)
    assert low == pytest.approx(EULER, rel=1e-2)
    assert low == pytest.approx(critical_load(0.5 * THICKNESS), rel=1e-4)


def test_second_slide_is_reported_as_redundant_and_changes_nothing():
    loads = [0.5 * EULER, 0.98 * EULER]
    curves = []
    for slides in (1, 3):
        case = column(slides=slides)
        curves.append(case.simulation.load_displacement(case.push, forces=loads))
    alone, several = curves
    assert (alone.freedom.redundancy, several.freedom.redundancy) == (0, 4)
    assert all("prismatic" in name for name in several.freedom.redundant)
    assert several.displacements == pytest.approx(alone.displacements, rel=1e-9)


def test_held_displacement_does_not_keep_a_column_from_buckling_sideways():
    case = column()
    short, long = case.simulation.load_displacement(case.push, displacements=[0.007, 0.009]).frames
    assert short.force < EULER < long.force
    assert short.stable_under_control and not long.stable_under_control


@pytest.mark.parallel
def test_unstable_modes_are_counted_alike_on_any_number_of_ranks():
    case = column(slides=2, comm=MPI.COMM_WORLD)
    loads = [0.98 * EULER, 1.02 * EULER, 4.2 * EULER]
    frames = case.simulation.load_displacement(case.push, forces=loads).frames
    assert [frame.unstable_modes for frame in frames] == [0, 1, 2]
    held = case.simulation.load_displacement(case.push, displacements=[0.007, 0.009]).frames
    assert [frame.stable_under_control for frame in held] == [True, False]
