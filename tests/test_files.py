import json
import os
from pathlib import Path

import numpy as np
import pytest

from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write, file_name, file_names, write_json


def test_a_finished_block_replaces_the_file_and_creates_its_folders(tmp_path):
    path = tmp_path / "new" / "folder" / "note.txt"
    for text in ("erste Zeile µ\n", "second\n"):
        with atomic_write(path) as file:
            file.write(text)
        assert path.read_text(encoding="utf-8") == text
    assert os.listdir(path.parent) == ["note.txt"]


def test_bytes_are_written_as_given(tmp_path):
    with atomic_write(tmp_path / "data.bin", binary=True) as file:
        file.write(b"\x00\r\n\xff")
    assert (tmp_path / "data.bin").read_bytes() == b"\x00\r\n\xff"


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_in_the_middle_leaves_the_old_file_and_nothing_else(tmp_path, failure):
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(failure), atomic_write(path) as file:
        file.write("half of the new")
        file.flush()
        raise failure
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["result.json"]


def test_the_old_file_stays_readable_until_the_block_ends(tmp_path):
    path = tmp_path / "result.json"
    path.write_text("old")
    with atomic_write(path) as file:
        file.write("new")
        file.flush()
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_files_get_the_permissions_of_the_user(tmp_path):
    (tmp_path / "plain").write_text("")
    with atomic_write(tmp_path / "atomic"):
        pass
    assert (tmp_path / "atomic").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("left leg", "left-leg"),
        ("../x", "x"),
        ("/x", "x"),
        (r"c:\x", "c--x"),
        ("..", "part"),
        (".hidden", "hidden"),
        ("Lösung_2.5", "Lösung_2.5"),
        ("梁", "梁"),
        ("a\0b", "a-b"),
    ],
)
def test_a_name_is_one_of_a_file_in_its_folder(name, file, tmp_path):
    assert file_name(name) == file
    path = tmp_path / f"{file}.step"
    path.touch()
    assert path.resolve().parent == tmp_path.resolve()


def test_files_of_one_folder_differ_whatever_their_parts_are_called(tmp_path):
    names = ["a b", "a-b", "A/b", "a-b-2", "...", "", "梁" * 160, "梁" * 159]
    found = file_names(names)
    assert found[:4] == ["a-b", "a-b-2", "A-b-3", "a-b-2-2"] and len({own.casefold() for own in found}) == len(names)
    for own in found:
        with atomic_write(tmp_path / f"{own}.step") as file:
            file.write("")


def test_numpy_becomes_plain_and_the_order_of_keys_is_kept(tmp_path):
    data = {
        "z": np.float32(0.5),
        "a": np.arange(3),
        "flag": np.bool_(True),
        "nested": {"none": None, "pair": (1, 2.5), "where": Path("results") / "µ"},
        "matrix": np.eye(2),
        "word": np.str_("onyx"),
    }
    write_json(tmp_path / "summary.json", data)
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
        ({"frames": [{"force": 1.0}, {"force": float("nan")}]}, r"'frames\[1\].force' of a file: the value is nan"),
        ({"field": np.array([1.0, np.inf])}, r"'field\[1\]'.*inf"),
        ({"x": np.float32("nan")}, "'x'.*nan"),
        ({"x": 1j}, "'x'.*complex has no JSON form"),
        ({"x": {1: 2}}, "'x'.*the key 1 is not a string"),
        ({"x": b"bytes"}, "'x'.*bytes"),
    ],
)
def test_values_without_a_json_form_are_refused_and_the_old_file_stays(tmp_path, data, message):
    path = tmp_path / "summary.json"
    path.write_text("old")
    with pytest.raises(DescriptionError, match=message):
        write_json(path, data)
    assert path.read_text() == "old" and len(list(tmp_path.iterdir())) == 1
