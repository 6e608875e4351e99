"""Sensitivities close to a limit point, and designs that cross a fold."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import Infeasible, SampleEquilibria
from fenicsmech.equilibrium import LoadControl
from fenicsmech.quantities import Sensitivity

from ..equilibrium.arch import RISE, SPAN, arch, lowered
from ..oracles.dense import taylor_rates


@pytest.mark.thorough
def test_displacement_sensitivities_hold_close_to_a_limit_point():
    gap, (simulation, push) = 1e-4, arch()
    path = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE))
    force = (1.0 - gap) * path.limit_points[0].frame.force
    model = simulation.model
    positions = model.elastic.shape.function_space.tabulate_dof_coordinates()
    rise = np.zeros((len(positions), 2))
    rise[:, 1] = np.sin(np.pi * positions[:, 0] / SPAN)

    def travel(t: np.ndarray, load: float) -> float:
        model.reshape(t[0] * rise.ravel())
        frame = simulation.load_displacement(push, forces=[0.9 * force, load]).frames[-1]
        assert frame.stable and frame.displacement < 0.7 * RISE
        return frame.displacement

    curve = simulation.load_displacement(push, forces=[0.0, 0.9 * force, force])
    adjoint, travels = Sensitivity(model), [fm.Displacement(push).on(model)]
    loaded, unloaded = (
        adjoint.gradients(simulation.solver(push), frame.state, LoadControl(frame.force), travels)[0]
        for frame in (curve.frames[-1], curve.frames[0])
    )
    slope = float((loaded.design - unloaded.design) @ rise.ravel())
    steps = 0.04 * gap * RISE * np.array([1.0, 0.5, 0.25])
    rates = taylor_rates(lambda t: travel(t, force), [0.0], [1.0], [slope], steps)
    assert np.all(rates.without > 0.9) and np.all(rates.with_gradient > 1.9)
    steps *= force / RISE
    rates = taylor_rates(lambda t: travel(np.zeros(1), force - t[0]), [0.0], [1.0], [-loaded.control], steps)
    assert np.all(rates.without > 0.9) and np.all(rates.with_gradient > 1.9)


@pytest.fixture(scope="module")
def nearly_snapping():
    """An arch under 0.97 of its limit load, which is below that of arches lower by 1.2 % or more."""
    simulation, push = arch()
    path = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE))
    limit = path.limit_points[0].frame
    target = fm.Target(push, force=0.97 * limit.force, displacement=limit.displacement)
    return simulation, SampleEquilibria(simulation, [target])


@pytest.mark.thorough
@pytest.mark.parametrize("fall", [0.012, 0.02, 0.3])
def test_design_path_across_a_fold_is_reported(nearly_snapping, fall):
    simulation, equilibria = nearly_snapping
    lowered(simulation.model, 0.0)
    known = equilibria.from_zero()
    lowered(simulation.model, fall)
    there = simulation.model.elastic.design
    if fall > 0.012:
        with pytest.raises(Infeasible, match="fold"):
            equilibria.from_design(known)
        assert np.array_equal(simulation.model.elastic.design, there)
        with pytest.raises(Infeasible, match="snaps"):
            equilibria.from_zero()
    else:
        followed, traced = equilibria.values(equilibria.from_design(known)), equilibria.values(equilibria.from_zero())
        assert followed == pytest.approx(traced, rel=1e-7)


def test_large_change_of_design_away_from_the_fold_is_followed(nearly_snapping):
    simulation, equilibria = nearly_snapping
    lowered(simulation.model, 0.0)
    known = equilibria.from_zero()
    lowered(simulation.model, -0.3)
    followed, traced = equilibria.values(equilibria.from_design(known)), equilibria.values(equilibria.from_zero())
    assert followed == pytest.approx(traced, rel=1e-7)
    assert followed < 0.5 * equilibria.values(known)
