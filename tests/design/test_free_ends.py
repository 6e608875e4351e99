"""Links with one joint and a free end: their ends stay or move, thicken, and carry loads of their own."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import BETWEEN, MeshQuality, ShapeBounds, StayClose, rest_meshes, shape_links, shape_request

from ..oracles.dense import taylor_rates
from .mechanisms import PLASTIC, Case, objective
from .refusal import refused

TIP = (50.0, 0.0)
REGULARISER = MeshQuality(limit=2.5, width=2.5) + ShapeBounds() + 1e-3 * StayClose()


def leaf(*wanted: tuple[float, float], **design) -> Case:
    """A leaf clamped at one end, with a force on the middle of the other."""
    mechanism = fm.Mechanism("leaf")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible("blade", fm.strip([(0, 0), (25, 5), TIP], thickness=3.0, depth=6.0), PLASTIC)
    mechanism.weld(base, blade, at=(0, 0), region=fm.Rectangle(8.0, 6.0, np.arctan2(10, 25)))
    push = mechanism.force(on=blade, at=TIP, direction=(0, -1), name="push")
    targets = [fm.Target(push, force=force, displacement=displacement) for force, displacement in wanted]
    design = {"thickness": (1.5, 6.0), **design}
    return Case(fm.Scene(mechanism), [fm.SplineDesign(blade, 2, **design)], targets)


@pytest.mark.parametrize("ends_move", [False, True])
def test_the_handle_at_a_free_end_stays_on_the_end_of_the_spline(ends_move):
    _, bench = objective(leaf((5.0, 2.0), ends_move=ends_move), REGULARISER)
    (link,) = bench.rest.links
    assert link.spline.size == (15 if ends_move else 13)
    p = bench.design(0.3, seed=3)
    placement = bench.rest.place(p, None)
    (handles,) = bench.rest.handles(placement)
    assert handles[-1] == pytest.approx(2.0, abs=1e-5)
    (mesh,) = rest_meshes(bench.simulation, bench.simulation.scene.mechanism.flexible_links)
    tip = link.spline.evaluate(p, np.array([2.0]))[0]
    drawn = link.spline.evaluate(bench.rest.initial, np.array([2.0]))[0]
    assert (np.linalg.norm(tip[:2] - TIP) > 0.1) == ends_move
    # the drawn end face, (50, ±1.5) along its normal, has turned, thickened and moved with the end of the spline
    slopes = [link.spline.derivative(q, np.array([2.0]))[0, :2] for q in (bench.rest.initial, p)]
    before, after = (np.array([-s[1], s[0]]) / np.linalg.norm(s) for s in slopes)
    faces = {side: tip[:2] + 1.5 * side * tip[2] * after for side in (-1, 1)}
    drawn_mesh = bench.simulation.model.mesh.vertices[:, :2]
    for side, face in faces.items():
        corner = int(np.argmin(np.linalg.norm(drawn_mesh - (drawn[:2] + 1.5 * side * before), axis=1)))
        assert np.linalg.norm(mesh.points[corner] - face) < 0.15


def test_sites_of_handles_at_joints_and_ends():
    case = leaf((5.0, 2.0))
    simulation = case.simulate()
    request = shape_request(case.designs[0], case.scene.mechanism, simulation.linkage)
    (shape,) = shape_links(simulation.model.mesh, [request])
    handles = shape.handles
    assert handles.site.tolist() == [0] + [BETWEEN] * (len(handles) - 1)
    assert handles.slides.tolist() == [False] + [True] * (len(handles) - 2) + [False]


@pytest.mark.parametrize(
    ("space", "size", "order"), [("plane-stress", 3.0, 2), pytest.param("3d-symmetric", 5.0, 2, marks=pytest.mark.slow)]
)
def test_gradient_passes_the_taylor_test(space, size, order):
    case = leaf((5.0, 2.0), (20.0, 6.0), ends_move=True)
    whole, bench = objective(case, REGULARISER, space=space, size=size, order=order)
    p, direction = bench.design(0.05, seed=5), bench.direction(6)
    here = whole.evaluate(p)
    ahead, back = (whole.evaluate(p + h * direction) for h in (1e-3, -1e-3))
    assert here.gradient @ direction == pytest.approx((ahead.value - back.value) / 2e-3, rel=1e-5)
    rates = taylor_rates(
        lambda h: np.array([whole.evaluate(p + h[0] * direction).value]),
        [0.0],
        [1.0],
        np.array([[here.gradient @ direction]]),
        [0.02, 0.01, 0.005],
    )
    assert rates.with_gradient.min() >= 1.95


@pytest.mark.parametrize("ends_move", [False, True])
def test_a_leaf_reaches_its_targets_and_its_exported_part_does(ends_move, tmp_path):
    case = leaf((5.0, 4.0), (15.0, 11.0), ends_move=ends_move)
    problem = case.problem()
    result = problem.optimise()
    assert result.converged
    assert result.worst_error < 0.01
    assert 1.5 <= result.thickness[0] < result.thickness[1] <= 6.0
    (link,) = result.links
    assert (np.linalg.norm(np.subtract(link.controls[-1][0][:2], TIP)) > 1e-3) == ends_move
    problem.export(tmp_path, result)
    part = fm.step_file(tmp_path / "blade.step", depth=6.0)
    again = part_curve(part, tuple(link.controls[-1][0][:2]))
    assert again == pytest.approx([4.0, 11.0], rel=0.02)


def test_a_result_with_a_moved_end_has_the_same_curve_elsewhere_and_from_a_file(tmp_path):
    case = leaf((5.0, 4.0), (15.0, 11.0), ends_move=True)
    result = case.problem().optimise(optimiser=fm.LevenbergMarquardt(iterations=1))
    assert np.linalg.norm(np.subtract(result.links[0].controls[-1][0][:2], TIP)) > 1e-3
    result.save(tmp_path / "leaf.json")
    simulation, push = case.simulate(), case.scene.mechanism.forces[0]
    for given in (result, fm.DesignResult.load(tmp_path / "leaf.json")):
        curve = simulation.with_design(given).load_displacement(push, forces=[5.0, 15.0])
        assert curve.displacements == pytest.approx([target.reached for target in result.targets], rel=1e-9)
    # files that do not say so are of ends that stay, and have two parameters less
    data = json.loads((tmp_path / "leaf.json").read_text())
    del data["links"][0]["ends_move"]
    (tmp_path / "old.json").write_text(json.dumps(data))
    old = fm.DesignResult.load(tmp_path / "old.json")
    assert old == replace(result, links=(replace(result.links[0], ends_move=False),))
    refused(
        lambda: simulation.with_design(old), part="'leaf'", problem="15 parameters .* instead of 13", remedy="ends_move"
    )


def part_curve(part, tip) -> np.ndarray:
    """Displacements of the tip of a leaf from a file, meshed anew."""
    mechanism = fm.Mechanism("part")
    base = mechanism.rigid("base", fixed=True)
    blade = mechanism.flexible("blade", part, PLASTIC)
    mechanism.weld(base, blade, at=(0, 0), region=fm.Rectangle(8.0, 6.0, np.arctan2(10, 25)))
    push = mechanism.force(on=blade, at=tip, direction=(0, -1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.5, comm=MPI.COMM_SELF)
    return np.array(simulation.load_displacement(push, forces=[5.0, 15.0]).displacements)
