"""What the solver of the live page computes, in its own process and from its script."""

from __future__ import annotations

import json
import math
import re
import runpy
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fenicsmech as fm
from fenicsmech.live import Solver, edited, example, export, project_of, script


def solved(project, *, fit=False, cancelled=lambda events: False, kind="solve", **more):
    """The events of a task."""
    events: list[dict] = []
    solver = Solver(
        lambda event: events.append(json.loads(json.dumps(event, allow_nan=False))), lambda: cancelled(events)
    )
    solver.run({"task": 1, "kind": kind, "project": project, "fit": fit, **more})
    return events


HELD = {"held": True, "largest": 15.0, "steps": 5}  # mm


def only(events, name):
    return [event for event in events if event["event"] == name]


@pytest.fixture(scope="module")
def finished():
    """The finished example, with coarse elements and few frames, and its events."""
    project = edited(
        example("truss-finger"),
        [
            {"kind": "set", "path": ["curves", 0, "steps"], "value": 4},
            {"kind": "set", "path": ["simulation", "order"], "value": 1},
        ],
    )
    return project, solved(project)


@pytest.mark.thorough
def test_the_linear_preview_is_the_derivative_of_the_curve(finished):
    project, events = finished
    (linear,), (curve,) = only(events, "linear"), only(events, "curve")
    assert linear["whole"]
    own = linear["curves"][0]
    values = [point["displacement"] for point in curve["points"][1:]]
    assert own["values"] == pytest.approx(values, rel=1e-4)
    step = 1e-3 * np.random.default_rng(1).normal(size=len(linear["lengths"])) * linear["lengths"]
    moved = []
    for sign in (-1.0, 1.0):
        offsets = (np.array(project["design"]["offsets"]) + sign * step).tolist()
        at = edited(project, [{"kind": "set", "path": ["design", "offsets"], "value": offsets}])
        moved.append([point["displacement"] for point in only(solved(at), "curve")[0]["points"][1:]])
    change = 0.5 * (np.array(moved[1]) - moved[0])
    assert np.array(own["jacobian"])[:, : len(step)] @ step == pytest.approx(
        change, rel=0.02, abs=0.02 * np.abs(change).max()
    )


def displacements(project):
    """Of the first curve, from its second frame on."""
    return np.array([point["displacement"] for point in only(solved(project), "curve")[0]["points"][1:]])


@pytest.mark.thorough
def test_the_linear_preview_of_a_joint_is_that_of_the_mechanism_drawn_there(finished):
    project, events = finished
    (linear,), moved = only(events, "linear"), []
    column = linear["moves"].index({"kind": "joint", "joints": [3, 5], "axis": 0}) + len(linear["lengths"])
    for x in (-0.2, 0.2):
        changes = [{"kind": "set", "path": ["joints", k, "at"], "value": [40 + x, 60]} for k in (3, 5)]
        bend = np.hypot(18, 34) / (np.hypot(18, 34) + np.hypot(22, 26))
        line = [[0, 0], [18 + bend * x, 34], [40 + x, 60]]
        changes.append({"kind": "set", "path": ["links", 4, "shape", "line"], "value": line})
        moved.append(displacements(edited(project, changes)))
    slope = np.array(linear["curves"][0]["jacobian"])[:, column]
    assert slope == pytest.approx((moved[1] - moved[0]) / 0.4, rel=0.05)
    controls = np.array(linear["links"][0]["follows"])[..., linear["moves"].index(linear["moves"][0])]
    assert controls[:, 0, 0] == pytest.approx([1, 2 / 3, 1 / 3, 0])  # with the foot along x


@pytest.mark.thorough
def test_the_linear_preview_of_a_motor_is_that_of_the_mechanism_turned():
    project = edited(
        example("four-bar-with-a-motor"),
        [
            {"kind": "set", "path": ["curves", 0, "steps"], "value": 2},
            {"kind": "set", "path": ["simulation", "order"], "value": 1},
        ],
    )
    events = solved(project)
    (linear,), moved, begins = only(events, "linear"), [], []
    ((name, rates),) = only(events, "responses")[0]["motors"].items()
    column = linear["moves"].index({"kind": "motor", "name": name}) + len(linear["lengths"])
    at = project["curves"][0]["positions"].get(name, 0.0)
    for turn in (-0.05, 0.05):
        change = {"kind": "set", "path": ["curves", 0, "positions"], "value": {name: at + turn}}
        points = only(solved(edited(project, [change])), "curve")[0]["points"]
        moved.append(np.array([point["displacement"] for point in points[1:]]))
        begins.append(every(points[0]))
    slope = np.array(linear["curves"][0]["jacobian"])[:, column]
    assert slope == pytest.approx((moved[1] - moved[0]) / 0.1, rel=0.01)
    rate = (begins[1] - begins[0]) / 0.1
    assert every(rates) == pytest.approx(rate, abs=0.01 * np.abs(rate).max())


