"""The design objective: its gradient away from the initial design, and a target that is reached by changing a shape."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design.handle_optimum import HandleOptimum
from fenicsmech.design.link_shape import shape_links
from fenicsmech.design.objective import Objective
from fenicsmech.design.optimisers import LevenbergMarquardt
from fenicsmech.design.penalties import Bounds, ShapeBounds, StayClose
from fenicsmech.design.quality import QualitySum
from fenicsmech.design.shape_map import ShapeMap
from fenicsmech.design.spline_design import SplineDesign, Target, shape_request
from fenicsmech.design.spline_samples import SplineSamples

from ..simulation.demo_scenes import describe


def truss_objective(space: str, size: float) -> tuple[Objective, np.ndarray, np.ndarray]:
    """Objective of the truss finger, its initial design, and which parameters are thicknesses."""
    scene, push = describe("truss")
    finger = scene.mechanism
    (diagonal,) = finger.flexible_links
    simulation = fm.Simulation(scene, space=space, size=size)
    model = simulation.model
    design = SplineDesign(diagonal, segments=3, thickness=(1.5, 6.0))
    shapes = shape_links(model.mesh, [shape_request(design, finger, simulation.linkage)])
    shape = ShapeMap(model.mesh, model.elastic.d, shapes)
    optimum = HandleOptimum(shape, QualitySum(model.elastic.d))
    spline = shapes[0].handles.spline
    bounds = ShapeBounds(
        [SplineSamples(spline)], [shapes[0].width], [Bounds(design.thickness, design.bend)], [slice(0, spline.size)]
    )
    targets = [Target(push, 0.1, 2.0), Target(push, 0.4, 3.2)]
    objective = Objective(simulation, shape, optimum, targets, bounds + 1e-3 * StayClose(shape.initial))
    return objective, shape.initial, spline.is_thickness


@pytest.mark.parametrize(("space", "size"), [("plane-stress", 3.0), ("3d", 4.0)])
def test_gradient_agrees_with_central_differences_away_from_the_initial_design(space, size):
    objective, start, thickness = truss_objective(space, size)
    assert len(start) == 18
    random = np.random.default_rng(5)
    scale = np.where(thickness, 0.1, 1.0)
    p = start + 0.5 * scale * random.standard_normal(len(start))
    direction = scale * random.standard_normal(len(start))
    here = objective.evaluate(p)
    step = 2e-3
    slope = (objective.evaluate(p + step * direction).value - objective.evaluate(p - step * direction).value) / (
        2 * step
    )
    assert here.gradient @ direction == pytest.approx(slope, rel=1e-5)


def test_targets_are_reached_by_changing_the_shape():
    objective, start, _ = truss_objective("plane-stress", 3.0)
    last = LevenbergMarquardt(iterations=40).minimise(objective, start, watch=lambda iterate: None)
    objective.evaluate(last.evaluation.parameters)
    assert objective.reached == pytest.approx([2.0, 3.2], rel=0.01)
