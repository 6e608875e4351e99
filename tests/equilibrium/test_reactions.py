"""Reactions and motor torques are the multipliers: they balance every link and do the work that the energy takes up."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from ..simulation.demo_scenes import describe
from .crowded import RUBBER
from .wrenches import sums

FIDELITIES = {"plane-stress": 4.0, "plane-strain": 4.0, "3d": 6.0}


def claw(space: str, direction=(1, 0)) -> tuple[fm.Simulation, fm.mechanism.Force]:
    """The claw gripper, coarse, and a force on its finger."""
    scene, grasp = describe("claw")
    grasp = scene.mechanism.force(on=grasp.on, at=grasp.at, direction=direction, name=f"force along {direction}")
    order = 1 if space == "3d" else 2
    return fm.Simulation(scene, space=space, order=order, size=FIDELITIES[space], comm=MPI.COMM_SELF), grasp


def scaffold() -> tuple[fm.Simulation, fm.mechanism.Force]:
    """A rubber post in space between welds, hinges and balls, pulled askew."""
    mechanism = fm.Mechanism("scaffold")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    strut = mechanism.rigid("strut")
    post = mechanism.flexible("post", fm.strip([(0, 0), (4, 16), (0, 30)], thickness=5.0, depth=6.0), RUBBER)
    mechanism.weld(post, base, at=(0, 0), radius=3.0)  # the ground second
    mechanism.universal(post, head, at=(0, 30), axis=(0, 0, 1), radius=3.0)
    mechanism.spherical(base, strut, at=(25, 0, 3))
    mechanism.cylindrical(strut, head, at=(20, 30, 0), axis=(0.6, 0, 0.8))
    mechanism.prismatic(head, base, at=(0, 40, 0), axis=(0.8, 0.6, 0))
    pull = mechanism.force(on=head, at=(5, 33, 8), direction=(0.48, 0.6, 0.64), name="pull")
    return fm.Simulation(fm.Scene(mechanism), space="3d", order=1, size=4.0, comm=MPI.COMM_SELF), pull


def assert_balanced(simulation, curve):
    for frame in curve.frames:
        scale = max(abs(frame.force), *(np.abs(r.force).max() for r in frame.reactions.values()))
        length = simulation.linkage.length
        totals = sums(simulation, curve, frame)
        for link, (force, moment) in totals.items():
            if not getattr(link, "fixed", False):
                assert force == pytest.approx(0.0, abs=1e-8 * scale), link.name
                assert moment == pytest.approx(0.0, abs=1e-8 * scale * length), link.name
        # the ground carries what is applied, and its moment
        force, moment = sum_of(totals, fixed=True)
        applied, its_moment = applied_wrench(simulation, curve, frame)
        assert force == pytest.approx(applied, abs=1e-8 * scale)
        assert moment == pytest.approx(its_moment, abs=1e-8 * scale * length)


def sum_of(totals, *, fixed: bool):
    chosen = [total for link, total in totals.items() if getattr(link, "fixed", False) == fixed]
    return sum(force for force, _ in chosen), sum(moment for _, moment in chosen)


def applied_wrench(simulation, curve, frame):
    """The curve's force and its moment about the origin, from the sums with and without it."""
    from dataclasses import replace

    with_it = sums(simulation, curve, frame)[curve.force_part.on]
    without = sums(simulation, curve, replace(frame, force=0.0))[curve.force_part.on]
    return with_it[0] - without[0], with_it[1] - without[1]
