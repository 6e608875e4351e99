"""Estimates that may be off by more than a factor of two say why."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

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
