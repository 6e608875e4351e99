"""Gradient and KKT matrix with pressures of their own in one of two links, against finite differences."""

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import REGULARISATION, DisplacementControl

from ..ranks import EACH_COMM
from .crowded import control_of, crowded, random_state, system_of
from .test_lagrangian import shifted

BULKY = fm.Material("bulky", 2.0, 0.499)


def case_of(dim: int, comm: MPI.Comm):
    case = crowded({2: "plane-strain", 3: "3d"}[dim], comm, rubber=BULKY)
    system = system_of(case, controlled=case.on_flexible)
    return system, random_state(case, system), control_of(DisplacementControl)


def unknowns(system, state, seed: int) -> np.ndarray:
    """Small scaled unknowns of this rank, each block of a size its kind bears."""
    random, blocks = np.random.default_rng(seed + system.comm.rank), system.blocks
    displacements = 0.01 / system.unknowns.unit_u * random.uniform(-1.0, 1.0, blocks.nodes.count)
    pressures = 0.3 / system.elastic.pressure_unit
    pressures = pressures * random.uniform(-1.0, 1.0, blocks.pressures.count)
    border = random.uniform(-1.0, 1.0, blocks.border.size)
    blocks.restrict_border(border).poses[:] *= 0.01 / system.unknowns.unit_u
    return blocks.join(np.concatenate([displacements, pressures]), border)


def extrapolated(value) -> np.ndarray:
    """The derivative of ``value``(t) at 0 from three central differences."""
    slopes = [(value(h) - value(-h)) / (2.0 * h) for h in (0.1, 0.05, 0.025)]
    finer = [(4.0 * b - a) / 3.0 for a, b in zip(slopes[:-1], slopes[1:], strict=True)]
    return (16.0 * finer[1] - finer[0]) / 15.0


@pytest.mark.thorough
@pytest.mark.parametrize("comm", EACH_COMM)
@pytest.mark.parametrize("dim", [2, 3])
def test_residual_and_kkt_matrix_are_derivatives_of_the_lagrangian(dim, comm):
    system, state, control = case_of(dim, comm)
    assert 0 < system.blocks.pressures.size < comm.allreduce(len(system.elastic.pressure.unknown))
    direction, weights = (unknowns(system, state, seed) for seed in (1, 2))

    def lagrangian(h):
        moved = shifted(system, state, h * direction)
        value = system.potential(moved, moved.force) + moved.force * control.prescribed
        return value - moved.multipliers @ system.joints.value(moved.poses, moved.motors)

    def gradient_at(h):
        return comm.allreduce(weights @ system.residual(shifted(system, state, h * direction), control).vector.array)

    system.load(state)
    at = system.residual(state, control)
    slope = comm.allreduce(at.vector.array @ direction)
    system.linearise(state, control, at)
    matrix = system.kkt.matrix()
    vector = matrix.createVecRight()
    vector.array[:] = direction
    curvature = comm.allreduce(weights @ (matrix * vector).array)
    assert slope == pytest.approx(extrapolated(lagrangian), rel=1e-7)
    # the proximal term of the multipliers is in the matrix alone
    multipliers = system.blocks.multipliers.local
    proximal = REGULARISATION * comm.allreduce(weights[multipliers] @ direction[multipliers])
    assert curvature == pytest.approx(extrapolated(gradient_at) - proximal, rel=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.thorough)])
def test_shift_leaves_pressures_alone(dim):
    system, state, control = case_of(dim, MPI.COMM_WORLD)
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    plain = matrix.getDiagonal().array.copy()
    system.kkt.shift(0.25)
    change = system.blocks.restrict(matrix.getDiagonal().array - plain)
    assert change.nodes == pytest.approx(0.25, abs=1e-12)
    assert not np.any(change.pressures)


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.thorough)])
def test_residual_is_the_same_on_any_number_of_ranks(dim):
    values = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        system, state, control = case_of(dim, comm)
        system.load(state)
        residual = system.residual(state, control)
        values.append((system.potential(state, state.force), residual.norm, residual.forces, system.volume_violation()))
    assert values[1] == pytest.approx(values[0], rel=1e-11)


@pytest.mark.parallel
def test_pressures_are_about_as_large_as_displacements_in_scaled_units():
    system, state, control = case_of(2, MPI.COMM_WORLD)
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    comm, pressures = system.comm, system.blocks.pressures
    # how much of the pressures' rows lies at displacements: their coupling, about one per unit
    probe, rows = matrix.createVecRight(), []
    for seed in range(5):
        values = np.random.default_rng(seed + 10 * comm.rank).choice([-1.0, 1.0], len(probe.array))
        values[pressures.local.start :] = 0.0
        probe.array[:] = values
        rows.append((matrix * probe).array[pressures.local])
    squares = comm.allreduce(float(np.sum(np.square(rows)))) / 5.0 / pressures.size
    assert 0.1 < np.sqrt(squares) < 10.0
