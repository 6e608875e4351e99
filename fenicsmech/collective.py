"""Work of one process for all, and errors raised on all processes: none waits for a process that has failed.

Numbers that each process computes from copies of the same arrays may differ in their last digits: other kernels of
linear algebra round otherwise. Where a decision depends on them, all take those of the first process (``agreed``);
results of reductions are the same on all.
"""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from mpi4py import MPI

T = TypeVar("T")


def on_one(comm: MPI.Comm, work: Callable[[], T]) -> T | None:
    """The result of ``work`` on the first process, None elsewhere; all processes raise its error.

    ``work`` calls nothing collective; the others wait for it.
    """
    return on_all(comm, lambda: work() if comm.rank == 0 else None)


def from_one(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """As ``on_one``; all processes get the result."""
    return pickle.loads(comm.bcast(on_one(comm, lambda: pickle.dumps(work())), root=0))


def agreed(comm: MPI.Comm, value: T) -> T:
    """The ``value`` of the first process, on all."""
    return comm.bcast(value, root=0)


def gathered(comm: MPI.Comm, numbers: np.ndarray, values: np.ndarray, count: int) -> np.ndarray | None:
    """The values of all ``count`` vertices or cells on rank 0, from those of each rank with their numbers."""
    parts = comm.gather((numbers, values), root=0)
    if parts is None:
        return None
    whole = np.zeros((count, *values.shape[1:]), dtype=values.dtype)
    for places, part in parts:
        whole[places] = part
    return whole


def scattered(comm: MPI.Comm, numbers: np.ndarray, values: np.ndarray | None) -> np.ndarray:
    """Of the ``values`` of all vertices or cells on rank 0, those of each rank with their numbers."""
    parts = comm.gather(numbers, root=0)
    # others than rank 0 send nothing
    return comm.scatter([] if parts is None or values is None else [values[own] for own in parts], root=0)


def on_all(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of ``work`` on each process; if it fails on one, all raise the error of the lowest rank.

    Calls in ``work`` that are collective on ``comm`` must fail on all processes or on none; others may fail on some.
    """
    result, failure = None, None
    try:
        result = work()
    except Exception as error:
        failure = error
    failures = comm.allgather(_sendable(failure))
    if failure is not None:
        failures[comm.rank] = failure
    try:
        for other in failures:
            if other is not None:
                raise other
    finally:
        # an error that its own traceback refers to would keep its frames alive until the next garbage collection
        del failure, failures, other
    return cast(T, result)


def mpi_abort_on_error() -> None:
    """Ends all processes after an uncaught error on one; MPI by itself leaves the others waiting.

    A script calls it once, at its start. It replaces ``sys.excepthook`` where there are several processes. If all
    fail, each ends as usual.
    """
    show, world = sys.excepthook, MPI.COMM_WORLD

    def show_and_abort(kind, error, trace) -> None:
        show(kind, error, trace)
        sys.stdout.flush()
        sys.stderr.flush()
        arrival, deadline = world.Ibarrier(), time.monotonic() + 3.0  # s, for all to fail
        while not arrival.Test():
            if time.monotonic() > deadline:
                world.Abort(1)
            time.sleep(0.01)

    if world.size > 1:
        sys.excepthook = show_and_abort


def _sendable(failure: Exception | None) -> Exception | None:
    """``failure``, or its message where it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(failure))
    except Exception:
        return RuntimeError(f"{type(failure).__name__}: {failure}")
    return failure
