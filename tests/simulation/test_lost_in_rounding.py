"""Loads and springs far below the rounding of stiff links balance, unless obstacles are in the way."""

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm


def pendulum(modulus: float, effect: Callable[[object], list] = lambda blade: []) -> tuple[fm.Simulation, object]:
    """A blade on a hinge; the force pulls it out of its dead centre, as drawn."""
    mechanism = fm.Mechanism("pendulum")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible(
        "blade", fm.strip([(0, 0), (30, 0)], thickness=2.0, depth=4.0), fm.Material("steel", modulus, 0.3)
    )
    mechanism.revolute(base, blade, at=(0, 0), interface_radius=1.0)
    push = mechanism.force(on=blade, at=(30, 0), direction=(0.8, 0.6))
    scene = fm.Scene(mechanism, effects=effect(blade))
    return fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF), push


def pressed(blade) -> list:
    """A pressure that balances on the blade, whose nodal forces are rounded to what is far larger than the load."""
    return [fm.Pressure(blade, 10.0)]


@pytest.mark.parametrize(
    "modulus, load, effect",
    [
        pytest.param(2e3, 1.0, lambda blade: [], id="felt"),
        pytest.param(2e5, 1e-9, lambda blade: [], id="below the rounding of the blade"),
        pytest.param(2e11, 1e-12, lambda blade: [], id="far below"),
        pytest.param(2e5, 1e-9, pressed, id="below that under a pressure"),
    ],
)
def test_a_load_turns_the_blade_until_it_pulls_along_it(modulus, load, effect):
    simulation, push = pendulum(modulus, effect)
    (frame,) = simulation.load_displacement(push, forces=[load]).frames
    assert frame.state.poses[1, 2] == pytest.approx(np.arctan(0.75), abs=1e-3 if load == 1.0 else 1e-7)


def test_a_load_that_is_not_felt_is_refused_where_an_obstacle_is_in_the_way():
    simulation, push = pendulum(2e11, lambda blade: [fm.Contact(blade, fm.Cylinder((20.0, 8.0), 3.0))])
    with pytest.raises(fm.EquilibriumError, match="Nothing but the force holds 'blade'"):
        simulation.load_displacement(push, forces=[1e-12])


def lever(effects: Callable[[object, object], list]) -> tuple[fm.Simulation, object]:
    """A blade that turns about the origin."""
    mechanism = fm.Mechanism("lever")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible(
        "blade", fm.strip([(0, 0), (30, 0)], thickness=2.0, depth=4.0), fm.Material("steel", 2e5, 0.3)
    )
    hinge = mechanism.revolute(base, blade, at=(0, 0), interface_radius=1.0)
    push = mechanism.force(on=blade, at=(30, 0), direction=(0, 1))
    scene = fm.Scene(mechanism, effects=effects(hinge, blade))
    return fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF), push


@pytest.mark.parametrize("stiffness", [1e-10, 1e-14])
def test_springs_softer_than_rounding_balance_loads_all_the_same(stiffness):
    load = 1e-3 * stiffness
    simulation, push = lever(lambda hinge, blade: [fm.JointSpring(hinge, stiffness, rest=0.2)])
    (frame,) = simulation.load_displacement(push, forces=[load]).frames
    turn = frame.state.poses[1, 2]
    assert stiffness * (turn - 0.2) == pytest.approx(30.0 * load * np.cos(turn), rel=1e-6)


def test_a_pin_softer_than_rounding_gives_way_to_a_load_as_its_compliance_says():
    load, stiffness, compliance = 1e-9, 1e-6, 1e7

    def effects(hinge, blade) -> list:
        return [fm.JointSpring(hinge, stiffness, rest=0.0), fm.JointCompliance(hinge, compliance)]

    simulation, push = lever(effects)
    (frame,) = simulation.load_displacement(push, forces=[load]).frames
    turn = frame.state.poses[1, 2]
    assert stiffness * turn == pytest.approx(30.0 * load * np.cos(turn), rel=1e-6)
    assert frame.displacement == pytest.approx(compliance * load + 30.0 * np.sin(turn), rel=1e-6)


@pytest.mark.parametrize("stiffness", [1e-10, 1e-14])
def test_a_prescribed_displacement_gives_the_force_of_a_spring_softer_than_rounding(stiffness):
    simulation, push = lever(lambda hinge, blade: [fm.JointSpring(hinge, stiffness, rest=0.2)])
    (frame,) = simulation.load_displacement(push, displacements=[3.0]).frames
    turn = np.arcsin(0.1)
    assert frame.force * 30.0 * np.cos(turn) == pytest.approx(stiffness * (turn - 0.2), rel=1e-9)


def test_springs_softer_than_rounding_are_named_where_an_obstacle_is_in_the_way():
    def effects(hinge, blade) -> list:
        return [fm.JointSpring(hinge, 1e-10, rest=0.2), fm.Contact(blade, fm.Cylinder((20.0, 5.0), 3.0))]

    simulation, push = lever(effects)
    with pytest.raises(fm.EquilibriumError, match="softer than the rounding of the stiffest links: make 'blade' rigid"):
        simulation.load_displacement(push, forces=[1e-13])


def test_a_spring_softer_than_the_rounding_of_a_pressure_turns_the_blade_at_once():
    simulation, push = lever(lambda hinge, blade: [fm.JointSpring(hinge, 1e-6, rest=0.2), fm.Pressure(blade, 500.0)])
    (frame,) = simulation.load_displacement(push, forces=[0.0]).frames
    assert frame.state.poses[1, 2] == pytest.approx(0.2, abs=1e-9)
    assert frame.iterations <= 50 and not frame.snapped_through
