"""Steps that turn links leave them unstrained and joints closed, whatever the angle; to first order they are others."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import DisplacementControl, EquilibriumSolver, State, Step

STEEL = fm.Material("steel", 2e5, 0.3)


def four_bar(space: str) -> tuple[EquilibriumSolver, State, Step]:
    """A solver for a four-bar of three flexible links which nothing holds, its drawn state, and its free motion."""
    mechanism = fm.Mechanism("four-bar")
    base = mechanism.rigid("base", fixed=True)
    a, b, c, d = (0.0, 0.0), (5.0, 20.0), (45.0, 30.0), (40.0, 0.0)
    names = (("crank", a, b), ("coupler", b, c), ("rocker", d, c))
    crank, coupler, rocker = (
        mechanism.flexible(name, fm.strip([p, q], thickness=3.0, depth=2.0), STEEL) for name, p, q in names
    )
    for one, other, at in ((base, crank, a), (crank, coupler, b), (coupler, rocker, c), (base, rocker, d)):
        mechanism.revolute(one, other, at=at, interface_radius=1.2)
    push = mechanism.force(on=crank, at=b, direction=(1, 0))
    simulation = fm.Simulation(fm.Scene(mechanism), space=space, order=1, size=3.0, comm=MPI.COMM_SELF)
    state = simulation.load_displacement(push, displacements=[0.0]).frames[0].state
    solver = simulation.solver(push)
    return solver, state, solver.solve(state, DisplacementControl(0.0)).tangent


def energy(solver: EquilibriumSolver, state: State) -> float:
    solver.system.load(state)
    return solver.system.elastic_energy()


def gap(solver: EquilibriumSolver, state: State) -> float:
    return float(np.abs(solver.system.joints.value(state.poses, state.motors)).max())


@pytest.mark.parametrize("space", ["plane-stress", pytest.param("3d", marks=pytest.mark.thorough)])
def test_steps_along_free_motions_that_turn_links_strain_them_by_orders_less_and_close_joints(space):
    solver, state, motion = four_bar(space)
    system, angles = solver.system, np.array([0.02, 0.04])
    steps = [motion.scaled(angle / system.size(motion)) for angle in angles]
    strained, turned = ([way(state, step) for step in steps] for way in (system.moved, system.turned))
    # ½ φ² is the strain of a plain step, so that its energy grows as φ⁴
    plain = np.array([energy(solver, found) for found in strained])
    assert np.log2(plain[1] / plain[0]) == pytest.approx(4.0, abs=0.1)
    # bodies turn by the same mean angle as their links but for what closes joints, of second order: strain of that
    # order would have the energy of a plain step
    assert all(energy(solver, found) < 1e-4 * much for found, much in zip(turned, plain, strict=True))
    # turns by φ open joints by ½ φ² lengths, which close but for what is of a higher order
    left = np.array([gap(solver, found) for found in turned])
    assert np.all(left < 0.1 * 0.5 * angles**2 * system.joints.length)
    assert np.log2(left[1] / left[0]) > 2.9


def test_steps_that_turn_links_are_the_plain_ones_to_first_order():
    solver, state, motion = four_bar("plane-stress")
    system, rng = solver.system, np.random.default_rng(3)
    bent = system.moved(state, motion.scaled(0.1 / system.size(motion)))
    step = Step(rng.normal(size=motion.u.shape), rng.normal(size=motion.z.shape), 0.0 * motion.multipliers, 0.0)
    step = step.scaled(1.0 / system.size(step))
    apart = []
    for length in (1e-2, 1e-3):
        ends = [way(bent, step.scaled(length)) for way in (system.moved, system.turned)]
        apart.append(system.size(system.difference(*ends)))
    assert np.log10(apart[0] / apart[1]) == pytest.approx(2.0, abs=0.1)
