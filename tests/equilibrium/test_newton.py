"""Newton's iteration converges at its order, and says what went wrong when it does not converge."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.continuation import ConstantPredictor, HermitePredictor, TangentPredictor
from fenicsmech.equilibrium import LoadControl

from ..simulation.clamped import cantilever
from .finger import RUBBER, finger

SPACES = ["plane-stress", "plane-strain", pytest.param("3d", marks=pytest.mark.thorough)]
OUT_OF_REACH = 200.0  # the legs are 60 long
LOADS = {"plane-stress": [2.0, 4.0, 8.0, 16.0], "plane-strain": [2.0, 4.0, 8.0, 16.0], "3d": [2.0, 4.0, 8.0]}


@pytest.mark.parametrize("space", SPACES)
def test_number_of_correct_digits_nearly_doubles_in_each_of_the_last_iterations(space):
    simulation, push = finger(space)
    growth = []
    for loads in (LOADS[space], [-1.0, -2.0]):
        for frame in simulation.load_displacement(push, forces=loads).frames:
            digits = -np.log10(frame.residuals)
            # from where the iteration contracts to where the square would be lost in rounding
            growth += [b / a for a, b in zip(digits[:-1], digits[1:], strict=True) if 2.0 < a < 7.0]
    assert len(growth) >= 6
    assert np.median(growth) >= 1.7


@pytest.mark.thorough
@pytest.mark.parametrize("space", SPACES)
def test_residual_at_the_end_is_the_first_below_the_tolerance(space):
    simulation, push = finger(space, solver=fm.PrimalDualNewton(tolerance=1e-6))
    rough = simulation.load_displacement(push, forces=[3.0]).frames[0]
    assert rough.residuals[-1] <= 1e-6 < min(rough.residuals[:-1])
    simulation, push = finger(space)
    fine = simulation.load_displacement(push, forces=[3.0]).frames[0]
    assert fine.residuals[-1] <= 1e-9 < min(fine.residuals[:-1])
    assert rough.displacement == pytest.approx(fine.displacement, rel=1e-4)


@pytest.mark.parametrize("predictor", [ConstantPredictor(), TangentPredictor(), HermitePredictor()])
def test_predictor_changes_the_cost_but_not_the_curve(predictor):
    loads = [1.0, 2.0, 3.0, 4.0, 5.0]
    simulation, push = finger("plane-stress")
    reference = simulation.load_displacement(push, forces=loads)
    simulation, push = finger("plane-stress", predictor=predictor)
    curve = simulation.load_displacement(push, forces=loads)
    assert curve.displacements == pytest.approx(reference.displacements, rel=1e-9)
    assert sum(f.iterations for f in curve.frames) >= sum(f.iterations for f in reference.frames)


@pytest.mark.thorough
@pytest.mark.parametrize("space", SPACES[:2])
def test_failure_carries_the_frames_before_it_and_names_force_configuration_value_and_remedy(space):
    simulation, push = finger(space)
    motionless = simulation.scene.configuration("standing still", {})
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[3.0, 5.0, OUT_OF_REACH], configuration=motionless)
    error = caught.value
    assert [frame.displacement for frame in error.frames] == pytest.approx([3.0, 5.0], rel=1e-9)
    assert 5.0 <= error.last.displacement < OUT_OF_REACH
    assert "'push'" in error.part and "'standing still'" in error.part
    assert f"no equilibrium at displacement {OUT_OF_REACH:g}" in error.problem
    stated = float(error.problem.split("the last one is at ")[1].split(" ")[0])
    assert stated == pytest.approx(error.last.displacement, rel=1e-5)
    assert "prescribe less" in error.remedy
    again = simulation.load_displacement(push, displacements=[3.0, 5.0], configuration=motionless)
    assert again.forces == pytest.approx([frame.force for frame in error.frames], rel=1e-9)


def test_failure_at_the_first_sample_carries_the_last_equilibrium_on_the_way():
    simulation, push = finger("plane-stress")
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[OUT_OF_REACH])
    assert caught.value.frames == ()
    assert 0.0 < caught.value.last.displacement < OUT_OF_REACH


@pytest.mark.thorough
def test_force_that_nothing_resists_is_refused():
    mechanism = fm.Mechanism("sled")
    base, sled = mechanism.rigid("base", fixed=True), mechanism.rigid("sled")
    spring = mechanism.flexible("spring", fm.strip([(0, 0), (40, 0)], thickness=4.0, depth=5.0), RUBBER)
    mechanism.weld(base, spring, at=(0, 0), interface_radius=2.0)
    mechanism.prismatic(base, sled, at=(0, 20), axis=(1, 0))
    push = mechanism.force(on=sled, at=(0, 20), direction=(1, 0), name="push")
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=4.0, comm=MPI.COMM_SELF)
    with pytest.raises(fm.EquilibriumError, match="no equilibrium at force 0.5"):
        simulation.load_displacement(push, forces=[0.5])


@pytest.mark.parallel
def test_slender_link_takes_a_load_that_rolls_it_up_in_one_solve():
    case = cantilever("plane-stress", size=2.0, comm=MPI.COMM_WORLD)
    rest = case.simulation.load_displacement(case.force, forces=[0.0]).frames[0].state
    solver, length = case.simulation.solver(case.force), 100.0
    solution = solver.solve(rest, LoadControl(10.0 * case.bending / length**2))
    solver.system.load(solution.state)
    assert solver.system.load_displacement(solution.state) == pytest.approx(0.81061 * length, rel=2e-3)  # elastica
    assert solution.iterations <= 16


@pytest.mark.parametrize(
    ("limit", "value"),
    [("iterations", -1), ("iterations", 2.5), ("watchdog", "x"), ("watchdog", -1), ("path_iterations", 0)],
)
def test_invalid_numbers_of_iterations_are_refused(limit, value):
    with pytest.raises(fm.DescriptionError, match=f"{limit} of Newton's method: the value is {value!r}.*whole number"):
        fm.PrimalDualNewton(**{limit: value})


def test_something_other_than_a_method_for_linear_systems_is_refused():
    with pytest.raises(fm.DescriptionError, match="linear systems: 'direct' is not a method"):
        fm.PrimalDualNewton(linear="direct")


def test_too_few_iterations_are_given_as_the_reason():
    simulation, push = finger("plane-stress", solver=fm.PrimalDualNewton(iterations=1))
    with pytest.raises(fm.EquilibriumError, match="after 1 iteration"):
        simulation.load_displacement(push, displacements=[500.0])  # out of reach, however many there are


def test_failure_names_a_link_softer_than_the_rounding_of_the_one_it_carries_as_its_cause():
    mechanism = fm.Mechanism("anvil on a feather")
    base = mechanism.rigid("base", fixed=True)
    feather = mechanism.flexible(
        "feather", fm.strip([(0, 0), (40, 0)], thickness=4.0, depth=4.0), fm.Material("down", 2e-13, 0.3)
    )
    anvil = mechanism.flexible(
        "anvil", fm.strip([(40, 0), (80, 0)], thickness=4.0, depth=4.0), fm.Material("steel", 2e5, 0.3)
    )
    mechanism.weld(base, feather, at=(1.5, 0), interface_radius=1.0)
    mechanism.weld(feather, anvil, at=(40, 0), interface_radius=1.0)
    push = mechanism.force(on=anvil, at=(80, 0), direction=(0, -1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", order=1, size=2.0, comm=MPI.COMM_SELF)
    with pytest.raises(fm.EquilibriumError, match="less than the rounding of the stiffest links: make 'anvil' rigid"):
        simulation.load_displacement(push, forces=[1e-14])


def test_an_unstable_equilibrium_known_to_rounding_only_is_found_in_a_few_iterations():
    angle, stiffness, length = 1.0, 1e-3, 56.0
    mechanism = fm.Mechanism("column on a soft hinge")
    base, crank = mechanism.rigid("base", fixed=True), mechanism.rigid("crank")
    shape = fm.strip([(20, 0), (80, 0)], thickness=8.0, depth=8.0)
    column = mechanism.flexible("column", shape, fm.Material("steel", 2e5, 0.3))
    drive = mechanism.motor(mechanism.revolute(base, crank, at=(0, 0)))
    hinge = mechanism.revolute(crank, column, at=(20, 0), interface_radius=2.0)
    along = (-math.cos(angle), -math.sin(angle))
    push = mechanism.force(on=column, at=(20 + length, 0), direction=along, region=fm.Disc(2.0))
    scene = fm.Scene(mechanism, effects=[fm.JointSpring(hinge, stiffness)])
    solver = fm.PrimalDualNewton(near=1e-4)  # of which rounding is the multiple
    simulation = fm.Simulation(scene, space="plane-stress", size=8.0, solver=solver, comm=MPI.COMM_SELF)
    turned, buckling = scene.configuration("turned", {drive: angle}), stiffness / length
    (below, above) = simulation.load_displacement(
        push, forces=[0.5 * buckling, 2.0 * buckling], configuration=turned
    ).frames
    assert below.stable and not above.stable
    assert abs(above.displacement) < 1e-8 and above.residuals[-1] > 1e-4
    assert above.iterations <= 6


@pytest.mark.parametrize(("before", "steady"), [(1.0, True), (5.0, False), (0.2, False)])
def test_residuals_below_rounding_have_converged_once_they_neither_fall_nor_rise(before, steady):
    # soft motions answer to those that fall, and steps that turn stiff links strain these for one iteration
    simulation, push = finger("plane-stress")
    solver = simulation.solver(push)
    rest = simulation.load_displacement(push, forces=[0.0]).frames[0].state
    solver.system.load(rest)
    residual = replace(solver.system.residual(rest, LoadControl(0.0)), norm=1e-30, forces=0.0)
    assert solver.converged(residual, 1e-30 * before) == steady