def drawn(project):
    """The project with its links as drawn."""
    return edited(project, [{"kind": "set", "path": ["design"], "value": None}])


@pytest.fixture(scope="module")
def bare(finished):
    """The project with its links as drawn, and the points of its curve."""
    project = drawn(finished[0])
    return project, only(solved(project), "curve")[0]["points"]


@pytest.mark.thorough
def test_a_material_of_its_own_of_twice_the_modulus_bears_twice_the_force(bare):
    soft, points = bare
    own = {"name": "own", "E": 3.8, "nu": 0.475, "density": None}  # that of the example has 1.9
    changes = [
        {"kind": "set", "path": ["links", 4, "material"], "value": own},
        {"kind": "set", "path": ["curves", 0, "largest"], "value": 2 * soft["curves"][0]["largest"]},
        *({"kind": "set", "path": ["targets", k, "force"], "value": force} for k, force in enumerate((0.2, 0.8))),
    ]
    expected = [point["displacement"] for point in points[1:]]
    assert displacements(edited(soft, changes)) == pytest.approx(expected, rel=1e-5)


@pytest.mark.thorough
def test_plane_strain_is_stiffer_than_plane_stress_as_plates_are_than_beams(finished):
    project = edited(drawn(finished[0]), [{"kind": "set", "path": ["curves", 0, "largest"], "value": 0.002}])
    order = {"kind": "set", "path": ["simulation", "order"], "value": 2}  # the first is too stiff in bending
    project = edited(project, [*[{"kind": "remove", "path": ["targets", 0]}] * 2, order])
    strain = edited(project, [{"kind": "set", "path": ["simulation", "space"], "value": "plane-strain"}])
    nu = 0.475
    assert displacements(project) / displacements(strain) == pytest.approx(1.0 / (1.0 - nu**2), rel=0.03)


@pytest.mark.thorough
def test_a_spring_of_a_joint_bears_its_part_of_the_force(bare):
    (project, without), stiffness, height = bare, 200.0, 60.0  # N mm/rad, mm
    spring = {"kind": "joint spring", "joint": "foot of left leg", "stiffness": stiffness, "rest": 0.0}
    sprung = edited(project, [{"kind": "insert", "path": ["effects", 0], "value": spring}])
    points = only(solved(sprung), "curve")[0]["points"]
    for point in (points[1], points[-1]):
        angle = np.arcsin(point["displacement"] / height)  # of the legs: work k φ dφ = F du, u = h sin φ
        share = stiffness * angle / (height * np.cos(angle))
        alone = solved(project, kind="push", curve=0, force=point["force"] - share, at=None, by=[0.0, 0.0])
        assert only(alone, "pushed")[0]["point"]["displacement"] == pytest.approx(point["displacement"], rel=1e-4)
    assert points[-1]["displacement"] < 0.95 * without[-1]["displacement"]


@pytest.mark.thorough
def test_a_constant_force_along_that_of_a_curve_adds_to_it(finished):
    project = drawn(finished[0])
    other = {"name": "constant", "on": "tip", "at": [5, 62], "direction": [1, 0]}
    changes = [
        {"kind": "insert", "path": ["forces", 1], "value": other},
        {"kind": "set", "path": ["curves", 0, "others"], "value": {"constant": 0.1}},
    ]
    (curve,) = only(solved(edited(project, changes)), "curve")
    longer = [
        {"kind": "set", "path": ["curves", 0, key], "value": own} for key, own in (("largest", 0.5), ("steps", 5))
    ]
    (alone,) = only(solved(edited(project, longer)), "curve")
    for point, other in zip(curve["points"], alone["points"][1:], strict=True):
        assert other["force"] == pytest.approx(point["force"] + 0.1)
        assert point["displacement"] == pytest.approx(other["displacement"], rel=1e-5)  # the tip is not turned


