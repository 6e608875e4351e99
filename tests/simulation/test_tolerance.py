"""Newton's method leaves errors far below those of the elements, and smaller ones at a tighter tolerance."""

import numpy as np
import pytest

import fenicsmech as fm

from .demo_scenes import describe

SHARE = 1e-4  # of the error of the elements
MECHANISMS = {"truss": [0.1, 0.2, 0.4], "claw": [2.0, 6.0, 10.0]}


def traced(name: str, space: str, **options) -> tuple[fm.Simulation, fm.Curve]:
    """A coarse curve of a demo."""
    scene, force = describe(name)
    simulation = fm.Simulation(scene, space=space, size=4.0, solver=fm.PrimalDualNewton(**options))
    return simulation, simulation.load_displacement(force, forces=MECHANISMS[name])


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane-stress", "3d-symmetric"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_displacements_move_by_a_small_fraction_of_their_estimated_error_when_newton_continues(name, space):
    simulation, curve = traced(name, space)
    _, strict = traced(name, space, tolerance=1e-13, reuse_factor=0.0)
    moved = np.abs(curve.displacements - strict.displacements)
    assert np.all(moved <= SHARE * np.abs(curve.error_estimates()))
    assert sum(f.iterations for f in curve.frames) < sum(f.iterations for f in strict.frames)
    assert np.array_equal(curve.stable, strict.stable)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7])
def test_a_given_tolerance_is_used(tolerance):
    _, curve = traced("truss", "plane-stress", tolerance=tolerance)
    _, default = traced("truss", "plane-stress")
    ends = [frame.residuals[-1] for frame in curve.frames]
    assert max(ends) <= tolerance
    assert max(ends) > max(frame.residuals[-1] for frame in default.frames)
