"""The curve does not depend on how it is walked along."""

import numpy as np
import pytest

from ..equilibrium.finger import finger

SPACES = ["plane-stress", "plane-strain", pytest.param("3d", marks=pytest.mark.thorough)]


@pytest.mark.parametrize("space", SPACES)
def test_many_samples_and_one_end_in_the_same_equilibrium(space):
    simulation, push = finger(space)
    direct = simulation.load_displacement(push, forces=[8.0]).frames[-1]
    slowly = simulation.load_displacement(push, forces=np.linspace(0.0, 8.0, 9)).frames[-1]
    assert slowly.displacement == pytest.approx(direct.displacement, rel=1e-9)
    assert slowly.strain_energy == pytest.approx(direct.strain_energy, rel=1e-9)
    assert slowly.state.u == pytest.approx(direct.state.u, abs=1e-9 * np.abs(direct.state.u).max())
    scale = np.abs(direct.state.multipliers).max()
    assert slowly.state.multipliers == pytest.approx(direct.state.multipliers, abs=1e-8 * scale)


@pytest.mark.parametrize("space", SPACES[:2])
def test_samples_may_come_in_any_order_and_twice(space):
    simulation, push = finger(space)
    loads = [0.0, 2.0, 4.0, 6.0]
    sorted_ones = dict(zip(loads, simulation.load_displacement(push, forces=loads).displacements, strict=True))
    mixed = [4.0, 0.0, 6.0, 6.0, 2.0, 0.0]
    curve = simulation.load_displacement(push, forces=mixed)
    assert curve.forces == pytest.approx(mixed, abs=0.0)
    scale = max(sorted_ones.values())
    assert curve.displacements == pytest.approx([sorted_ones[load] for load in mixed], abs=1e-9 * scale)


@pytest.mark.parametrize("space", SPACES[:2])
def test_there_and_back_ends_where_it_began(space):
    simulation, push = finger(space)
    curve = simulation.load_displacement(push, displacements=[0.0, 6.0, -4.0, 6.0, 0.0])
    first, there, _, again, last = curve.frames
    assert again.force == pytest.approx(there.force, rel=1e-9)
    assert last.force == pytest.approx(first.force, abs=1e-9 * there.force)
    assert last.strain_energy == pytest.approx(0.0, abs=1e-15 * there.strain_energy + 1e-18)


@pytest.mark.parametrize("asked", ["forces", "displacements"])
def test_beyond_the_start_no_step_leads_back(asked):
    """The path is unique until it snaps: on the other side of what is known it goes on from there."""
    simulation, push = finger("plane-stress")
    _, other = simulation.load_displacement(push, **{asked: [12.0, -12.0]}).frames
    _, alone = simulation.load_displacement(push, **{asked: [0.0, -12.0]}).frames
    assert other.iterations == alone.iterations
    assert np.array_equal(other.state.u, alone.state.u)


def test_nothing_is_left_of_an_earlier_curve():
    simulation, push = finger("plane-stress")
    first = simulation.load_displacement(push, forces=[3.0])
    simulation.load_displacement(push, displacements=[-8.0, 12.0])
    again = simulation.load_displacement(push, forces=[3.0])
    assert np.array_equal(again.displacements, first.displacements)
    assert np.array_equal(again.frames[0].state.u, first.frames[0].state.u)


def test_unloaded_mechanism_has_not_moved_and_holds_no_energy():
    simulation, push = finger("plane-stress")
    for options in ({"forces": [0.0]}, {"displacements": [0.0]}):
        frame = simulation.load_displacement(push, **options).frames[0]
        assert frame.displacement == 0.0 and frame.force == 0.0 and frame.strain_energy == 0.0
        assert not np.any(frame.state.u) and frame.stable
