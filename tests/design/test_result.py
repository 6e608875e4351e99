"""Results as files: nothing is lost, and nothing else is taken for one."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.design import DesignResult, LinkDesign, NumberDesign, TargetResult


def link(name: str, thickness: tuple[float, float]) -> LinkDesign:
    """With numbers that decimal fractions do not hold."""
    random = np.random.default_rng(len(name))
    return LinkDesign(
        name,
        parameters=tuple((random.standard_normal(4) / 3.0).tolist()),
        handles=(0.0, 1.0 / 3.0, 1.0),
        controls=tuple(tuple(map(tuple, point)) for point in random.standard_normal((3, 2, 3)).tolist()),
        thickness=thickness,
        bend=0.01 / 3.0,
    )


RESULT = DesignResult(
    mechanism="Zange “ß”",
    links=(link("coupler", (1.0 / 3.0, 2.0)), link("rocker", (0.7, 4.1))),
    numbers=(NumberDesign("depth of 'rocker'", "Depth", ("rocker",), 10.0 / 3.0, 4.0, (1.0, 7.1), "mm"),),
    targets=(
        TargetResult(
            *("displacement of 'push' under 'push' of 0.1, as drawn", "as drawn", 0.1, "mm", "equals"),
            *(2.0, 0.3, 1.99, 1e-3 / 3.0, 1.99 + 1e-3 / 3.0, -0.005),
        ),
        TargetResult(
            *("displacement of 'tip' at (1, 2) under 'push' of 0.4, geöffnet", "geöffnet", 0.4, "mm", "equals"),
            *((0.0, 0.2), (0.3, 0.1), (0.02, 0.2), (0.005, 0.0), (0.025, 0.2), 0.1),
        ),
        TargetResult("mass of all links", "", None, "N s²/mm", "least", None, 0.3, 0.2, 0.0, 0.2, 0.0),
    ),
    reason="a minimum was found",
    converged=True,
    verified=True,
    active=("least thickness 0.7 of 'rocker'",),
    objective=(0.4 / 7.0, 1e-17 / 3.0),
    objective_error=1e-5 / 3.0,
    surrogate="plane-stress",
    corrections=(0.1 / 3.0, 1e-4),
    iterations=7,
    evaluations=9,
    mesh_ratio_max=4.0 / 3.0,
    seconds=0.1,
    phases={"setup": 0.1 / 3.0},
    processes=2,
    groups=2,
)


@pytest.mark.parallel
def test_all_processes_save_one_file(shared_tmp_path):
    RESULT.save(shared_tmp_path / "design.json")
    assert DesignResult.load(shared_tmp_path / "design.json") == RESULT
    with pytest.raises(OSError, match="design.json"):
        RESULT.save(shared_tmp_path / "design.json" / "another.json")
    assert [path.name for path in shared_tmp_path.iterdir()] == ["design.json"]


def test_a_saved_design_is_read_back_equal(tmp_path):
    path = tmp_path / "new folder" / "design.json"
    RESULT.save(path)
    assert DesignResult.load(path) == RESULT
    assert DesignResult.load(str(path)) == RESULT


def test_the_file_is_plain_data_that_people_can_read(tmp_path):
    path = tmp_path / "design.json"
    RESULT.save(path)
    text = path.read_text(encoding="utf-8")
    assert "Zange “ß”" in text
    data = json.loads(text)
    assert data["links"][0]["controls"][0][0] == list(RESULT.links[0].controls[0][0])
    assert data["targets"][1]["wanted"] == [0.0, 0.2]


def test_an_interrupted_save_leaves_the_result_before_it(tmp_path, monkeypatch):
    path = tmp_path / "design.json"
    RESULT.save(path)

    def full(*arguments):
        raise OSError("no space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="no space"):
        replace(RESULT, iterations=8).save(path)
    assert DesignResult.load(path) == RESULT
    assert [file.name for file in tmp_path.iterdir()] == ["design.json"]


def test_summaries_look_at_all_links_and_targets():
    assert RESULT.worst_error == 0.1
    assert RESULT.thickness == (1.0 / 3.0, 4.1)
    assert RESULT.parameters == 9


@pytest.mark.parametrize(
    "content", [b"", b"junk", b"[]", b"{}", b'{"format": "fenicsmech checkpoint 1"}', b"\xff\xfebinary", b'{"format"']
)
def test_a_file_that_is_not_a_design_is_refused(tmp_path, content):
    path = tmp_path / "junk.json"
    path.write_bytes(content)
    with pytest.raises(fm.DescriptionError, match="does not hold a design") as caught:
        DesignResult.load(path)
    assert "junk.json" in caught.value.part


def test_missing_files_are_refused(tmp_path):
    with pytest.raises(fm.DescriptionError, match="no such file"):
        DesignResult.load(tmp_path / "nothing.json")


@pytest.mark.parametrize("missing", ["links", "targets", "objective", "iterations"])
def test_files_that_lack_something_are_refused(tmp_path, missing):
    path = tmp_path / "design.json"
    RESULT.save(path)
    data = json.loads(path.read_text(encoding="utf-8"))
    del data[missing]
    path.write_text(json.dumps(data))
    with pytest.raises(fm.DescriptionError, match="incomplete") as caught:
        DesignResult.load(path)
    assert missing in str(caught.value)


@pytest.mark.parametrize("part", ["links", "targets"])
def test_files_whose_parts_lack_something_are_refused(tmp_path, part):
    path = tmp_path / "design.json"
    RESULT.save(path)
    data = json.loads(path.read_text(encoding="utf-8"))
    data[part][0] = {"name": "coupler"}
    path.write_text(json.dumps(data))
    with pytest.raises(fm.DescriptionError, match="incomplete"):
        DesignResult.load(path)


def test_a_result_prints_how_far_each_target_is_reached():
    first, *rows = str(RESULT).splitlines()
    assert "'Zange “ß”' after 7 iterations: a minimum was found" in first
    assert rows == [
        "  displacement of 'push' under 'push' of 0.1, as drawn: 1.99 mm of 2 mm, met (-0.50%)",
        "  displacement of 'tip' at (1, 2) under 'push' of 0.4, geöffnet: (0.025, 0.2) mm of (0, 0.2) mm, "
        "missed (+10.00%)",
        "  mass of all links: 0.2 N s²/mm, from 0.3 N s²/mm",
        "  depth of 'rocker': 3.33333 mm, drawn with 4 mm",
    ]
