"""The blocks of the equilibrium system: they part the unknowns, are what formulae say, and serve PETSc's fieldsplit."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.equilibrium import REGULARISATION, DisplacementControl, Factor, LoadControl

from ..oracles import dense
from .crowded import SIZE, control_of, crowded, random_state, system_of
from .finger import finger
from .test_lagrangian import shifted

NAMES = ("nodes", "pressures", "poses", "multipliers", "load")
BULKY = fm.Material("bulky", 2.0, 0.499)


@pytest.mark.parallel
@pytest.mark.parametrize("rubber", [None, BULKY], ids=["u", "u–p"])
def test_blocks_partition_the_unknowns(rubber):
    case = crowded("plane-strain", MPI.COMM_WORLD, **({} if rubber is None else {"rubber": rubber}))
    system = system_of(case, controlled=case.on_flexible)
    blocks, comm = system.blocks, system.comm
    numbers = {name: comm.allgather(getattr(blocks, name).index_set().getIndices()) for name in NAMES}
    found = {name: np.concatenate(parts) for name, parts in numbers.items()}
    assert np.array_equal(np.sort(np.concatenate(list(found.values()))), np.arange(blocks.size))
    assert all(len(found[name]) == getattr(blocks, name).size for name in NAMES)
    assert (blocks.poses.size, blocks.multipliers.size, blocks.load.size) == (system.joints.size, system.joints.rows, 1)
    assert (blocks.pressures.size > 0) == (rubber is not None)
    for whole, parts in (("links", NAMES[:2]), ("border", NAMES[2:])):
        together = np.concatenate(comm.allgather(getattr(blocks, whole).index_set().getIndices()))
        assert np.array_equal(np.sort(together), np.sort(np.concatenate([found[name] for name in parts])))


@pytest.mark.parallel
def test_joined_values_are_restricted_to_the_same():
    case = crowded("plane-strain", MPI.COMM_WORLD, rubber=BULKY)
    blocks = system_of(case, controlled=case.on_flexible).blocks
    links, border = np.arange(blocks.links.count) + 1.0, np.arange(blocks.border.size) + 0.5
    values = blocks.join(links, border)
    parts, whole = blocks.restrict(values), blocks.restrict_border(border)
    assert np.array_equal(np.concatenate([parts.nodes, parts.pressures]), links)
    assert np.array_equal(blocks.gather_border(values), border)
    for part, expected in zip(parts[2:], whole, strict=True):
        assert np.array_equal(part, expected if blocks.last else [])
    parts.nodes[:] = 0.0  # views
    assert not np.any(values[blocks.nodes.local])


def entries(matrix: PETSc.Mat) -> np.ndarray:
    """A copy: the array of a dense matrix goes with it."""
    dense_matrix = matrix.convert("dense", PETSc.Mat())
    return dense_matrix.getDenseArray().copy()


@pytest.mark.parametrize("space", ["plane-stress", "3d"])
def test_blocks_of_the_kkt_matrix_are_those_of_a_dense_oracle(space):
    """K = Dᵀ [[E, E J, 0, −a], [·, ·, −Aᵀ, −a J], [·, ·, −ε, 0], [·, ·, ·, 0]] D with J = ∂u/∂z by differences."""
    case = crowded(space)
    system = system_of(case, controlled=case.on_flexible)
    state, control = random_state(case, system), control_of(DisplacementControl)
    blocks, joints = system.blocks, system.joints
    free, border = system.numbering.free, np.zeros(blocks.border.size)
    units, scale = system.unknowns.units[blocks.links.local], blocks.restrict_border(system.unknowns.scale)

    def moved(z: np.ndarray) -> np.ndarray:
        blocks.restrict_border(border).poses[:] = z / scale.poses
        shifted(system, state, blocks.join(np.zeros(blocks.links.count), border))
        return system.elastic.values()

    largest = np.where(joints.pose_scale == 1.0, 0.03, 0.03 * SIZE)
    follow = dense.jacobian(moved, np.zeros(joints.size), step=largest) * scale.poses
    system.load(state)
    stiffness = system.elastic.create_stiffness()
    system.elastic.add_stiffness(stiffness)
    stiffness.assemble()
    stiffness = entries(stiffness)
    constraints = joints.gradient(state.poses, state.motors)
    lever = np.zeros((system.numbering.rows.nodes.count // system.numbering.per_node, system.numbering.per_node))
    ((point, direction),) = system.controlled.acting
    np.add.at(lever, point.global_nodes, np.outer(point.weights, direction))
    lever = lever.ravel()
    expected = {
        ("nodes", "nodes"): units[:, None] * stiffness[np.ix_(free, free)] * units,
        ("nodes", "poses"): units[:, None] * (stiffness[free] @ follow),
        ("nodes", "multipliers"): np.zeros((len(free), joints.rows)),
        ("nodes", "load"): -(units * lever[free] * scale.load)[:, None],
        ("poses", "multipliers"): -scale.poses[:, None] * constraints.T * scale.multipliers,
        ("poses", "load"): -((lever @ follow) * scale.load)[:, None],
        ("multipliers", "multipliers"): -REGULARISATION * np.eye(joints.rows),
        ("multipliers", "load"): np.zeros((joints.rows, 1)),
        ("load", "load"): np.zeros((1, 1)),
    }
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    for (row, column), block in expected.items():
        one, other = getattr(blocks, row).index_set(), getattr(blocks, column).index_set()
        found = entries(matrix.createSubMatrix(one, other))
        assert found == pytest.approx(block, abs=1e-9 * max(np.abs(block).max(), REGULARISATION)), (row, column)
        mirrored = entries(matrix.createSubMatrix(other, one))
        assert mirrored.T == pytest.approx(found, abs=1e-12 * max(np.abs(block).max(), REGULARISATION)), (column, row)


@pytest.mark.parallel
@pytest.mark.parametrize("control", [LoadControl(0.5), DisplacementControl(0.2)], ids=["load", "displacement"])
def test_fieldsplit_solves_with_the_blocks(control):
    """The Schur complement of the border, links solved exactly, gives what LDLᵀ of the whole matrix gives."""
    simulation, push = finger("plane-strain", comm=MPI.COMM_WORLD)
    system = simulation.solver(push).system
    state = simulation.load_displacement(push, forces=[0.5]).frames[0].state
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix, right = system.kkt.matrix(), control.rate(system, state)
    factor, exact, found = Factor(matrix), right.duplicate(), right.duplicate()
    assert factor.refactor() and factor.solve(right, exact)

    options = PETSc.Options("split_")
    for name, value in {
        "pc_fieldsplit_type": "schur",
        "pc_fieldsplit_schur_fact_type": "full",
        "pc_fieldsplit_schur_precondition": "full",
        "fieldsplit_links_ksp_type": "preonly",
        "fieldsplit_links_pc_type": "lu",
        "fieldsplit_links_pc_factor_mat_solver_type": "mumps",
        "fieldsplit_border_ksp_type": "preonly",
        "fieldsplit_border_pc_type": "redundant",  # the border lives on one rank
        "fieldsplit_border_redundant_pc_type": "svd",  # its diagonal has zeros
    }.items():
        options[name] = value
    solver = PETSc.KSP().create(system.comm)
    solver.setOptionsPrefix("split_")
    solver.setOperators(matrix)
    solver.setType(PETSc.KSP.Type.GMRES)
    solver.setTolerances(rtol=1e-13, max_it=10)
    split = solver.getPC()
    split.setType(PETSc.PC.Type.FIELDSPLIT)
    split.setFieldSplitIS(("links", system.blocks.links.index_set()), ("border", system.blocks.border.index_set()))
    solver.setFromOptions()
    solver.solve(right, found)
    assert (found - exact).norm() <= 1e-8 * exact.norm()
    assert solver.getIterationNumber() <= 3  # exact blocks: a direct solver but for rounding
