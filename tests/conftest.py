"""Fixtures of all tests: MPI-aware reporting, directories common to all ranks, and programs run under mpirun."""

from __future__ import annotations

import faulthandler
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

# Workers of pytest-xdist are given what MPI_Init put into the environment of the process that started them; neither
# their own MPI_Init nor an mpirun under them gets along with it.
SET_BY_MPI = ("PMIX_", "ORTE_", "OMPI_APP_", "OMPI_MCA_orte_", "OMPI_MCA_ess", "OMPI_MCA_pmix")
if "PYTEST_XDIST_WORKER" in os.environ:
    for name in [name for name in os.environ if name.startswith(SET_BY_MPI)]:
        del os.environ[name]

from mpi4py import MPI  # noqa: E402

# The bookkeeping below has a communicator of its own: none of it is mistaken for a message of the code under test.
COMM = MPI.COMM_WORLD.Dup()

# Seconds after which a test is taken to hang, alone and on several ranks, and after which a rank whose test failed
# waits no longer for the others.
ALONE, ON_RANKS, AFTER_FAILURE = 300, 120, 30

STDERR = pytest.StashKey[int]()

# The same examples on every rank and in every run; a form that must be compiled first is not a slow example.
hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("reproducible")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let only rank 0 report, and keep standard error at hand for the trace of a test that hangs."""
    config.stash[STDERR] = os.dup(2)  # what pytest captures while a test runs is lost with it
    if COMM.rank > 0:
        sys.stdout = open(os.devnull, "w")  # the terminal reporter, set up next, writes to what it finds here
        config.add_cleanup(sys.stdout.close)


def pytest_unconfigure() -> None:
    """Exit together: mpirun ends all ranks as soon as one exits with an error, and rank 0 has a summary to print."""
    sys.stdout.flush()
    COMM.Barrier()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item):
    """Show where a test hangs; on several ranks, which then wait for each other, end the run as well."""
    several = COMM.size > 1  # mpirun stops the others when one rank exits
    faulthandler.dump_traceback_later(ON_RANKS if several else ALONE, exit=several, file=item.config.stash[STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Make a test that fails on one rank fail on all, with the story of every rank."""
    report = yield
    if COMM.size > 1:
        _meet(report, item.config.stash[STDERR])
        outcomes = COMM.allgather((report.outcome, report.longreprtext))
        if len({outcome for outcome, _ in outcomes}) > 1:
            report.outcome = "failed"
            report.longrepr = "\n".join(
                f"[rank {rank}: {outcome}]\n{text}" for rank, (outcome, text) in enumerate(outcomes)
            )
    return report


def _meet(report: pytest.TestReport, stderr: int) -> None:
    """Wait for the other ranks; if this one failed and they do not come, print the reason and end the run."""
    arrival = COMM.Ibarrier()
    deadline = time.monotonic() + AFTER_FAILURE
    while not arrival.Test():
        if report.failed and time.monotonic() > deadline:
            os.write(stderr, f"{report.nodeid} failed on rank {COMM.rank} only:\n{report.longreprtext}\n".encode())
            COMM.Abort(1)
        time.sleep(1e-3)


@pytest.fixture
def shared_tmp_path(tmp_path: Path) -> Path:
    """A temporary directory that is the same on every rank."""
    return COMM.bcast(tmp_path)


@pytest.fixture
def mpirun() -> Callable[..., subprocess.CompletedProcess]:
    """Run a Python script on some ranks: `mpirun(2, "demos/truss.py", "--quick")`, from a serial test."""

    def run(ranks: int, *arguments: str | os.PathLike) -> subprocess.CompletedProcess:
        # os.environ, unlike the environment of this process, lacks what MPI_Init put there, which mpirun trips over.
        root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        settings = {"OPENBLAS_NUM_THREADS": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
        environment = {**root, **os.environ, **settings, "MPIEXEC_TIMEOUT": str(ALONE)}
        command = ["mpirun", "-n", str(ranks), sys.executable, *map(os.fspath, arguments)]
        return subprocess.run(command, env=environment, capture_output=True, text=True)

    return run
