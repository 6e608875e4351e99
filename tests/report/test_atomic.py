import os

import pytest

from fenicsmech.report import atomic_write


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