@pytest.mark.thorough
def test_links_that_keep_their_shape_have_no_parameters_and_those_that_change_it_as_many_as_their_segments_need(
    finished,
):
    (project, events), found = finished, []
    for design in (None, {"segments": 2, "thickness": None}):
        own = edited(drawn(project), [{"kind": "set", "path": ["links", 4, "design"], "value": design}])
        found.append([len(event["lengths"]) for event in only(solved(own), "linear")])
    found.append([len(event["lengths"]) for event in only(events, "linear")])  # of three segments
    assert found == [[], [12], [18]]


@pytest.mark.thorough
def test_a_new_gesture_ends_an_optimisation_at_its_next_iterate(finished):
    project, _ = finished
    other = edited(project, [{"kind": "set", "path": ["targets", 1, "displacement"], "value": 7.5}])
    events = solved(other, fit=True, cancelled=lambda events: len(only(events, "iterate")) >= 2)
    assert len(only(events, "iterate")) == 2 and events[-1]["event"] == "cancelled"


@pytest.mark.thorough
def test_a_task_ends_where_it_is_cancelled_and_leaves_no_trace(finished):
    order = {"kind": "set", "path": ["simulation", "order"], "value": 2}  # it follows in fewer iterations
    project = edited(finished[0], [order])
    before = solved(project)
    other = edited(project, [{"kind": "set", "path": ["targets", 1, "displacement"], "value": 8.0}])
    events: list[dict] = []
    asked, last = 0, math.inf

    def cancelled():
        nonlocal asked
        asked += 1
        return asked >= last

    def fresh():  # one that has done tasks before keeps equilibria, and asks less often
        nonlocal asked
        asked = 0
        events.clear()
        return Solver(events.append, cancelled)

    fresh().run({"task": 1, "kind": "solve", "project": other, "fit": True})
    whole = asked
    assert only(events, "linear") and whole > 100  # factors of Newton's iterations, adjoints and estimates
    for share in (0.02, 0.5, 0.97):
        last, solver = int(share * whole), fresh()
        solver.run({"task": 2, "kind": "solve", "project": other, "fit": True})
        assert asked == last and events[-1]["event"] == "cancelled"
        last = math.inf
        events.clear()
        solver.run({"task": 3, "kind": "solve", "project": project, "fit": False})
        assert results(events) == pytest.approx(results(before), rel=1e-4)


def results(events):
    """Displacements of the curve, their errors and derivatives."""
    (curve,), (errors,), (linear,) = (only(events, name) for name in ("curve", "errors", "linear"))
    displacements = [point["displacement"] for point in curve["points"]]
    return np.concatenate([displacements, errors["errors"], np.ravel(linear["curves"][0]["jacobian"])])


def test_a_mechanism_that_cannot_be_is_told_and_the_solver_goes_on(finished):
    project, events = finished
    apart = edited(project, [{"kind": "set", "path": ["joints", 5, "at"], "value": [80, 90]}])
    (failed,) = only(solved(apart), "failed")
    assert failed["problem"] and failed["remedy"]


@pytest.mark.thorough
def test_a_snap_is_told_with_its_force_and_the_preview_ends_before_it():
    change = {"kind": "set", "path": ["simulation", "order"], "value": 1}
    events = solved(edited(example("snapping-switch"), [change]))
    (curve,), (linear,) = only(events, "curve"), only(events, "linear")
    (before, after) = next(pair for pair in pairwise(curve["points"]) if pair[1]["snapped"])
    assert after["displacement"] > 5.0 * before["displacement"]
    assert "snaps after force" in curve["remarks"][0] and curve["failed"] is None
    assert "Make the largest force smaller" in curve["remarks"][0]
    assert not linear["whole"] and linear["curves"][0]["at"][-1] == before["force"]
    # the curve is that of the drawn strip, the preview that of its spline
    assert linear["curves"][0]["values"][-1] == pytest.approx(before["displacement"], rel=0.02)


def test_an_unstable_part_is_told_with_its_remedy_and_ends_the_preview():
    change = {"kind": "set", "path": ["simulation", "order"], "value": 1}
    held = {"kind": "set", "path": ["curves", 0], "value": {**example("snapping-switch")["curves"][0], **HELD}}
    clear = [{"kind": "remove", "path": ["targets", 0]}] * len(example("snapping-switch")["targets"])
    events = solved(edited(example("snapping-switch"), [change, *clear, held]))
    (curve,) = only(events, "curve")
    assert not all(point["stable"] for point in curve["points"])
    assert "unstable under dead loads. What is dashed stays only where" in curve["remarks"][-1]


