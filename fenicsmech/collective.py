"""Work that one process does on behalf of all: no process goes on before it is done, and all see its errors."""

from __future__ import annotations

import pickle
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
    done, failure = None, None
    if comm.rank == root:
        try:
            done = work()
        except Exception as error:  # of whatever kind: the other processes wait
            failure = error
    told = comm.bcast(_sendable(failure), root=root)
    if told is not None:
        raise failure or told
    return done


def from_one(comm: MPI.Comm, work: Callable[[], T], *, root: int = 0) -> T:
    """The same, and all processes get what ``work`` returned."""
    return comm.bcast(on_one(comm, work, root=root), root=root)


def _sendable(failure: Exception | None) -> Exception | None:
    """``failure``, or its words where it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(failure))
    except Exception:
        return RuntimeError(f"{type(failure).__name__}: {failure}")
    return failure
