"""A load too small to be felt beside the rounding of stiff links is refused where nothing else holds the mechanism."""

import pytest
from mpi4py import MPI

import fenicsmech as fm


def pendulum(modulus: float) -> tuple[fm.Simulation, object]:
    """A blade on a hinge; the force pulls it out of its dead centre, as drawn."""
    mechanism = fm.Mechanism("pendulum")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible(
        "blade", fm.strip([(0, 0), (30, 0)], thickness=2.0, depth=4.0), fm.Material("steel", modulus, 0.3)
    )
    mechanism.revolute(base, blade, at=(0, 0), interface_radius=1.0)
    push = mechanism.force(on=blade, at=(30, 0), direction=(0.8, 0.6))
    return fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=2.0, comm=MPI.COMM_SELF), push


def test_a_load_that_is_felt_turns_the_blade_until_it_pulls_along_it():
    simulation, push = pendulum(2e3)
    (frame,) = simulation.load_displacement(push, forces=[1.0]).frames
    assert frame.state.poses[1, 2] == pytest.approx(0.6435, abs=1e-3)  # arctan 3/4


def test_a_load_that_is_not_felt_is_refused():
    simulation, push = pendulum(2e11)
    with pytest.raises(fm.EquilibriumError, match="Nothing but the force holds 'blade'"):
        simulation.load_displacement(push, forces=[1e-12])


def test_springs_softer_than_rounding_are_named():
    mechanism = fm.Mechanism("lever")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible(
        "blade", fm.strip([(0, 0), (30, 0)], thickness=2.0, depth=4.0), fm.Material("steel", 2e5, 0.3)
    )
    hinge = mechanism.revolute(base, blade, at=(0, 0), interface_radius=1.0)
    push = mechanism.force(on=blade, at=(30, 0), direction=(0, 1))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(hinge, 1e-10, rest=0.2)])
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    with pytest.raises(fm.EquilibriumError, match="The springs are softer than the rounding"):
        simulation.load_displacement(push, forces=[1e-13])