@pytest.mark.thorough
def test_a_target_out_of_reach_is_told_with_its_reason_remedy_and_bounds():
    beam = fm.Mechanism("beam")
    ground = beam.rigid("ground", fixed=True)
    leaf = beam.flexible("leaf", fm.strip([(0, 0), (40, 0)], thickness=2.0, depth=5.0), fm.ONYX)
    beam.weld(ground, leaf, at=(0, 0), interface_radius=2.0)
    pull = beam.force(on=leaf, at=(40, 0), direction=(0, 1))
    sim = fm.Simulation(fm.Scene(beam), space="plane-stress", size=2.0, order=1)
    design, target = fm.SplineDesign(leaf, 1, thickness=(1.9, 2.1)), fm.Target(pull, force=0.1, displacement=0.05)
    events = solved(project_of(fm.DesignProblem(sim, [design], targets=[target])), fit=True)
    (fitted,), (linear,) = only(events, "fitted"), only(events, "linear")
    missed = fitted["missed"]
    assert "targets are missed by up to" in missed["problem"] and "Relax a target" in missed["remedy"]
    assert any("thickness" in bound for bound in linear["active"])


@pytest.mark.thorough
def test_both_configurations_of_a_motor_follow_their_targets():
    project = edited(
        example("four-bar-with-a-motor"),
        [
            {"kind": "set", "path": ["curves", 0, "steps"], "value": 2},
            {"kind": "set", "path": ["curves", 1, "steps"], "value": 2},
        ],
    )
    events = solved(project, fit=True)
    assert max(map(abs, only(events, "fitted")[0]["misfits"])) < 0.01
    assert {event["curve"] for event in only(events, "curve") if event["iterate"] is None} == {0, 1}


def test_a_solve_whose_time_is_over_keeps_the_last_iterate_and_tells_its_reason_and_remedy(finished, monkeypatch):
    project, _ = finished
    other = edited(project, [{"kind": "set", "path": ["targets", 1, "displacement"], "value": 7.5}])
    events, now = [], time.perf_counter

    def late():
        return now() + 1000.0 * (len(only(events, "iterate")) > 1)

    monkeypatch.setattr(sys.modules["fenicsmech.live.solver"], "perf_counter", late)
    solver = Solver(events.append)
    solver.run({"task": 1, "kind": "solve", "project": other, "fit": True, "longest": 600.0})
    failed, iterates = events[-1], only(events, "iterate")
    assert len(iterates) == 2 and iterates[-1]["design"]["offsets"] != project["design"]["offsets"]
    assert failed["part"] == "time limit" and "longer than 600 s" in failed["problem"]
    assert "larger elements" in failed["remedy"]
    events.clear()
    solver.run(
        {
            "task": 2,
            "kind": "push",
            "curve": 0,
            "force": 0.2,
            "at": None,
            "by": [0.0, 0.0],
            "project": project,
            "fit": False,
        }
    )
    assert events[-1]["event"] == "done"


def push(project, force, at=None, by=(0.0, 0.0)):
    """The answer to a push."""
    (pushed,) = only(solved(project, kind="push", curve=0, force=force, at=at, by=list(by)), "pushed")
    return pushed


def test_a_push_moves_as_far_as_the_curve_says(finished):
    project, events = finished
    pushed = push(project, 0.2)
    points = only(events, "curve")[0]["points"]
    expected = next(point["displacement"] for point in points if point["force"] == pytest.approx(0.2))
    assert pushed["point"]["displacement"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "held",
    [
        pytest.param({"link": "diagonal", "place": [20.0, 30.0]}, id="flexible link"),
        pytest.param({"link": "tip", "place": [10.0, 66.0]}, id="rigid link", marks=pytest.mark.thorough),
    ],
)
def test_the_preview_of_a_push_at_any_point_misses_its_solve_by_the_square_of_the_push(finished, held):
    project, _ = finished
    start, missed = push(project, 0.1, held), []
    for size in (0.04, 0.02):  # N
        by = np.array([0.6, -0.8]) * size
        end = push(project, 0.1, held, by)
        assert end["by"] == by.tolist() and end["point"]["force"] == 0.1
        wanted, linear, before = (every(own) for own in (end["point"], start["rates"], start["point"]))
        moved = np.array([by[0] * along + by[1] * across for along, across in zip(*linear, strict=True)])
        missed.append(np.abs(before + moved - wanted).max())
        assert missed[-1] < 0.2 * np.abs(wanted - before).max()
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.2)


