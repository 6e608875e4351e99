"""Messages appear once, whatever the number of ranks."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest
from mpi4py import MPI

from fenicsmech import log


@pytest.fixture
def package_logger() -> Iterator[logging.Logger]:
    """The package's logger, put back as it was afterwards."""
    package = logging.getLogger(log.ROOT)
    handlers, level = list(package.handlers), package.level
    yield package
    package.handlers[:] = handlers
    package.setLevel(level)


@pytest.mark.parallel
def test_only_the_first_rank_speaks(caplog):
    with caplog.at_level(logging.INFO, log.ROOT):
        log.logger("fenicsmech.equilibrium.newton").info("iteration %d", 3)
    assert caplog.messages == (["iteration 3"] if MPI.COMM_WORLD.rank == 0 else [])


@pytest.mark.usefixtures("package_logger")
def test_nothing_is_shown_below_the_configured_level(capsys):
    log.configure(logging.WARNING)
    messages = log.logger("fenicsmech.meshing")
    messages.info("1204 cells")
    messages.warning("a sliver")
    shown = capsys.readouterr().err
    assert "a sliver" in shown
    assert "1204 cells" not in shown


@pytest.mark.usefixtures("package_logger")
def test_configuring_twice_shows_a_message_once(capsys):
    log.configure(logging.INFO)
    log.configure(logging.DEBUG)
    log.logger("fenicsmech.meshing").debug("1204 cells")
    assert capsys.readouterr().err.count("1204 cells") == 1
