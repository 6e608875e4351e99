"""Silence for libraries that write to the standard output of the process."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def muted_output() -> Iterator[None]:
    """Drop what libraries write to the standard output of this process inside the block.

    Python's own output is not lost: what it has not passed on yet stays in its buffer.
    """
    # what C libraries have buffered belongs to the time before and after
    flush = ctypes.CDLL(None).fflush
    flush(None)
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)
