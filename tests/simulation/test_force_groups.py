"""Forces that grow together lead to the equilibrium under all of them."""

from __future__ import annotations

import pytest
from mpi4py import MPI

import fenicsmech as fm

PLASTIC = fm.Material("plastic", 2000.0, 0.35)


def arm() -> tuple[fm.Scene, fm.Force, fm.Force]:
    """A cantilever with a loaded hand and a force on the link itself."""
    mechanism = fm.Mechanism("arm")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    link = mechanism.flexible("link", fm.strip([(0, 0), (25, 4), (50, 0)], thickness=3.0, depth=6.0), PLASTIC)
    mechanism.weld(base, link, at=(0, 0), interface_radius=2.0)
    mechanism.weld(link, hand, at=(50, 0), interface_radius=2.0)
    push = mechanism.force(on=hand, at=(55, 3), direction=(0, -1), name="push")
    press = mechanism.force(on=link, at=(25, 4), direction=(0.6, 0.8), name="press")
    return fm.Scene(mechanism), push, press


def test_group_ends_where_the_forces_end_one_after_the_other():
    scene, push, press = arm()
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    group = fm.ForceGroup("both", {push: 1.0, press: -2.5})
    together = simulation.load_displacement(group, forces=[3.0])
    apart = simulation.load_displacement(push, forces=[3.0], others={press: -7.5})
    assert together.frames[0].state.u == pytest.approx(apart.frames[0].state.u, abs=1e-8)
    # its displacement is the work of its forces over its magnitude
    other = simulation.load_displacement(press, forces=[-7.5], others={push: 3.0})
    work = apart.displacements[0] - 2.5 * other.displacements[0]
    assert together.displacements[0] == pytest.approx(work, rel=1e-8)


def test_displacement_of_a_group_can_be_prescribed():
    scene, push, press = arm()
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    group = fm.ForceGroup("both", {push: 1.0, press: -2.5})
    loaded = simulation.load_displacement(group, forces=[3.0])
    moved = simulation.load_displacement(group, displacements=[float(loaded.displacements[0])])
    assert moved.forces == pytest.approx([3.0], rel=1e-8)


def test_invalid_groups_are_refused():
    scene, push, _ = arm()
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    other = fm.Mechanism("other")
    stranger = other.force(on=other.rigid("body"), at=(0, 0), direction=(1, 0), name="stranger")
    with pytest.raises(fm.DescriptionError, match="'push' in forces 'both'"):
        fm.ForceGroup("both", {push: "much"})
    for none in ({}, ()):
        with pytest.raises(fm.DescriptionError, match="forces 'none': there are none"):
            fm.ForceGroup("none", none)
    with pytest.raises(fm.DescriptionError, match="'push' is given twice"):
        fm.ForceGroup("twice", [(push, 1.0), (push, 2.0)])
    with pytest.raises(fm.DescriptionError, match="'stranger'.*not a force of 'arm'"):
        simulation.load_displacement(fm.ForceGroup("both", {push: 1.0, stranger: 1.0}), forces=[1.0])
    with pytest.raises(fm.DescriptionError, match="to be held constant"):
        simulation.load_displacement(fm.ForceGroup("one", {push: 1.0}), forces=[1.0], others={push: 1.0})


def test_a_group_among_constant_forces_is_refused():
    scene, push, press = arm()
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    with pytest.raises(fm.DescriptionError, match="is not a force"):
        simulation.load_displacement(push, forces=[1.0], others={fm.ForceGroup("both", {push: 1.0, press: 1.0}): 0.5})
