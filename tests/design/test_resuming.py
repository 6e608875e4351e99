"""A killed optimisation goes on where it was, on one process and on two, and ends as if nothing had happened."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import fenicsmech as fm

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # s
OPEN_MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
}


@contextmanager
def running(folder: Path, ranks: int, *options: str) -> Iterator[subprocess.Popen]:
    """The program ``resumable`` on some ranks."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-m", "tests.design.resumable", str(folder), *options]
    # os.environ, unlike the environment of this process, lacks what MPI_Init put there, which mpirun trips over
    environment = {**OPEN_MPI, **os.environ, "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def run(folder: Path, ranks: int, *options: str) -> tuple[fm.DesignResult, list[int]]:
    """The result, and the numbers of the iterates seen on the way."""
    with running(folder, ranks, *options) as process:
        output, complaints = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, complaints
    return fm.DesignResult.load(folder / "result.json"), [int(line) for line in output.split()]


def saved_iteration(folder: Path) -> int:
    """The iteration in the checkpoint, which is complete whenever it is read; −1 if there is none yet."""
    file = folder / "checkpoint.json"
    return json.loads(file.read_text())["number"] if file.exists() else -1


def run_and_kill(folder: Path, ranks: int, *, victim: int) -> list[int]:
    """Kills one process at the third iteration; returns the numbers of the iterates seen until then."""
    with running(folder, ranks) as process:
        deadline = time.monotonic() + PATIENCE
        while saved_iteration(folder) < 3:
            assert process.poll() is None and time.monotonic() < deadline, process.stderr.read()
            time.sleep(0.01)
        os.kill(int((folder / f"process-{victim}").read_text()), signal.SIGKILL)
        output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode != 0
    assert not (folder / "result.json").exists()
    return [int(line) for line in output.split() if line.isdecimal()]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[fm.DesignResult, list[int]]:
    """The result of an uninterrupted run."""
    return run(tmp_path_factory.mktemp("undisturbed"), 1)


@pytest.mark.thorough
@pytest.mark.parametrize(("ranks", "victim"), [(1, 0), (2, 1)])
def test_killed_optimisation_continues_from_its_checkpoint(ranks, victim, tmp_path, undisturbed):
    expected, whole = undisturbed
    before = run_and_kill(tmp_path, ranks, victim=victim)
    assert saved_iteration(tmp_path) < whole[-1]
    found, after = run(tmp_path, ranks, "--resume")
    assert before[0] == 0
    assert before[-1] - 1 <= after[0] <= before[-1] + 1
    assert after[0] >= 3
    assert after[-1] == whole[-1]
    (link,), (other,) = expected.links, found.links
    assert other.parameters == pytest.approx(link.parameters, abs=1e-6 * np.abs(link.parameters).max())
    assert found.objective == pytest.approx(expected.objective, rel=1e-6)
    for target, same in zip(expected.targets, found.targets, strict=True):
        assert same.reached == pytest.approx(target.reached, rel=1e-6)
    assert (found.reason, found.iterations) == (expected.reason, expected.iterations)
    assert found.processes == ranks
