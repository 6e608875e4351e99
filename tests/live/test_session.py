"""Projects, messages and the history of the live page, without a server."""

from __future__ import annotations

import json
from copy import deepcopy

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.live import (
    LARGEST,
    LARGEST_PROJECT,
    Refused,
    Session,
    edited,
    example,
    example_names,
    forces_of,
    load_project,
    read_message,
    read_project,
    script,
)

SLIVER = [[0.0, 0.0], [1e5, 0.0], [1e5, 0.01], [0.0, 0.01]]


@pytest.fixture
def finger():
    return example("truss-finger")


def moved(displacement, *, settled=True):
    change = {"kind": "set", "path": ["targets", 1, "displacement"], "value": displacement}
    return {"kind": "edit", "changes": [change], "settled": settled}


@pytest.mark.parametrize("name", example_names())
def test_examples_are_projects_that_survive_their_file(name, tmp_path):
    project = example(name)
    (tmp_path / "project.json").write_text(json.dumps(project))
    assert load_project(tmp_path / "project.json") == project


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        (["links", 4, "shape", "thickness"], -3.0, "thickness"),
        (["links", 4, "material"], "cheese", "material"),
        (["links", 4, "shape", "line"], [[0, 0]], "line"),
        (["joints", 0, "a"], "nobody", "joints[0].a"),
        (["joints", 4, "region"], None, "joints[4]"),
        (["joints", 0, "at"], [float("nan"), 0], "joints[0].at"),
        (["curves", 0, "largest"], 0.0, "curves[0].largest"),
        (["curves", 0, "steps"], 4000, "curves[0].steps"),
        (["curves", 0, "others"], {"push on tip": 0.1}, "curves[0].others"),
        (["curves", 0, "others"], {"nobody": 0.1}, "curves[0].others"),
        (["links", 4, "material"], {"name": "own", "E": -1.0, "nu": 0.3, "density": None}, "material.E"),
        (["links", 4, "material"], {"name": "own", "E": 2.0, "nu": 0.5, "density": None}, "material.nu"),
        (["links", 4, "design"], {"segments": 21, "thickness": None}, "design.segments"),
        (["effects"], [{"kind": "joint spring", "joint": "nobody", "stiffness": 1.0, "rest": 0}], "effects[0].joint"),
        (["effects"], [{"kind": "joint spring", "joint": "foot", "stiffness": 0.0, "rest": 0}], "effects[0].stiffness"),
        (["targets", 0, "force"], -0.1, "targets[0].force"),
        (["targets", 0, "displacement"], True, "targets[0].displacement"),
        (["targets", 0, "curve"], 3, "targets[0].curve"),
        (["name"], "a\nb", "name"),
        (["format"], "something else", "format"),
        (["simulation", "space"], "4d", "simulation.space"),
        (["simulation", "size"], 0.01, "simulation.size"),
        (["links", 4, "shape", "line"], [[0, 0], [5e4, 5e4]], "simulation.size"),
        (["links", 4, "shape"], {"kind": "polygon", "corners": SLIVER, "depth": 20.0}, "simulation.size"),
    ],
)
def test_a_project_that_is_none_is_refused_with_its_place(finger, path, value, place):
    data = deepcopy(finger)
    at = data
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = value
    with pytest.raises(Refused) as refused:
        read_project(data)
    assert place in refused.value.place


def test_elements_of_single_links_may_not_be_too_small(finger):
    simulation = finger["simulation"]
    finer = {**simulation, "sizes": {"diagonal": 0.05}}
    with pytest.raises(Refused) as refused:
        read_project(finger | {"simulation": finer})
    assert refused.value.place == "simulation.size" and "elements" in refused.value.problem
    assert read_project(finger | {"simulation": finer | {"size": 10.0 * simulation["size"]}})


