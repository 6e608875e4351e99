"""Targets that no shape can move: refused before the optimiser starts."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm

from .mechanisms import PLASTIC, Case
from .refusal import refused


def two_arms() -> tuple[fm.Scene, list[fm.FlexibleLink], list[fm.Force]]:
    """Two cantilevers side by side, each with a loaded hand."""
    mechanism = fm.Mechanism("two arms")
    base, links, forces = mechanism.rigid("base", fixed=True), [], []
    for name, y in (("upper", 20.0), ("lower", 0.0)):
        hand = mechanism.rigid(f"{name} hand")
        arm = mechanism.flexible(name, fm.strip([(0, y), (20, y + 3), (40, y)], thickness=3.0, depth=6.0), PLASTIC)
        mechanism.weld(base, arm, at=(0, y), interface_radius=2.0)
        mechanism.weld(arm, hand, at=(40, y), interface_radius=2.0)
        links.append(arm)
        forces.append(mechanism.force(on=hand, at=(40, y), direction=(0, -1), name=f"push {name}"))
    return fm.Scene(mechanism), links, forces


def problem(comm: MPI.Comm, designed: list[int], *targets: tuple[int, float, float]) -> fm.DesignProblem:
    scene, links, forces = two_arms()
    wanted = [fm.Target(forces[k], force=force, displacement=displacement) for k, force, displacement in targets]
    return Case(scene, [fm.SplineDesign(links[k], 2) for k in designed], wanted).problem(comm=comm)


@pytest.mark.parallel
def test_link_that_does_not_carry_the_force_is_named_with_the_target():
    whole = problem(MPI.COMM_WORLD, [1], (1, 1.0, 0.5), (0, 1.0, 0.5))
    refused(lambda: whole.optimise(), part="'push upper'", problem="'lower' do not carry the force", remedy="carry")


def test_force_of_nothing_moves_nothing():
    whole = problem(MPI.COMM_SELF, [0], (0, 0.0, 0.5))
    refused(lambda: whole.optimise(), part="push upper", problem="no force acts", remedy="not zero")


def test_force_on_what_rigid_parts_hold_moves_nothing():
    scene, links, _ = two_arms()
    base, stop = scene.mechanism.links[0], scene.mechanism.rigid("stop")
    scene.mechanism.weld(base, stop, at=(-5, 10))
    stuck = scene.mechanism.force(on=stop, at=(-5, 10), direction=(1, 0), name="stuck")
    whole = Case(scene, [fm.SplineDesign(links[0], 2)], [fm.Target(stuck, force=1.0, displacement=0.5)]).problem(
        comm=MPI.COMM_SELF
    )
    refused(lambda: whole.optimise(), part="'stuck'", problem="something rigid holds its point", remedy="carry")


def test_target_that_is_met_may_be_beyond_influence():
    result = problem(MPI.COMM_SELF, [0], (0, 1.0, 0.3), (1, 0.0, 0.0)).optimise(
        optimiser=fm.LevenbergMarquardt(iterations=2)
    )
    assert abs(result.targets[1].reached) < 1e-9 and result.targets[0].error != 0.0


def test_weak_influence_is_not_refused():
    whole = problem(MPI.COMM_SELF, [0, 1], (0, 1e-6, 0.5), (1, 1.0, 0.5))
    result = whole.optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    assert np.isfinite(result.worst_error)
