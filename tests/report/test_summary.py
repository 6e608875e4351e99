import copy
import json
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.report import check_summary, write_summary


def simulated():
    """The summary of a demo that only simulates."""
    frame = {"force": 4.0, "displacement": np.float64(5.1), "seconds": 0.6, "iterations": np.int32(4), "stable": True}
    return {
        "demo": "claw",
        "space": "3d",
        "order": 2,
        "ranks": 1,
        "dofs": {"rigid": 77, "flexible": np.int64(16608)},
        "parameters": None,
        "targets": [],
        "frames": [frame, {**frame, "stable": np.bool_(False), "configuration": 2}],
        "seconds": {"setup": 3.5, "frame_median": 0.6, "optimize": None},
        "iterations": None,
        "evaluations": None,
        "objective": {"initial": None, "final": None},
        "thickness": None,
        "mesh_ratio_max": None,
        "peak_memory": 1.2e9,
    }


def optimised():
    return simulated() | {
        "parameters": 69,
        "targets": [
            {"configuration": 0, "force": 4.0, "wanted": 5.0, "reached": 5.01},
            {"configuration": "open", "force": [0.0, 10.0], "wanted": [20.0, 0.0], "reached": np.array([19.9, 0.1])},
        ],
        "seconds": {"setup": 3.5, "frame_median": 0.6, "optimize": 88.0},
        "iterations": 30,
        "evaluations": 41,
        "objective": {"initial": 12.0, "final": 1e-6},
        "thickness": np.array([1.0, 9.0]),
        "mesh_ratio_max": 2.4,
    }


@pytest.mark.parametrize("make", [simulated, optimised])
def test_complete_summaries_pass(make):
    check_summary(make())


def key_paths(schema, prefix=()):
    for key, value in schema.items():
        yield (*prefix, key)
        if isinstance(value, dict):
            yield from key_paths(value, (*prefix, key))
        elif isinstance(value, list) and isinstance(value[0], dict):
            yield from key_paths(value[0], (*prefix, key, 0))


REQUIRED = [path for path in key_paths(optimised()) if path[-1] not in ("configuration", "peak_memory")]


@pytest.mark.parametrize("path", REQUIRED + [("targets", 1, "configuration")], ids=str)
def test_each_missing_key_is_named(path):
    data = copy.deepcopy(optimised())
    place = data
    for step in path[:-1]:
        place = place[step]
    del place[path[-1]]
    name = ".".join(str(step) for step in path).replace(".0", "[0]").replace(".1", "[1]")
    with pytest.raises(DescriptionError, match="the key is missing") as caught:
        check_summary(data)
    assert f"'{name}'" in str(caught.value)


def test_the_list_of_required_keys_is_the_documented_one():
    assert {path[0] for path in REQUIRED} == {
        "demo", "space", "order", "ranks", "dofs", "parameters", "targets", "frames", "seconds", "iterations",
        "evaluations", "objective", "thickness", "mesh_ratio_max",
    }  # fmt: skip
    assert len(REQUIRED) == 30 - 1  # targets.configuration is checked apart


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"demo": ""}, "'demo'.*a word"),
        ({"order": 0}, "'order'.*at least 1"),
        ({"ranks": True}, "'ranks'.*at least 1"),
        ({"dofs": 77}, "'dofs'.*not a mapping"),
        ({"dofs": {"rigid": 1.5, "flexible": 2}}, "'dofs.rigid'.*a count"),
        ({"frames": {}}, "'frames'.*not a list"),
        ({"frames": [3]}, r"'frames\[0\]'.*not a mapping"),
        ({"thickness": [9.0, 1.0]}, "'thickness'.*pair"),
        ({"seconds": {"setup": -1.0, "frame_median": None, "optimize": None}}, "'seconds.setup'.*not negative"),
        ({"mesh_ratio_max": float("inf")}, "'mesh_ratio_max'.*inf"),
    ],
)
def test_values_of_the_wrong_kind_are_named(change, message):
    with pytest.raises(DescriptionError, match=message):
        check_summary(optimised() | change)


def test_numpy_becomes_plain_and_the_order_of_keys_is_kept(tmp_path):
    data = {
        "z": np.float32(0.5),
        "a": np.arange(3),
        "flag": np.bool_(True),
        "nested": {"none": None, "pair": (1, 2.5), "where": Path("results") / "µ"},
        "matrix": np.eye(2),
        "word": np.str_("onyx"),
    }
    write_summary(tmp_path / "summary.json", data)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    read = json.loads(text)
    assert list(read) == list(data)
    assert read["z"] == 0.5 and read["a"] == [0, 1, 2] and read["flag"] is True and read["word"] == "onyx"
    assert read["nested"] == {"none": None, "pair": [1, 2.5], "where": "results/µ"}
    assert read["matrix"] == [[1.0, 0.0], [0.0, 1.0]]
    assert text.startswith('{\n  "z": 0.5') and text.endswith("}\n")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            {"frames": [{"force": 1.0}, {"force": float("nan")}]},
            r"'frames\[1\].force' of the summary: the value is nan",
        ),
        ({"field": np.array([1.0, np.inf])}, r"'field\[1\]'.*inf"),
        ({"x": np.float32("nan")}, "'x'.*nan"),
        ({"x": 1j}, "'x'.*complex has no JSON form"),
        ({"x": {1: 2}}, "'x'.*the key 1 is not a word"),
        ({"x": b"bytes"}, "'x'.*bytes"),
    ],
)
def test_what_json_cannot_hold_is_refused_and_the_old_file_stays(tmp_path, data, message):
    path = tmp_path / "summary.json"
    path.write_text("old")
    with pytest.raises(DescriptionError, match=message):
        write_summary(path, data)
    assert path.read_text() == "old" and len(list(tmp_path.iterdir())) == 1