def filled(finger, left):
    """A project with files of links that leaves so many bytes of the largest one."""
    project = deepcopy(finger)
    own = next(link for link in project["links"] if link["kind"] == "flexible")
    own["shape"] = {"kind": "mesh", "name": "a.msh", "content": "x", "depth": 1.0}
    rest = LARGEST_PROJECT - len(json.dumps(project | {"design": None}, separators=(",", ":")).encode()) - left
    files = [own, *(deepcopy(own) | {"name": f"link {k}"} for k in range(3))]
    rest -= sum(len(json.dumps(file, separators=(",", ":"))) + 1 for file in files[1:])
    for k, file in enumerate(files):
        file["shape"]["content"] = "x" * (1 + rest // 4 + (rest % 4 if k == 0 else 0))
    return {**project, "links": [*project["links"], *files[1:]]}


def test_the_largest_project_is_opened_after_it_was_saved_and_a_larger_one_is_none(finger):
    design = {"offsets": [-1.2345678901234567e-05] * 4800, "handles": [-1.2345678901234567e-05] * 4800}
    largest = filled(finger, 20) | {"design": design}
    session = Session(largest)
    saved = json.loads(json.dumps(session.project, indent=1, ensure_ascii=False))
    message = json.dumps({"kind": "open", "project": saved}, separators=(",", ":"))
    session.answer(read_message(message))
    assert session.project == largest
    with pytest.raises(Refused, match="MB, not at most 2 MB"):
        read_project(filled(finger, -20))


def test_a_design_of_as_many_links_as_a_project_may_have_is_read(finger):
    design = {"offsets": [0.1] * 600, "handles": [1.0] * 2400}
    assert read_project(finger | {"design": design})["design"] == design


def test_a_file_that_holds_no_project_is_refused(tmp_path):
    (tmp_path / "other.json").write_text("[" * 100_000)
    with pytest.raises(DescriptionError, match="not JSON"):
        load_project(tmp_path / "other.json")
    with pytest.raises(DescriptionError, match="no such file"):
        load_project(tmp_path / "none.json")


def test_edits_leave_the_project_that_they_are_given(finger):
    before = deepcopy(finger)
    target = {"curve": 0, "force": 0.2, "displacement": 7.5, "weight": 1.0}
    changes = [{"kind": "insert", "path": ["targets", 0], "value": target}, {"kind": "remove", "path": ["targets", 2]}]
    after = edited(finger, changes)
    assert finger == before
    assert [own["displacement"] for own in after["targets"]] == [7.5, 6.0]


def test_frames_of_a_curve_begin_at_zero_and_hold_its_targets(finger):
    for coarse in (False, True):
        forces = np.array(forces_of(finger, 0, coarse=coarse))
        assert forces[0] == 0.0 and np.all(np.diff(forces) > 0.01) and {0.1, 0.4} <= set(forces)


def test_a_gesture_is_one_step_of_undo_however_often_it_rested(finger):
    session = Session(finger)
    for value in (8.8, 8.3):
        assert session.answer(moved(value, settled=False)).task["fit"]
    session.answer(moved(7.2))
    session.designed({"offsets": [0.5] * 12, "handles": []})
    session.answer({"kind": "undo"})
    assert session.project == finger and not session.can_undo
    session.answer({"kind": "redo"})
    assert session.project["targets"][1]["displacement"] == 7.2
    assert session.project["design"]["offsets"] == [0.5] * 12


def test_what_is_redone_while_a_gesture_lasts_is_undone_to_its_begin(finger):
    session = Session(finger)
    session.answer(moved(7.2))
    session.answer({"kind": "undo"})
    session.answer(moved(8.8, settled=False))
    session.answer({"kind": "redo"})
    assert session.project["targets"][1]["displacement"] == 7.2
    session.answer(moved(6.6))
    for before in (7.2, 9.0):
        session.answer({"kind": "undo"})
        assert session.project["targets"][1]["displacement"] == before


def test_a_gesture_that_is_released_where_it_rested_does_not_begin_its_solve_again(finger):
    session = Session(finger)
    assert session.answer(moved(8.0, settled=False)).task
    session.designed({"offsets": [0.5] * 18, "handles": []})
    released = session.answer(moved(8.0))
    assert released.changed and released.task is None and session.can_undo
    session.answer(moved(7.0, settled=False))
    session.answer({"kind": "stop"})
    assert session.answer(moved(7.0)).task
    session.answer(moved(6.0, settled=False))
    assert session.answer(moved(6.1)).task


def test_a_gesture_is_undone_while_it_lasts(finger):
    session = Session(finger)
    session.answer(moved(8.0, settled=False))
    session.answer({"kind": "undo"})
    assert session.project == finger


def test_a_gesture_that_is_cancelled_leaves_what_was_before_it_and_the_fit_that_it_interrupted(finger):
    session = Session(finger)
    session.answer(moved(7.0))
    session.answer({"kind": "undo"})
    for interrupted in (False, True):
        if interrupted:
            session.answer({"kind": "fit"})
        steps = session.can_undo, session.can_redo
        for value in (8.0, 7.5):
            session.answer(moved(value, settled=False))
        cancelled = session.answer({"kind": "cancel"})
        assert cancelled.changed and cancelled.task["fit"] == interrupted and cancelled.task["project"] == finger
        assert session.project == finger and steps == (session.can_undo, session.can_redo) == (
            interrupted,
            not interrupted,
        )
    session.answer(moved(8.0))
    late = session.answer({"kind": "cancel"})
    assert late.task is None and not late.changed and session.project["targets"][1]["displacement"] == 8.0


def test_a_fit_is_a_step_after_which_nothing_is_redone(finger):
    session = Session(finger)
    session.answer(moved(7.2))
    session.answer({"kind": "undo"})
    session.answer({"kind": "fit"})
    session.designed({"offsets": [0.5] * 12, "handles": []})
    with pytest.raises(Refused, match="nothing"):
        session.answer({"kind": "redo"})
    session.answer({"kind": "undo"})
    assert session.project == finger
    session.answer({"kind": "redo"})
    assert session.project["design"]["offsets"] == [0.5] * 12


def test_a_gesture_whose_page_is_gone_is_settled(finger):
    session = Session(finger)
    assert not session.settle()
    session.answer(moved(8.0, settled=False))
    assert session.settle()
    session.answer(moved(7.0, settled=False))
    session.answer(moved(6.6))
    for before in (8.0, 9.0):
        session.answer({"kind": "undo"})
        assert session.project["targets"][1]["displacement"] == before


def test_shapes_follow_targets_but_not_those_set_by_hand(finger):
    session = Session(finger)
    assert not session.task["fit"]  # the example is finished
    by_hand = {"kind": "set", "path": ["design", "offsets", 0], "value": 0.25}
    assert not session.answer({"kind": "edit", "changes": [by_hand], "settled": True}).task["fit"]
    assert session.answer(moved(8.0)).task["fit"]
    assert session.answer({"kind": "fit"}).task["fit"]
    assert not session.answer({"kind": "undo"}).task["fit"]


def test_what_was_opened_is_what_reset_goes_back_to(finger):
    session, other = Session(finger), edited(finger, moved(5.0)["changes"])
    session.answer({"kind": "open", "project": other})
    session.answer(moved(7.0))
    session.answer({"kind": "reset"})
    assert session.project == other
    for _ in range(3):
        session.answer({"kind": "undo"})
    assert session.project == finger and session.opened == 1 and session.untouched
    session.answer({"kind": "redo"})
    assert session.project == other and session.opened == 2 and session.untouched
    session.answer({"kind": "undo"})
    session.answer(moved(7.0))
    session.answer({"kind": "reset"})
    assert session.project == finger
    session.answer({"kind": "open", "project": other})
    assert session.opened == 3


def test_a_curve_of_a_new_force_is_added_and_removed_with_its_target_and_stands_in_the_script(finger):
    session = Session(finger)
    force = {"name": "force 2", "on": "tip", "at": [10, 65], "direction": [0, -1]}
    curve = {**finger["curves"][0], "name": "curve 2", "force": "force 2"}
    added = [
        {"kind": "insert", "path": ["forces", 1], "value": force},
        {"kind": "insert", "path": ["curves", 1], "value": curve},
    ]
    session.answer({"kind": "edit", "changes": added, "settled": True})
    target = {"curve": 1, "force": 0.2, "displacement": 1.5, "weight": 1.0}
    session.answer(
        {"kind": "edit", "changes": [{"kind": "insert", "path": ["targets", 2], "value": target}], "settled": True}
    )
    assert read_project(json.loads(json.dumps(session.project))) == session.project
    text = script(session.project)
    assert "at=(10, 65), direction=(0, -1)" in text and "curve_1 = sim.load_displacement(" in text
    with pytest.raises(Refused):  # its target needs it
        session.answer({"kind": "edit", "changes": [{"kind": "remove", "path": ["curves", 1]}], "settled": True})
    removed = [{"kind": "remove", "path": [part, k]} for part, k in (("targets", 2), ("curves", 1), ("forces", 1))]
    session.answer({"kind": "edit", "changes": removed, "settled": True})
    assert session.project == finger
    session.answer({"kind": "undo"})
    assert session.project["targets"][2] == target


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no",
        "[]",
        '{"kind": "edit"}',
        '{"kind": "undo", "more": 1}',
        '{"kind": "open", "project": ' + "[" * 50 + "]" * 50 + "}",
        '{"kind": "push", "curve": 0, "force": 1e999}',
        '{"kind": "push", "curve": 0, "force": 1, "at": {"link": "tip", "place": [0]}}',
        '{"kind": "push", "curve": 0, "force": 1, "by": [1, null]}',
        '{"kind": "edit", "changes": [{"kind": "set", "path": [-1], "value": 0}], "settled": true}',
        '{"kind": "edit", "changes": [{"kind": "eval", "path": ["a"], "value": 0}], "settled": true}',
        pytest.param("x" * (LARGEST + 1), id="too large"),
    ],
)
def test_what_is_no_message_is_refused(text):
    with pytest.raises(Refused):
        read_message(text)


@pytest.mark.parametrize(
    "message",
    [
        {"kind": "redo"},
        {"kind": "example", "name": "../../etc/passwd"},
        {"kind": "push", "curve": 3, "force": 1.0},
        {"kind": "push", "curve": 0, "force": 1.0, "at": {"link": "nobody" * 20, "place": [0, 0]}, "by": [1.0, 0.0]},
        {"kind": "open", "project": {"format": "x"}},
        {"kind": "edit", "settled": True, "changes": [{"kind": "set", "path": ["__class__"], "value": 0}]},
        {"kind": "edit", "settled": True, "changes": [{"kind": "remove", "path": ["links", 0]}]},
    ],
)
def test_a_message_that_does_not_fit_changes_nothing(finger, message):
    session = Session(finger)
    with pytest.raises(Refused):
        session.answer(message)
    assert session.project == finger and not session.can_undo
