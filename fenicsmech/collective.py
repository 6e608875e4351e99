"""Work that one process does for all, and errors that all processes see, so that none waits for one that has failed."""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

T = TypeVar("T")


def on_one(comm: MPI.Comm, work: Callable[[], T], *, root: int = 0) -> T | None:
    """Calls ``work`` on one process while the others wait (collective).

    Args:
        comm: the processes.
        work: takes part in nothing collective that the others do not.
        root: the rank that calls it.

    Returns:
        What ``work`` returned, on ``root``; None elsewhere.

    Raises:
        Exception: what ``work`` raised, on all processes.
    """
    return on_all(comm, lambda: work() if comm.rank == root else None)


def from_one(comm: MPI.Comm, work: Callable[[], T], *, root: int = 0) -> T:
    """The same, and all processes get what ``work`` returned."""
    return pickle.loads(comm.bcast(on_one(comm, lambda: pickle.dumps(work()), root=root), root=root))


def on_all(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """Calls ``work`` on every process, and fails on all if it fails on one (collective).

    Args:
        comm: the processes.
        work: what in it is collective on ``comm`` must fail on all processes or on none; all else may fail on some.

    Raises:
        Exception: what ``work`` raised on the lowest rank where it did.
    """
    done, failure = None, None
    try:
        done = work()
    except Exception as error:
        failure = error
    failures = comm.allgather(_sendable(failure))
    first = next((rank for rank, other in enumerate(failures) if other is not None), None)
    try:
        if first is not None:
            raise failure if first == comm.rank else failures[first]
    finally:
        # an error that its own traceback refers to would keep all that is in there until Python looks for cycles
        failure = failures = None
    return done


def mpi_abort_on_error() -> None:
    """Lets an uncaught error on one process end all of them; MPI by itself leaves the others waiting for ever.

    A script calls it once, at its start. It replaces ``sys.excepthook`` where there are several processes. Where all
    fail, as they do in most cases, each comes to its end as usual.
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
    """``failure``, or its words where it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(failure))
    except Exception:
        return RuntimeError(f"{type(failure).__name__}: {failure}")
    return failure
