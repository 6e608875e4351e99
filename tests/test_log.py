"""Messages appear once, whatever the number of ranks."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Iterator

import pytest
from mpi4py import MPI

from fenicsmech import log


@pytest.fixture
def package_logger() -> Iterator[logging.Logger]:
    """The package's logger, put back as it was afterwards."""
    package = logging.getLogger(log.ROOT)
    handlers, level, propagate = list(package.handlers), package.level, package.propagate
    yield package
    package.handlers[:], package.propagate = handlers, propagate
    package.setLevel(level)


@pytest.mark.parallel
def test_only_the_first_rank_logs(caplog):
    with caplog.at_level(logging.INFO, log.ROOT):
        log.logger("fenicsmech.equilibrium.newton").info("iteration %d", 3)
    assert caplog.messages == (["iteration 3"] if MPI.COMM_WORLD.rank == 0 else [])


@pytest.mark.usefixtures("package_logger")
def test_nothing_is_shown_below_the_configured_level(capsys):
    log.configure_logging(logging.WARNING)
    messages = log.logger("fenicsmech.meshing")
    messages.info("1204 cells")
    messages.warning("a sliver")
    shown = capsys.readouterr().err
    assert "a sliver" in shown
    assert "1204 cells" not in shown


@pytest.mark.usefixtures("package_logger")
def test_configuring_twice_shows_a_message_once(capsys):
    log.configure_logging(logging.INFO)
    log.configure_logging(logging.DEBUG)
    log.logger("fenicsmech.meshing").debug("1204 cells")
    assert capsys.readouterr().err.count("1204 cells") == 1


def test_a_script_shows_no_messages_of_other_libraries():
    script = """
import logging
from fenicsmech import log
log.configure_logging(logging.INFO)
logging.getLogger().setLevel(logging.INFO)  # as setuptools does when FFCx compiles a form
logging.info("gcc -O2 form.c")
logging.warning("a warning of another library")
log.logger("fenicsmech.meshing").info("1204 cells")
"""
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stderr
    assert "gcc" not in shown
    assert shown.count("a warning of another library") == 1
    assert shown.count("1204 cells") == 1
