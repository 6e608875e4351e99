"""Gradient and KKT matrix against finite differences of the Lagrangian, far from equilibrium and from any symmetry.

    L = E(u, z) − Σ loads − f (a · u_P − target) − λᵀ C(z)

The unknowns x are moved in a straight line here: quaternions are not put back on the unit sphere, so that the second
derivative along x is that of L and nothing else. The retraction of ``moved`` bends the line, which does not change the
gradient; Newton's method may leave that curvature out because |q| = 1 is among the constraints.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenicsmech.equilibrium import REGULARISATION, Control, DisplacementControl, EquilibriumSystem, LoadControl, State

from ..oracles import dense
from .crowded import SIZE, control_of, crowded, random_state, system_of

CONTROLS = [LoadControl, DisplacementControl]
SPACES = ["plane-stress", "3d-symmetric", "3d"]


def shifted(system: EquilibriumSystem, state: State, x: np.ndarray) -> State:
    """``state`` moved in a straight line by the scaled unknowns ``x`` of this rank, and loaded (collective)."""
    vector = system.unknowns.control_row()
    vector.array[:] = x
    step, joints = system.unknowns.step(vector), system.joints
    poses = state.poses.copy()
    poses[joints.free_bodies] += step.z.reshape(-1, joints.space.pose_size)
    changed = {name: getattr(state, name) + getattr(step, name) for name in ("u", "multipliers", "force")}
    moved = replace(state, poses=poses, **changed)
    system.load(moved)
    return moved


def largest_steps(system: EquilibriumSystem) -> np.ndarray:
    """Largest change of each scaled unknown in finite differences: a small part of a cell, some degrees."""
    blocks, joints = system.blocks, system.joints
    border = np.ones(blocks.border.size)
    units = blocks.restrict_border(system.unknowns.scale).poses
    blocks.restrict_border(border).poses[:] = np.where(joints.pose_scale == 1.0, 0.03, 0.03 * SIZE) / units
    return blocks.join(np.full(blocks.links.count, 0.03 * SIZE / system.unknowns.unit_u), border)


def sample(system: EquilibriumSystem, control: Control) -> np.ndarray:
    """The unknowns by which to differentiate: all, but in space only some of the displacements."""
    parts = parts_of(system)
    displacements = parts["u"][:: {2: 1, 3: 24}[system.elastic.model.dim]]
    force = parts["f"] if control.constrained else []
    return np.concatenate([displacements, parts["z"], parts["λ"], force]).astype(int)


def scattered(system: EquilibriumSystem, columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Scaled unknowns that have ``values`` at ``columns`` and are zero elsewhere."""
    x = np.zeros(system.blocks.local)
    x[columns] = values
    return x


def parts_of(system: EquilibriumSystem) -> dict[str, np.ndarray]:
    """Masks of the unknowns that are displacements, poses, multipliers, the force."""
    parts = system.blocks.restrict(np.arange(system.blocks.local))
    return {"u": parts.nodes, "z": parts.poses, "λ": parts.multipliers, "f": parts.load}


@pytest.mark.thorough
@pytest.mark.parametrize("kind", CONTROLS)
@pytest.mark.parametrize("where", ["on_rigid", "on_flexible"])
@pytest.mark.parametrize("space", SPACES)
def test_residual_is_the_gradient_of_the_lagrangian(space, where, kind):
    case = crowded(space)
    system = system_of(case, controlled=getattr(case, where))
    state, control = random_state(case, system), control_of(kind)

    def lagrangian(x):
        moved = shifted(system, state, x)
        value = system.potential(moved, moved.force)
        value -= moved.multipliers @ system.joints.value(moved.poses, moved.motors)
        return value + (moved.force * control.prescribed if control.constrained else 0.0)

    columns = sample(system, control)
    expected = dense.gradient(
        lambda y: lagrangian(scattered(system, columns, y)), np.zeros(len(columns)), step=largest_steps(system)[columns]
    )
    system.load(state)
    gradient = system.residual(state, control).vector.array
    for name, unknowns in parts_of(system).items():
        chosen = np.isin(columns, unknowns)
        scale = np.abs(expected[chosen]).max(initial=0.0)
        assert gradient[columns[chosen]] == pytest.approx(expected[chosen], abs=1e-7 * scale), name
    if not control.constrained:
        assert gradient[-1] == 0.0  # f is given, nothing is to be balanced


