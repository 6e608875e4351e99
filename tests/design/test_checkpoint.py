"""Checkpoint files: complete or not there, and never taken for those of another problem."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import Checkpoint, Evaluation, Iterate, LevenbergMarquardt, Quadratic, Reason, Round

PROBLEM = {"mechanism": "finger", "sizes": [2.0, 3.0], "targets": [["push", "as drawn", 0.1, 6.0, 1.0]]}
HANDLES = np.array([0.0, 1.0 / 3.0, 2.0])
ROUND = Round(True, (0.1 / 3.0, -2.0), (7.0 / 3.0,), (0.1,), (2.0, 3.0), 1.0 / 7.0)


def iterate(number: int = 3, reason: Reason | None = None) -> Iterate:
    """With numbers that decimal fractions do not hold."""
    parameters = np.random.default_rng(number).standard_normal(5) / 3.0
    here = Evaluation(parameters, np.ones(2) / 7.0, np.zeros((2, 5)), lambda p: Quadratic.zero(5))
    return Iterate(number, 2 * number, here, np.array([1e-2 / 3.0, 1.0]), 0.1, reason)


def checkpoint(folder: Path, **changes) -> Checkpoint:
    return Checkpoint(folder / "checkpoint.json", {**PROBLEM, **changes})


def test_a_saved_checkpoint_is_read_back_bitwise(tmp_path):
    saved, there = iterate(), checkpoint(tmp_path)
    there.save(saved, HANDLES, ROUND, LevenbergMarquardt())
    back = there.load()
    assert np.array_equal(back.start.parameters, saved.evaluation.parameters)
    assert np.array_equal(back.start.memory, saved.memory)
    assert (back.start.number, back.start.evaluations) == (saved.number, saved.evaluations)
    assert np.array_equal(back.handles, HANDLES)
    assert back.round == ROUND and back.ended is None


def test_the_end_of_a_round_is_saved_with_its_optimiser(tmp_path):
    there = checkpoint(tmp_path)
    there.save(iterate(3, Reason.CONVERGED), HANDLES, ROUND, LevenbergMarquardt())
    assert there.load().ended == ("CONVERGED", repr(LevenbergMarquardt()))


def test_the_last_iterate_replaces_those_before_it_and_leaves_nothing_beside_it(tmp_path):
    there = checkpoint(tmp_path / "new folder")
    for number in range(4):
        there.save(iterate(number), HANDLES, ROUND, LevenbergMarquardt())
    assert there.load().start.number == 3
    assert [file.name for file in there.path.parent.iterdir()] == ["checkpoint.json"]


def test_an_interrupted_save_leaves_the_checkpoint_before_it(tmp_path, monkeypatch):
    there = checkpoint(tmp_path)
    there.save(iterate(1), HANDLES, ROUND, LevenbergMarquardt())

    def full(*arguments):
        raise OSError("no space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="no space"):
        there.save(iterate(2), HANDLES, ROUND, LevenbergMarquardt())
    assert there.load().start.number == 1
    assert [file.name for file in tmp_path.iterdir()] == ["checkpoint.json"]


def test_a_truncated_file_beside_it_does_no_harm(tmp_path):
    there = checkpoint(tmp_path)
    there.save(iterate(1), HANDLES, ROUND, LevenbergMarquardt())
    # what a process leaves that was killed while it wrote
    (tmp_path / ".checkpoint.json.0123456789ab.tmp").write_bytes(there.path.read_bytes()[:40])
    assert there.load().start.number == 1
    there.save(iterate(2), HANDLES, ROUND, LevenbergMarquardt())
    assert there.load().start.number == 2


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"sizes": [2.0, 2.5]}, ["sizes"]),
        ({"mechanism": "claw"}, ["mechanism"]),
        ({"targets": [["push", "as drawn", 0.1, 6.5, 1.0]], "mechanism": "claw"}, ["mechanism", "targets"]),
        ({"order": 2}, ["order"]),
    ],
)
def test_checkpoints_of_another_problem_are_refused_and_the_difference_is_named(tmp_path, changes, names):
    checkpoint(tmp_path).save(iterate(), HANDLES, ROUND, LevenbergMarquardt())
    with pytest.raises(fm.DescriptionError, match="another problem") as caught:
        checkpoint(tmp_path, **changes).load()
    for key in {**PROBLEM, **changes}:
        assert (key in caught.value.problem) == (key in names)
    assert "checkpoint.json" in caught.value.part
    assert "Resume with" in caught.value.remedy


def test_tuples_of_a_problem_are_those_of_its_file(tmp_path):
    there = checkpoint(tmp_path, sizes=(2.0, 3.0))
    there.save(iterate(), HANDLES, ROUND, LevenbergMarquardt())
    assert there.load().start.number == 3


@pytest.mark.parametrize(
    "content",
    [b"", b"not a checkpoint", b"[1, 2]", b'{"format": "fenicsmech design 1"}', b"\xff\xfe\x00binary", b'{"format": 3'],
)
def test_a_file_that_is_not_a_checkpoint_is_refused(tmp_path, content):
    there = checkpoint(tmp_path)
    there.path.write_bytes(content)
    with pytest.raises(fm.DescriptionError, match="does not hold a checkpoint"):
        there.load()


def test_truncated_checkpoints_are_refused(tmp_path):
    there = checkpoint(tmp_path)
    there.save(iterate(), HANDLES, ROUND, LevenbergMarquardt())
    there.path.write_bytes(there.path.read_bytes()[:-5])
    with pytest.raises(fm.DescriptionError, match="does not hold a checkpoint"):
        there.load()


def test_missing_checkpoints_are_refused(tmp_path):
    with pytest.raises(fm.DescriptionError, match="no such file"):
        checkpoint(tmp_path).load()


def test_the_file_is_plain_data(tmp_path):
    there = checkpoint(tmp_path)
    there.save(iterate(), HANDLES, ROUND, LevenbergMarquardt())
    data = json.loads(there.path.read_text())
    assert data["format"].startswith("fenicsmech checkpoint")
    assert data["number"] == 3
    assert data["objective"] == pytest.approx(iterate().evaluation.value)
