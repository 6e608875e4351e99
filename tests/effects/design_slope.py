"""Displacements under an effect, differentiated by the design field, against central differences."""

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.equilibrium import LoadControl
from fenicsmech.mechanism import Force
from fenicsmech.quantities import Sensitivity

from ..design.in_plane import design_field


def assert_design_gradient(simulation: fm.Simulation, push: Force, load: float) -> None:
    """The adjoint gradient of the displacement under ``load``, along a wavy change of shape."""
    model, dim = simulation.model, simulation.linkage.dim
    places = model.elastic.shape.function_space.tabulate_dof_coordinates()[:, :dim]
    direction = design_field(model, np.sin(places @ np.diag([0.2, 0.1, 0.3][:dim])))

    def solve_at(step: float) -> tuple[fm.Frame, float]:
        model.reshape(step * direction)
        frame = simulation.load_displacement(push, forces=[load]).frames[-1]
        model.load(frame.state)
        return frame, model.travel(push, frame.state)

    slope = (solve_at(1e-3)[1] - solve_at(-1e-3)[1]) / 2e-3
    frame, _ = solve_at(0.0)
    travel, solver = fm.Displacement(push).on(model), simulation.solver(push)
    (gradient,) = Sensitivity(model).gradients(solver, frame.state, LoadControl(load), [travel])
    assert gradient.design @ direction[: len(gradient.design)] == pytest.approx(slope, rel=1e-5)
