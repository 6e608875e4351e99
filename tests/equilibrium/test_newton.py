"""Newton's iteration converges at its order, and says what went wrong when it does not converge."""

import math

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.equilibrium import Constant, Hermite, NewtonOptions, Tangent

from .finger import finger

SPACES = ["plane-stress", "plane-strain", "3d"]
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
    assert min(growth) >= 1.4


@pytest.mark.parametrize("space", SPACES)
def test_residual_at_the_end_is_below_the_tolerance(space):
    simulation, push = finger(space, newton=NewtonOptions(tolerance=1e-6))
    rough = simulation.load_displacement(push, forces=[3.0]).frames[0]
    assert 1e-12 < rough.residuals[-1] <= 1e-6
    simulation, push = finger(space)
    fine = simulation.load_displacement(push, forces=[3.0]).frames[0]
    assert fine.residuals[-1] <= 1e-10
    assert rough.displacement == pytest.approx(fine.displacement, rel=1e-4)


@pytest.mark.parametrize("predictor", [Constant(), Tangent(), Hermite()])
def test_predictor_changes_the_cost_but_not_the_curve(predictor):
    loads = [1.0, 2.0, 3.0, 4.0, 5.0]
    simulation, push = finger("plane-stress")
    reference = simulation.load_displacement(push, forces=loads)
    simulation, push = finger("plane-stress", predictor=predictor)
    curve = simulation.load_displacement(push, forces=loads)
    assert curve.displacements == pytest.approx(reference.displacements, rel=1e-9)
    assert sum(f.iterations for f in curve.frames) >= sum(f.iterations for f in reference.frames)


@pytest.mark.parametrize("space", SPACES)
def test_failure_carries_the_frames_before_it_and_names_force_configuration_value_and_remedy(space):
    simulation, push = finger(space)
    motionless = simulation.scene.configuration("standing still", {})
    absurd = 1e7
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, forces=[1.0, 2.0, absurd], configuration=motionless)
    error = caught.value
    assert [frame.force for frame in error.frames] == [1.0, 2.0]
    assert error.last is error.frames[-1]
    assert "'push'" in error.part and "'standing still'" in error.part
    assert f"{absurd:g}" in error.problem
    assert "displacement control" in error.remedy
    again = simulation.load_displacement(push, forces=[1.0, 2.0])
    assert again.displacements == pytest.approx([frame.displacement for frame in error.frames], rel=1e-9)


def test_failure_at_the_first_sample_carries_no_frame():
    simulation, push = finger("plane-stress")
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, forces=[1e7])
    assert caught.value.last is None and caught.value.frames == ()


def test_displacement_out_of_reach_is_refused_with_the_value_that_was_reached():
    # the tip's legs are 60 long: it cannot go farther than that
    simulation, push = finger("plane-stress")
    with pytest.raises(fm.EquilibriumError) as caught:
        simulation.load_displacement(push, displacements=[5.0, 70.0])
    error = caught.value
    assert "no equilibrium at displacement 70" in error.problem
    reached = float(error.problem.split("the last one is at ")[1].split(" ")[0])
    assert 5.0 <= reached < 60.0
    assert error.last.displacement == pytest.approx(5.0, rel=1e-9)
    assert math.isfinite(error.last.strain_energy)


def test_too_few_iterations_are_told_as_the_reason():
    simulation, push = finger("plane-stress", newton=NewtonOptions(iterations=1))
    with pytest.raises(fm.EquilibriumError, match="after 1 iterations"):
        simulation.load_displacement(push, forces=[5.0])
