"""Conjugate gradients over linear displacements give what the factor gives: curves, reactions, inertia."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

import fenicsmech as fm
from fenicsmech.equilibrium import (
    BySize,
    Direct,
    DisplacementControl,
    Factor,
    KktMatrix,
    LoadControl,
    PrimalDualNewton,
    TwoLevel,
    TwoLevelSolver,
)

from .finger import RUBBER, finger

SIDE, LENGTH = 3.0, 60.0
EULER = np.pi**2 * RUBBER.law.E * SIDE**4 / 12.0 / LENGTH**2


def column(size: float = 2.0):
    """A square column between a pin and a slide: it buckles in the plane first, across it at four times the load."""
    mechanism = fm.Mechanism("column")
    base, head = mechanism.rigid("base", fixed=True), mechanism.rigid("head")
    strut = mechanism.flexible("strut", fm.strip([(0, 0), (LENGTH, 0)], thickness=SIDE, depth=SIDE), RUBBER)
    mechanism.revolute(base, strut, at=(0, 0), interface_radius=0.5 * SIDE)
    mechanism.revolute(strut, head, at=(LENGTH, 0), interface_radius=0.5 * SIDE)
    mechanism.prismatic(base, head, at=(LENGTH, 0), axis=(1, 0))
    push = mechanism.force(on=head, at=(LENGTH, 0), direction=(-1, 0))
    return fm.Simulation(fm.Scene(mechanism), space="3d", size=size, comm=MPI.COMM_WORLD), push


def tongue(linear, *, material=RUBBER, space="3d"):
    """A clamped link pushed across at a point of its own."""
    mechanism = fm.Mechanism("tongue")
    base = mechanism.rigid("base", fixed=True)
    link = mechanism.flexible("link", fm.strip([(0, 0), (30, 0)], thickness=4.0, depth=4.0), material)
    mechanism.weld(base, link, at=(2, 0), region=fm.Rectangle(4.0, 4.0))
    tip = mechanism.force(on=link, at=(29, 0.5), direction=(0, 1))
    options = PrimalDualNewton(linear=linear)
    return fm.Simulation(fm.Scene(mechanism), space=space, size=3.0, solver=options, comm=MPI.COMM_WORLD), tip


def same(curve, reference):
    """Whether displacements, forces, stability and reactions agree."""
    assert curve.displacements == pytest.approx(reference.displacements, rel=1e-8, abs=1e-12)
    assert curve.forces == pytest.approx(reference.forces, rel=1e-8, abs=1e-12)
    for frame, other in zip(curve.frames, reference.frames, strict=True):
        assert (frame.unstable_modes, frame.stable_under_control) == (other.unstable_modes, other.stable_under_control)
        largest = max(np.linalg.norm(reaction.force) for reaction in other.reactions.values())
        for name, reaction in other.reactions.items():
            # what redundant hinges carry across the plane is not determined
            assert frame.reactions[name].force[:2] == pytest.approx(reaction.force[:2], abs=1e-8 * largest), name


@pytest.mark.parallel
@pytest.mark.parametrize(
    "asked", [{"forces": [2.0, 5.0]}, pytest.param({"displacements": [4.0, 9.0]}, marks=pytest.mark.thorough)]
)
def test_curves_and_reactions_are_those_of_the_factor(asked):
    curves = []
    for linear in (TwoLevel(), Direct()):
        simulation, push = finger("3d", size=6.0, comm=MPI.COMM_WORLD, solver=PrimalDualNewton(linear=linear))
        curves.append(simulation.load_displacement(push, **asked))
    same(*curves)


@pytest.mark.parametrize("asked", [{"forces": [0.02]}, {"displacements": [6.0]}])
def test_curves_and_reactions_under_a_force_on_a_link_are_those_of_the_factor(asked):
    curves = []
    for linear in (TwoLevel(), Direct()):
        simulation, tip = tongue(linear)
        curves.append(simulation.load_displacement(tip, **asked))
    same(*curves)


@pytest.mark.parallel
def test_inertia_and_solutions_are_those_of_the_factor_on_both_sides_of_buckling_loads():
    simulation, push = column()
    newton = simulation.solver(push)
    system, seen, solver = newton.system, [], None
    first = simulation.load_displacement(push, forces=[0.5 * EULER]).frames[0].state
    compression = newton.solve(first, LoadControl(0.5 * EULER)).tangent
    for load in (0.9, 0.99, 1.03, 1.3, 5.5, 10.0):
        state = system.moved(first, compression.scaled((load - 0.5) * EULER))
        control = LoadControl(load * EULER)
        system.linearise(state, control, system.residual(state, control))
        matrix = system.kkt.matrix()
        solver = solver or TwoLevelSolver(system, TwoLevel())
        factor = Factor(matrix)
        assert factor.refactor() and solver.refactor()
        assert solver.inertia() == factor.inertia()
        right = system.travel_gradient(system.controlled, state)
        exact, found = right.duplicate(), right.duplicate()
        factor.solve(right, exact)
        assert solver.solve(right, found, 1e-10)
        assert (found - exact).norm() <= 1e-7 * exact.norm()
        assert solver.known_inertia().negative <= factor.inertia().negative
        assert solver.solve_and_count(right, found, 1e-10) == factor.inertia()
        assert (found - exact).norm() <= 1e-7 * exact.norm()
        seen.append(factor.inertia().negative - system.joints.rows - 1)
    assert seen[0] == 0 and seen[-1] >= 3 and 1 in seen


@pytest.mark.parallel
def test_stiffness_by_nodes_is_that_block_of_the_matrix():
    simulation, push = column()
    system = simulation.solver(push).system
    state = simulation.load_displacement(push, forces=[0.5 * EULER]).frames[0].state
    control = LoadControl(0.5 * EULER)
    system.load(state)
    system.linearise(state, control, system.residual(state, control))
    matrix = system.kkt.matrix()
    for shift in (0.0, 0.3):
        system.kkt.shift(shift)
        nodal = system.kkt.nodal_stiffness()
        x, y = matrix.createVecRight(), nodal.createVecRight()
        count = y.getLocalSize()
        x.array_w[:count] = y.array_w[:] = np.random.default_rng(matrix.comm.rank).standard_normal(count)
        error = (matrix * x).array_r[:count] - (nodal * y).array_r
        assert np.abs(error).max() <= 1e-12 * (nodal * y).norm()


@pytest.mark.parallel
def test_columns_and_restrictions_are_those_of_the_matrix_shifted_and_softened():
    simulation, push = finger("3d", size=6.0, comm=MPI.COMM_WORLD)
    system = simulation.solver(push).system
    state = simulation.load_displacement(push, forces=[0.5]).frames[0].state
    control = DisplacementControl(0.2)
    system.load(state)
    random = np.random.default_rng(system.comm.rank)
    mapped = restricted = None
    for softness, shift in ((None, 0.0), (None, 0.3), (0.02, 0.0), (0.02, 0.3), (None, 0.0)):
        system.linearise(state, control, system.residual(state, control))
        if softness is not None:
            system.kkt.soften(softness, control)
        system.kkt.shift(shift)
        narrow = groups(system)
        mapped = system.unknowns.map.matMult(narrow, result=mapped)
        restricted = system.kkt.restricted(mapped, restricted)
        columns = system.kkt.border_columns()
        matrix = system.kkt.matrix()  # last, so that it is not what the others take
        x, coarse = columns.createVecRight(), restricted.createVecRight()
        x.array_w[:], coarse.array_w[:] = (random.standard_normal(len(v.array)) for v in (x, coarse))
        whole = system.unknowns.zeros()
        whole.array_w[system.blocks.border.local] = x.array_r
        assert (columns * x - matrix * whole).norm() <= 1e-12 * (columns * x).norm()
        expected = coarse.duplicate()
        narrow.multTranspose(matrix * (narrow * coarse), expected)
        assert (restricted * coarse - expected).norm() <= 1e-11 * expected.norm()


def groups(system):
    """P with one entry in each row: sums of ten unknowns."""
    local = system.unknowns.zeros().getLocalSize()
    owned = -(-local // 10)
    first = (system.comm.exscan(owned) or 0) + np.arange(local) // 10
    total = system.comm.allreduce(owned)
    starts = np.arange(local + 1, dtype=PETSc.IntType)
    size = [(local, system.blocks.size), (owned, total)]
    return PETSc.Mat().createAIJ(size, csr=(starts, first.astype(PETSc.IntType), np.ones(local)), comm=system.comm)


def test_the_matrix_over_all_unknowns_is_never_formed(monkeypatch):
    def formed(self):
        raise AssertionError("the KKT matrix was formed")

    monkeypatch.setattr(KktMatrix, "matrix", formed)
    simulation, push = finger("3d", size=6.0, solver=PrimalDualNewton(linear=TwoLevel()))
    assert simulation.load_displacement(push, forces=[1.0]).frames[0].stable


def test_interfaces_of_another_rest_shape_are_followed():
    curves = []
    for linear in (TwoLevel(), Direct()):
        simulation, push = finger("3d", size=6.0, solver=PrimalDualNewton(linear=linear))
        model = simulation.model
        positions = model.elastic.shape.function_space.tabulate_dof_coordinates()
        slope = np.zeros_like(positions)
        slope[:, 0] = 0.05 * positions[:, 1]
        with model.shaped(slope.ravel()):
            curves.append(simulation.load_displacement(push, forces=[2.0]))
    same(*curves)


def test_iterations_do_not_grow_with_the_mesh():
    counts = []
    for size in (3.0, 1.5):
        simulation, push = column(size)
        newton = simulation.solver(push)
        system = newton.system
        state = simulation.load_displacement(push, forces=[0.5 * EULER]).frames[0].state
        control = LoadControl(0.5 * EULER)
        system.load(state)
        system.linearise(state, control, system.residual(state, control))
        solver = TwoLevelSolver(system, TwoLevel())
        assert solver.refactor()
        right = system.travel_gradient(system.controlled, state)
        assert solver.solve(right, right.duplicate(), 1e-8)
        counts.append(solver.iterations[-1])
    assert counts[1] <= counts[0] <= 60


def test_size_decides_unless_said_otherwise():
    simulation, push = finger("3d")
    system = simulation.solver(push).system
    state = simulation.load_displacement(push, forces=[0.0]).frames[0].state
    control = LoadControl(0.0)
    system.linearise(state, control, system.residual(state, control))
    unknowns = system.kkt.matrix().getSize()[0]
    assert isinstance(BySize(limit=unknowns).solver(system), Factor)
    assert isinstance(BySize(limit=unknowns - 1).solver(system), TwoLevelSolver)
    assert isinstance(BySize().solver(system), Factor)


def test_linear_displacements_have_no_level_below_them():
    options = PrimalDualNewton(linear=BySize(limit=0))
    simulation, push = finger("3d", size=6.0, order=1, solver=options)
    assert simulation.load_displacement(push, forces=[1.0]).frames[0].stable
    simulation, push = finger("3d", size=6.0, order=1, solver=PrimalDualNewton(linear=TwoLevel()))
    with pytest.raises(fm.DescriptionError, match="order 2 or 3"):
        simulation.load_displacement(push, forces=[1.0])


@pytest.mark.parametrize(
    "unsuited",
    [{"material": fm.Material("bulky", 2.0, 0.499)}, {"space": "3d-symmetric"}],
    ids=["pressures", "mid-plane"],
)
def test_two_levels_do_not_suit_pressures_and_mid_planes_which_the_factor_solves_at_any_size(unsuited):
    curves = []
    for linear in (BySize(limit=0), Direct()):
        simulation, tip = tongue(linear, **unsuited)
        curves.append(simulation.load_displacement(tip, forces=[0.02]))
    same(*curves)
    simulation, tip = tongue(TwoLevel(), **unsuited)
    with pytest.raises(fm.DescriptionError, match="TwoLevel"):
        simulation.load_displacement(tip, forces=[0.02])


@pytest.mark.thorough
def test_followed_paths_end_where_those_of_the_factor_do():
    ends = []
    for linear in (TwoLevel(), Direct()):
        simulation, push = finger("3d", size=6.0, solver=PrimalDualNewton(linear=linear))
        curve = simulation.follow(push, until=fm.Until(displacement=0.3))
        assert not curve.events and all(frame.stable for frame in curve.frames)
        ends.append(curve.frames[-1])
    found, expected = ends
    assert found.displacement == pytest.approx(0.3, rel=1e-8)
    assert found.force == pytest.approx(expected.force, rel=1e-8)