@pytest.mark.thorough
@pytest.mark.parametrize("kind", CONTROLS)
@pytest.mark.parametrize("where", ["on_rigid", "on_flexible"])
@pytest.mark.parametrize("space", SPACES)
def test_kkt_matrix_is_the_derivative_of_the_residual(space, where, kind):
    case = crowded(space)
    system = system_of(case, controlled=getattr(case, where))
    state, control = random_state(case, system), control_of(kind)
    parts, columns = parts_of(system), sample(system, control)

    def gradient_at(y):
        return system.residual(shifted(system, state, scattered(system, columns, y)), control).vector.array.copy()

    expected = np.zeros((system.blocks.local,) * 2)
    expected[:, columns] = dense.jacobian(gradient_at, np.zeros(len(columns)), step=largest_steps(system)[columns])
    expected[parts["λ"], parts["λ"]] -= REGULARISATION
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    matrix = matrix.getValues(range(matrix.size[0]), range(matrix.size[1]))
    for row, rows in parts.items():
        for column, all_columns in parts.items():
            block = np.ix_(rows, np.intersect1d(all_columns, columns))
            scale = np.abs(expected[block]).max(initial=0.0) or 1e-2 * REGULARISATION
            assert matrix[block] == pytest.approx(expected[block], abs=1e-6 * scale), (row, column)
    if not control.constrained:
        assert matrix[-1] == pytest.approx([*np.zeros(len(matrix) - 1), -1.0], abs=1e-12)


@pytest.mark.parametrize("kind", CONTROLS)
@pytest.mark.parametrize("space", SPACES)
def test_kkt_matrix_is_symmetric(space, kind):
    case = crowded(space)
    system = system_of(case, controlled=case.on_flexible)
    state, control = random_state(case, system), control_of(kind)
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    matrix = matrix.getValues(range(matrix.size[0]), range(matrix.size[1]))
    assert np.abs(matrix - matrix.T).max() <= 1e-12 * np.abs(matrix).max()


@pytest.mark.parametrize("space", SPACES)
def test_shift_raises_the_curvature_of_displacements_and_poses_alone(space):
    case = crowded(space)
    system = system_of(case, controlled=case.on_rigid)
    system.unknowns.shift_weights = weights, of_poses = np.random.default_rng(0).random(len(parts_of(system)["u"])), 0.3
    state, control = random_state(case, system), control_of(LoadControl)
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    plain = matrix.getDiagonal().array.copy()
    parts = parts_of(system)
    for amount in (0.25, 2.0, 0.0):
        for weighted, nodes, poses in ((False, 1.0, 1.0), (True, weights, of_poses)):
            system.kkt.shift(amount, weighted=weighted)  # from what was assembled, not on top of the last one
            change = matrix.getDiagonal().array - plain
            assert change[parts["u"]] == pytest.approx(amount * nodes, abs=1e-13)
            assert change[parts["z"]] == pytest.approx(amount * poses, abs=1e-13)
            assert not np.any(change[[*parts["λ"], *parts["f"]]])


@pytest.mark.parametrize("kind", CONTROLS)
@pytest.mark.parametrize("where", ["on_rigid", "on_flexible"])
@pytest.mark.parametrize(
    "space",
    [
        *(pytest.param(space, marks=pytest.mark.parallel) for space in SPACES[:2]),
        pytest.param("3d", marks=pytest.mark.thorough),
    ],
)
def test_kkt_matrix_times_a_direction_is_the_change_of_the_residual_on_any_number_of_ranks(space, where, kind):
    case = crowded(space, MPI.COMM_WORLD)
    system = system_of(case, controlled=getattr(case, where))
    state, control = random_state(case, system), control_of(kind)
    random = np.random.default_rng(MPI.COMM_WORLD.rank)
    direction = random.uniform(-1.0, 1.0, system.blocks.local) * largest_steps(system)
    if not control.constrained:
        system.blocks.restrict(direction).load[:] = 0.0

    def gradient_at(h):
        return system.residual(shifted(system, state, h * direction), control).vector

    # D(h) = D + O(h²)
    slopes = [(gradient_at(h) - gradient_at(-h)) / (2.0 * h) for h in (0.1, 0.05, 0.025)]
    finer = [(4.0 * b - a) / 3.0 for a, b in zip(slopes[:-1], slopes[1:], strict=True)]
    expected = (16.0 * finer[1] - finer[0]) / 15.0
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    vector = matrix.createVecRight()
    vector.array[:] = direction
    assert (matrix * vector - expected).norm() <= 1e-7 * expected.norm()


@pytest.mark.parallel
@pytest.mark.parametrize("space", SPACES)
def test_residual_is_the_same_on_any_number_of_ranks(space):
    values = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        case = crowded(space, comm)
        system = system_of(case, controlled=case.on_flexible)
        state, control = random_state(case, system), control_of(DisplacementControl)
        system.load(state)
        residual = system.residual(state, control)
        border = system.blocks.gather_border(residual.vector.array)
        values.append((system.potential(state, state.force), residual.norm, residual.forces, border))
    for alone, together in zip(*values, strict=True):
        assert together == pytest.approx(alone, rel=1e-11, abs=1e-11 * np.abs(alone).max())
