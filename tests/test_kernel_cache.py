"""Unfinished files of a killed process in the cache of compiled forms do not block later processes."""

import logging
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fenicsmech.compat import compiling

# compiles for ever
BUSY = """
import sys, time
from pathlib import Path
from fenicsmech.compat import compiling
folder = Path(sys.argv[1])
with compiling(folder):
    (folder / "libffcx_forms_busy.c").touch()
    print("compiling", flush=True)
    time.sleep(600)
"""


def test_unfinished_forms_are_removed_and_finished_ones_kept(tmp_path):
    for name in ("libffcx_forms_done.c", "libffcx_forms_done.c.cached", "libffcx_forms_half.c", "other.c"):
        (tmp_path / name).touch()
    with compiling(tmp_path):
        left = {path.name for path in tmp_path.iterdir()}
    assert left == {"libffcx_forms_done.c", "libffcx_forms_done.c.cached", "other.c", "lock"}


@pytest.mark.thorough
def test_a_form_is_left_to_the_process_that_compiles_it_until_that_is_killed(tmp_path):
    busy = subprocess.Popen([sys.executable, "-c", BUSY, tmp_path], stdout=subprocess.PIPE, text=True)
    try:
        assert busy.stdout.readline() == "compiling\n"
        assert visit(tmp_path) == ["libffcx_forms_busy.c"]
    finally:
        busy.send_signal(signal.SIGKILL)
        busy.communicate()
    assert visit(tmp_path) == []


def visit(folder: Path) -> list[str]:
    """The sources that another process finds as it begins to compile."""
    code = (
        "import sys; from pathlib import Path; from fenicsmech.compat import compiling\n"
        "with compiling(Path(sys.argv[1])): print(*sorted(path.name for path in Path(sys.argv[1]).glob('*.c')))"
    )
    found = subprocess.run([sys.executable, "-c", code, folder], capture_output=True, text=True, check=True)
    return found.stdout.split()


def test_a_folder_that_is_not_there_yet_is_made(tmp_path):
    with compiling(tmp_path / "new" / "folder"):
        assert (tmp_path / "new" / "folder").is_dir()


def test_compiling_works_without_a_lock(tmp_path):
    (tmp_path / "file").touch()
    entered = False
    with compiling(tmp_path / "file"):
        entered = True
    assert entered


@pytest.mark.parametrize("muted", [logging.NOTSET, logging.ERROR])
def test_messages_that_an_application_mutes_stay_muted(muted, tmp_path):
    logging.disable(muted)
    try:
        with compiling(tmp_path):
            assert not logging.getLogger().isEnabledFor(max(muted, logging.INFO))
        assert logging.root.manager.disable == muted
    finally:
        logging.disable(logging.NOTSET)
