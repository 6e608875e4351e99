"""All solvers find the same equilibria, with the same stability and rates, or say that they did not converge."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from benchmarks.solvers import SNES, AugmentedLagrangian, Globalisation, KKTNewton
from fenicsmech.equilibrium import Direct, DisplacementControl, EquilibriumMethod, LoadControl, NotConverged, TwoLevel

from ..equilibrium.finger import RUBBER, finger
from ..mechanism.truss_finger import truss_finger

SOLVERS = {
    "without predicted stress": fm.PrimalDualNewton(predicted_stress=False),
    "augmented Lagrangian": AugmentedLagrangian(),
    "KKT Newton": KKTNewton(),
    "KKT Newton with backtracking": KKTNewton(backtracking=True),
    **{f"SNES {kind.value}": SNES(globalisation=kind) for kind in Globalisation},
}
each_solver = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
each_method = pytest.mark.parametrize(
    "solver", [AugmentedLagrangian(), KKTNewton(), SNES()], ids=lambda own: type(own).__name__
)


@cache
def reference_curve(space: str, kind: str, samples: Sequence[float], **options) -> fm.Curve:
    """By the default solver."""
    simulation, push = finger(space, comm=MPI.COMM_WORLD, **options)
    return simulation.load_displacement(push, **{kind: samples})


def displacements_of_ranks(u: np.ndarray) -> np.ndarray:
    """Of all ranks; sorted if these are several, because a mesh is not divided alike every time."""
    parts = MPI.COMM_WORLD.allgather(u)
    return np.sort(np.concatenate(parts)) if len(parts) > 1 else u


def assert_alike(solver: EquilibriumMethod, space: str, kind: str, samples: Sequence[float], **options) -> None:
    """The curve is that of the default solver: displacements, forces, stability, states, forces of the joints."""
    reference = reference_curve(space, kind, samples, **options)
    simulation, push = finger(space, solver=solver, comm=MPI.COMM_WORLD, **options)
    curve = simulation.load_displacement(push, **{kind: samples})
    joints = simulation.linkage.joints
    for frame, expected in zip(curve.frames, reference.frames, strict=True):
        assert frame.displacement == pytest.approx(expected.displacement, rel=1e-8)
        assert frame.force == pytest.approx(expected.force, rel=1e-8)
        assert frame.unstable_modes == expected.unstable_modes
        a, b = frame.state, expected.state
        found, wanted = displacements_of_ranks(a.u), displacements_of_ranks(b.u)
        assert found == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max(initial=0.0))
        assert a.poses == pytest.approx(b.poses, abs=1e-8 * np.abs(b.poses).max())
        # multipliers of redundant constraints are not unique, what they do to the bodies is
        pulls = [joints.gradient(s.poses, s.motors).T @ s.multipliers for s in (a, b)]
        assert pulls[0] == pytest.approx(pulls[1], abs=1e-7 * np.abs(pulls[1]).max())


@pytest.mark.thorough
@each_solver
def test_curve_of_a_finger_in_the_plane(solver):
    assert_alike(solver, "plane-stress", "forces", (1.0, 3.0, -1.0))


@pytest.mark.thorough
@each_method
def test_curve_of_a_finger_in_the_plane_at_prescribed_displacements(solver):
    assert_alike(solver, "plane-stress", "displacements", (2.0, 5.0))


@pytest.mark.thorough
@pytest.mark.parallel
@each_method
def test_curve_of_a_finger_in_space_on_any_number_of_ranks(solver):
    assert_alike(solver, "3d", "forces", (0.5, 1.0), order=1, size=8.0)


@pytest.mark.thorough
@each_solver
def test_joints_with_compliance(solver):
    """A constraint that gives way under its multiplier."""
    assert displacements_of_soft_joints(solver) == pytest.approx(
        displacements_of_soft_joints(fm.PrimalDualNewton()), rel=1e-8
    )


@pytest.mark.thorough
@each_method
@pytest.mark.parametrize(
    # the legs let the force go 62 forth and 102 back; whatever its size, dead force has an equilibrium along them
    "control",
    [DisplacementControl(200.0), DisplacementControl(-200.0), LoadControl(1e100), LoadControl(np.nan)],
    ids=["forth", "back", "1e100", "nan"],
)
def test_values_out_of_reach_are_refused_in_one_solve(solver, control):
    simulation, push = finger("plane-stress", solver=solver)
    rest = simulation.load_displacement(push, forces=[0.0]).frames[0].state
    with pytest.raises(NotConverged) as caught:
        simulation.solver(push).solve(rest, control)
    assert caught.value.reason


@pytest.mark.thorough
@each_method
def test_start_with_inverted_elements_is_refused(solver):
    simulation, push = finger("plane-stress", solver=solver)
    rest = simulation.load_displacement(push, forces=[0.0]).frames[0].state
    torn = replace(rest, u=50.0 * np.random.default_rng(1).standard_normal(len(rest.u)))
    with pytest.raises(NotConverged, match="inverted"):
        simulation.solver(push).solve(torn, LoadControl(1.0))


@pytest.mark.thorough
def test_failure_of_a_curve_is_an_error_with_the_frames_before():
    simulation, push = finger("plane-stress", solver=KKTNewton())
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[3.0, 200.0])
    assert [frame.displacement for frame in caught.value.frames] == pytest.approx([3.0], rel=1e-9)
    assert np.isfinite(caught.value.last.displacement)


@pytest.mark.thorough
@pytest.mark.parametrize("solver", [AugmentedLagrangian, KKTNewton, SNES])
def test_linear_systems_on_two_levels_do_as_well(solver):
    curves = []
    for linear in (TwoLevel(), Direct()):
        simulation, push = finger("3d", size=6.0, solver=solver(linear=linear))
        curves.append(simulation.load_displacement(push, forces=[0.5, 1.0]))
    found, expected = curves
    assert found.displacements == pytest.approx(expected.displacements, rel=1e-8)
    for frame, other in zip(found.frames, expected.frames, strict=True):
        assert (frame.unstable_modes, frame.stable_under_control) == (other.unstable_modes, other.stable_under_control)
        largest = max(np.linalg.norm(reaction.force) for reaction in other.reactions.values())
        for name, reaction in other.reactions.items():
            assert frame.reactions[name].force == pytest.approx(reaction.force, abs=1e-6 * largest)


@cache
def displacements_of_soft_joints(solver: EquilibriumMethod) -> np.ndarray:
    made = truss_finger(fm.strip([(0, 0), (14, 36), (40, 60)], thickness=6.0, depth=20.0), RUBBER)
    push = made.push()
    scene = fm.Scene(made.mechanism, effects=[fm.JointCompliance(made.hinge, 0.5)])
    simulation = fm.Simulation(scene, space="plane-stress", size=4.0, solver=solver, comm=MPI.COMM_SELF)
    return simulation.load_displacement(push, forces=[0.05, 0.1]).displacements


def test_kkt_newton_follows_the_path_of_the_default_solver():
    curves = []
    for solver in (fm.PrimalDualNewton(), KKTNewton()):
        simulation, push = finger("plane-stress", solver=solver)
        curves.append(simulation.follow(push, until=fm.Until(force=2.0)))
    expected, found = curves
    assert found.displacements[-1] == pytest.approx(expected.displacements[-1], rel=1e-8)
    assert all(frame.stable for curve in curves for frame in curve.frames)


@pytest.mark.parametrize("solver", [AugmentedLagrangian(), SNES()], ids=["augmented Lagrangian", "SNES"])
def test_solvers_without_arc_length_corrections_refuse_them(solver):
    simulation, push = finger("plane-stress", solver=solver)
    with pytest.raises(fm.DescriptionError, match="no arc-length steps.*PrimalDualNewton"):
        simulation.follow(push, until=fm.Until(force=2.0))