def by_force(linear, name, axis=None):
    """The derivative of the displacement at the end of the curve by a force's angle, or by its point along an axis."""
    move = {"kind": "direction", "name": name} if axis is None else {"kind": "force", "name": name, "axis": axis}
    return linear["curves"][0]["jacobian"][-1][len(linear["lengths"]) + linear["moves"].index(move)]


def with_force(project, **changes):
    """The project with its force elsewhere."""
    return edited(project, [{"kind": "set", "path": ["forces", 0], "value": project["forces"][0] | changes}])


def test_the_preview_of_a_direction_that_is_dragged_misses_its_solve_by_the_square_of_the_drag(finished):
    project, events = finished
    rate, before, missed = (
        by_force(only(events, "linear")[0], "push on tip"),
        only(events, "curve")[0]["points"][-1],
        [],
    )
    for angle in (0.06, 0.03):
        moved = with_force(project, direction=[np.cos(angle), np.sin(angle)])
        change = push(moved, before["force"])["point"]["displacement"] - before["displacement"]
        missed.append(abs(angle * rate - change))
        assert missed[-1] < 0.3 * abs(change)
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.1)


def test_the_preview_of_a_point_on_a_rigid_link_that_is_dragged_misses_its_solve_by_the_square_of_the_drag(finished):
    project, missed = with_force(finished[0], on="left leg", at=[0, 50]), []
    events = solved(project)
    rate, before = by_force(only(events, "linear")[0], "push on tip", 1), only(events, "curve")[0]["points"][-1]
    for shift in (6.0, 3.0):
        moved = with_force(project, at=[0, 50 + shift])
        change = push(moved, before["force"])["point"]["displacement"] - before["displacement"]
        missed.append(abs(shift * rate - change))
        assert missed[-1] < 0.2 * abs(change)
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.thorough
def test_the_preview_of_a_point_on_a_flexible_link_is_the_slope_of_the_solves_beside_it(finished):
    project = with_force(finished[0], on="diagonal", at=[18, 34], direction=[0.88, -0.47])
    along, step, moved = np.array([0.47, 0.88]), 0.05, []
    (linear,) = only(solved(project), "linear")
    for sign in (-1.0, 1.0):
        at = np.array([18, 34]) + sign * step * along
        moved.append(push(with_force(project, at=at.tolist()), 0.4)["point"]["displacement"])
    rate = [by_force(linear, "push on tip", axis) for axis in (0, 1)] @ along
    assert rate == pytest.approx((moved[1] - moved[0]) / (2.0 * step), rel=0.02)


@pytest.mark.thorough
def test_the_preview_where_displacements_are_held_is_the_slope_of_the_forces(finished):
    project = finished[0] | {"targets": []}
    project = edited(project, [{"kind": "set", "path": ["curves", 0], "value": finished[0]["curves"][0] | HELD}])
    angle, forces = 0.02, []
    (linear,) = only(solved(project), "linear")
    for sign in (-1.0, 1.0):
        moved = with_force(project, direction=[np.cos(angle), sign * np.sin(angle)])
        forces.append(only(solved(moved), "curve")[0]["points"][-1]["force"])
    assert by_force(linear, "push on tip") == pytest.approx((forces[1] - forces[0]) / (2.0 * angle), rel=0.02)
    assert linear["curves"][0]["at"][-1] == HELD["largest"]


@pytest.mark.thorough
def test_a_force_over_a_region_has_a_direction_to_drag_and_no_point(finished):
    region = {"is": "Disc", "radius": 1.0}
    project = with_force(finished[0], on="diagonal", at=[18, 34], region=region)
    kinds = {move["kind"] for move in only(solved(project), "linear")[0]["moves"]}
    assert kinds == {"joint", "direction"}


def every(found):
    """All coordinates of a point, or of each of some rates."""
    if isinstance(found, list):
        return [every(own) for own in found]
    return np.concatenate([np.ravel(own) for own in (*found["nodes"], *found["rigid"], found["pins"])])


