"""Sensitivities close to a limit point, and designs that cross a fold."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design.sensitivity import Adjoint

from ..equilibrium.arch import RISE, SPAN, arch
from ..oracles.dense import taylor_rates


@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_displacement_sensitivities_hold_close_to_a_limit_point(gap):
    simulation, push = arch()
    path = simulation.follow(push, until=fm.Until(displacement=0.7 * RISE))
    force = (1.0 - gap) * path.limit_points[0].frame.force
    model = simulation.model
    positions = model.elastic.d.function_space.tabulate_dof_coordinates()
    rise = np.zeros((len(positions), 2))
    rise[:, 1] = np.sin(np.pi * positions[:, 0] / SPAN)

    def travel(t: np.ndarray, load: float) -> float:
        model.reshape(t[0] * rise.ravel())
        frame = simulation.load_displacement(push, forces=[0.9 * force, load]).frames[-1]
        assert frame.stable and frame.displacement < 0.7 * RISE
        return frame.displacement

    curve = simulation.load_displacement(push, forces=[0.0, 0.9 * force, force])
    adjoint, outputs = Adjoint(model, simulation.newton(push)), [model.point_load(push)]
    (loaded,) = adjoint.gradients(curve.frames[-1].state, outputs)
    (unloaded,) = adjoint.gradients(curve.frames[0].state, outputs)
    slope = float((loaded.design - unloaded.design) @ rise.ravel())
    steps = 0.04 * gap * RISE * np.array([1.0, 0.5, 0.25])
    rates = taylor_rates(lambda t: travel(t, force), [0.0], [1.0], [slope], steps)
    assert np.all(rates.without > 0.9) and np.all(rates.with_gradient > 1.9)
    steps *= force / RISE
    rates = taylor_rates(lambda t: travel(np.zeros(1), force - t[0]), [0.0], [1.0], [-loaded.force], steps)
    assert np.all(rates.without > 0.9) and np.all(rates.with_gradient > 1.9)
