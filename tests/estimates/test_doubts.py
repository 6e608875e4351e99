"""Estimates that may be off by more than a factor of two say why."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import EquilibriumSolver

from ..simulation.refined import cantilever


def shallow_arch() -> tuple[fm.Scene, fm.Force]:
    """A shallow arch between pins that snaps under a force on its crown, which a slide leads."""
    rig = fm.Mechanism("shallow arch")
    ground, crown = rig.rigid("ground", fixed=True), rig.rigid("crown")
    arch = rig.flexible("arch", fm.strip([(-20, 0), (0, 3), (20, 0)], thickness=1.0, depth=5.0), fm.ONYX)
    rig.revolute(ground, arch, at=(-20, 0), interface_radius=0.8)
    rig.revolute(ground, arch, at=(20, 0), interface_radius=0.8)
    rig.weld(arch, crown, at=(0, 3), interface_radius=0.4)
    rig.prismatic(ground, crown, at=(0, 3), axis=(0, 1, 0))
    return fm.Scene(rig), rig.force(on=crown, at=(0, 3), direction=(0, -1))


def test_limit_points_near_are_doubts():
    scene, push = shallow_arch()
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    limit = simulation.load_displacement(push, displacements=list(np.linspace(0.2, 2.0, 10))).forces.max()
    below = simulation.load_displacement(push, forces=[0.3 * limit, 0.9999 * limit])
    far, near = below.doubts()
    assert far == ()
    assert "limit point near" in near


def arch_behind_a_spring() -> tuple[fm.Scene, fm.Force]:
    """The shallow arch, pushed through a spring softer than the arch is after its limit load, which is negative."""
    scene, _ = shallow_arch()
    rig = scene.mechanism
    crown = next(link for link in rig.links if link.name == "crown")
    handle = rig.rigid("handle")
    slide = rig.prismatic(crown, handle, at=(0, 6), axis=(0, 1, 0))
    return fm.Scene(rig, effects=[fm.JointSpring(slide, 20.0)]), rig.force(on=handle, at=(0, 6), direction=(0, -1))


def test_forces_are_doubted_where_the_displacement_turns_back_and_not_at_limit_loads():
    scene, push = arch_behind_a_spring()
    simulation = fm.Simulation(scene, space="plane-stress", size=2.0, comm=MPI.COMM_SELF)
    path = simulation.follow(push, until=fm.Until(displacement=10.0, frames=26))
    farthest, strongest = path.displacements.argmax(), path.forces.argmax()
    assert 0 < strongest < farthest < len(path.frames) - 1
    doubted = ["turning point of the displacement near" in reasons for reasons in path.doubts()]
    assert doubted[farthest]
    assert not any(doubted[: strongest + 2])


def strained_by_a_motor() -> tuple[fm.Scene, fm.Configuration, fm.Force]:
    """A link that a motor bends while its other end slides, and a force on the slide."""
    rig = fm.Mechanism("motor")
    ground, crank, slide = rig.rigid("ground", fixed=True), rig.rigid("crank"), rig.rigid("slide")
    link = rig.flexible("link", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=5.0), fm.ONYX)
    motor = rig.motor(rig.revolute(ground, crank, at=(0, 0)))
    rig.weld(crank, link, at=(1.5, 0), region=fm.Rectangle(3, 5))
    rig.revolute(link, slide, at=(58, 0), interface_radius=1.4)
    rig.prismatic(ground, slide, at=(58, 0), axis=(1, 0, 0))
    push = rig.force(on=slide, at=(58, 0), direction=(-1, 0))
    scene = fm.Scene(rig)
    return scene, scene.configuration("bent", {motor: 0.4}), push


def test_the_unloaded_configuration_counts_alike_in_displacements_and_forces():
    """The contributions to both errors differ by the stiffness, those of links that a motor strains included."""
    scene, bent, push = strained_by_a_motor()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0, comm=MPI.COMM_SELF)
    free = simulation.load_displacement(push, forces=[1.0], configuration=bent)
    held = simulation.load_displacement(push, displacements=list(free.displacements), configuration=bent)
    doubted = []
    for least in np.geomspace(1e-3, 1.0, 25):
        options = fm.DoubtOptions(cancelled=least)
        both = [curve.doubts(options)[0] for curve in (free, held)]
        doubted.append(["contributions of elements cancel" in reasons for reasons in both])
    assert {True, False} == {of_free for of_free, _ in doubted}
    assert all(of_free == of_held for of_free, of_held in doubted)


def test_solvers_that_stall_near_an_equilibrium_are_a_reason_of_their_own(monkeypatch):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    curve, linearise = simulation.load_displacement(push, forces=[load]), EquilibriumSolver.linearise

    def stalled(self, state, *arguments, **options):
        if state is not curve.frames[0].state:
            raise fm.NotConverged("the linear solver stalled")
        return linearise(self, state, *arguments, **options)

    monkeypatch.setattr(EquilibriumSolver, "linearise", stalled)
    assert curve.doubts() == (("tangent not defined",),)


def test_failure_beside_an_equilibrium_leaves_the_fields_at_it(monkeypatch):
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    curve = simulation.load_displacement(push, forces=[load])
    linearise, taken = EquilibriumSolver.linearise, []

    def interrupted(self, *arguments, **options):
        taken.append(linearise(self, *arguments, **options))
        if len(taken) == 2:
            raise KeyboardInterrupt
        return taken[-1]

    monkeypatch.setattr(EquilibriumSolver, "linearise", interrupted)
    u = simulation.model.elastic.u.x.array
    simulation.model.load(curve.frames[0].state)
    there = u.copy()
    with pytest.raises(KeyboardInterrupt):
        curve.doubts()
    assert (u == there).all()


def test_doubts_make_two_factorisations_a_frame_and_keep_the_estimates():
    scene, push, load = cantilever()
    simulation = fm.Simulation(scene, space="plane-stress", size=3.0)
    curve = simulation.load_displacement(push, forces=[0.5 * load, load])
    solver = curve.discretisation.solver(push, [])
    before = solver.factorisations
    curve.doubts()
    assert solver.factorisations - before == 2 * len(curve.frames)
    curve.error_estimates()
    assert solver.factorisations - before == 2 * len(curve.frames)


def test_plain_bending_is_not_doubted():
    scene, push, load = cantilever()
    curve = fm.Simulation(scene, space="plane-stress", size=3.0).load_displacement(push, forces=[0.5 * load, load])
    assert curve.doubts() == curve.doubts(modelling=True) == ((), ())


def test_contributions_that_cancel_are_doubts():
    scene, bend, load = cantilever()
    rig, hand = scene.mechanism, bend.on
    # ∫ (ℓ − x) (ℓ/3 − x) dx = 0: a force at the tip does not move a point of the hand at a third of the length
    sense = rig.force(on=hand, at=(20, 0), direction=(0, 1), name="sense")
    simulation = fm.Simulation(scene, space="plane-stress", order=1, size=3.0)
    curve = simulation.load_displacement(sense, forces=[1e-6 * load], others={bend: 0.01 * load})
    assert "contributions of elements cancel" in curve.doubts()[0]


@pytest.mark.parametrize(("order", "doubted"), [(1, True), (2, False)])
def test_elements_too_large_are_doubts_even_where_a_spring_moves_the_point_more_than_the_link(order, doubted):
    scene, bend, load = cantilever()
    rig, hand = scene.mechanism, bend.on
    handle = rig.rigid("handle")
    slide = rig.prismatic(hand, handle, at=(60, 10), axis=(0, 1, 0))
    push = rig.force(on=handle, at=(60, 10), direction=(0, -1), name="push")
    soft = fm.Scene(rig, effects=[fm.JointSpring(slide, 1e-3 * load)])
    simulation = fm.Simulation(soft, space="plane-stress", order=order, size=3.0)
    curve = simulation.load_displacement(push, forces=[0.05 * load])
    assert abs(curve.error_estimates()[0]) < 0.05 * curve.displacements[0]
    assert ("elements too large" in curve.doubts()[0]) == doubted
    assert ("elements too large" in curve.doubts(modelling=True)[0]) == doubted


@pytest.mark.parametrize(("at", "doubted"), [((30.0, 1.5), True), ((60.0, 0.0), False)])
def test_forces_at_points_are_doubts_but_in_interfaces(at, doubted):
    rig = fm.Mechanism("strip")
    wall, hand = rig.rigid("wall", fixed=True), rig.rigid("hand")
    link = rig.flexible("link", fm.strip([(0, 0), (60, 0)], thickness=3.0, depth=5.0), fm.ONYX)
    rig.weld(wall, link, at=(1, 0), region=fm.Rectangle(2, 4))
    rig.revolute(link, hand, at=(60, 0), interface_radius=1.4)
    rig.weld(wall, hand, at=(60, 10)) if doubted else rig.prismatic(wall, hand, at=(60, 10), axis=(0, 1, 0))
    push = rig.force(on=link, at=at, direction=(0, -1))
    curve = fm.Simulation(fm.Scene(rig), space="plane-stress", size=1.5).load_displacement(push, forces=[1.0])
    assert (curve.growth_by_halving[0] > 0.0) == doubted
    assert ("force at a point of a flexible link" in curve.doubts()[0]) == doubted