@pytest.mark.parametrize("aimed", [pytest.param(True, id="with targets"), pytest.param(False, id="without")])
def test_the_script_of_a_project_computes_its_curve(finished, aimed, tmp_path, monkeypatch):
    project, events = finished
    if not aimed:
        project = edited(project, [{"kind": "remove", "path": ["targets", 0]}] * 2)
    (tmp_path / "design.py").write_text(script(project))
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path("design.py")
    points = only(events, "curve")[0]["points"]
    assert names["curve_0"].displacements == pytest.approx([point["displacement"] for point in points], rel=1e-4)
    assert (tmp_path / "links" / "diagonal.step").exists() and (tmp_path / "curve-0.png").exists()


@pytest.mark.thorough
@pytest.mark.parametrize(
    "what, names",
    [
        ("stl", ["diagonal.stl"]),
        ("step", ["diagonal.step"]),
        ("png", ["curve.png", "mechanism.png"]),
        ("animation", ["animation.gif"]),
    ],
)
def test_a_project_is_exported_as_files_that_others_read(finished, what, names, tmp_path):
    project, events = finished
    paths = export(project, what, tmp_path)
    assert [path.name for path in paths] == names
    if what == "stl":  # a header, and fifty bytes a facet
        assert (paths[0].stat().st_size - 84) % 50 == 0 and paths[0].stat().st_size > 5000
    elif what == "step":
        assert paths[0].read_text().startswith("ISO-10303-21")
    else:
        there_and_back = 2 * len(only(events, "curve")[0]["points"]) - 2
        for path in paths:
            with Image.open(path) as picture:
                assert min(picture.size) > 200
                assert picture.format != "GIF" or picture.n_frames == there_and_back


@pytest.mark.thorough
def test_pictures_and_animations_are_made_of_every_curve(tmp_path):
    project = example("four-bar-with-a-motor")
    project = edited(project, [{"kind": "set", "path": ["curves", k, "steps"], "value": 2} for k in range(2)])
    for what, names in (
        ("png", ["curve-1.png", "mechanism-1.png", "curve-2.png", "mechanism-2.png"]),
        ("animation", ["animation-1.gif", "animation-2.gif"]),
    ):
        paths = export(project, what, tmp_path)
        assert [path.name for path in paths] == names
        assert len({path.read_bytes() for path in paths}) == len(paths)


def test_names_of_links_lead_to_files_of_the_folder_alone(finished, tmp_path):
    project = json.loads(json.dumps(finished[0]).replace('"diagonal"', json.dumps(f"../{tmp_path}/diagonal")))
    folder = tmp_path / "files"
    folder.mkdir()
    for what in ("step", "dxf"):
        (path,) = export(project, what, folder)
        assert path.parent == folder
    assert list(tmp_path.iterdir()) == [folder] and {path.parent for path in tmp_path.rglob("*.*")} == {folder}


def test_names_of_a_project_cannot_put_code_into_its_script(finished, tmp_path):
    project, _ = finished
    name = '"""+__import__("os").system("x")+"""'
    hostile = edited(project, [{"kind": "set", "path": ["name"], "value": name}])
    for k in range(len(project["links"])):
        hostile["links"][k]["name"] += " \\' import os"
    compiled = compile(script(hostile | {"joints": [], "forces": [], "curves": [], "targets": []}), "design.py", "exec")
    assert "system" not in compiled.co_names and "__import__" not in compiled.co_names


def test_parts_of_one_name_are_different_variables_of_the_script():
    project = example("truss-finger")
    project["joints"][0]["name"] = project["joints"][1]["name"].upper()  # one spelling as variables
    project["joints"][2]["name"] = "diagonal"  # as a link
    variables = re.findall(r"^(part_\w+) = ", script(project), re.MULTILINE)
    assert len(variables) == len(set(variables)) == sum(len(project[own]) for own in ("links", "joints", "forces"))


def test_an_outline_is_exported_as_dxf_in_its_place(finished, tmp_path):
    project, _ = finished
    (path,) = export(project, "dxf", Path(tmp_path))
    lines = path.read_text().split("\n")
    points = np.array([[lines[k + 4], lines[k + 6]] for k, line in enumerate(lines) if line == "VERTEX"], dtype=float)
    assert lines[-3:] == ["0", "EOF", ""] and len(points) > 50
    assert points.min(axis=0) == pytest.approx([-3.0, -3.0], abs=0.3) and points.max(axis=0) == pytest.approx(
        [43.0, 63.0], abs=0.3
    )
