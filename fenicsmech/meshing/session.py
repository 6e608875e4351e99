"""The gmsh session of one mesh, with every option that affects the mesh set explicitly.

No other module starts gmsh.
"""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from fenicsmech.errors import MeshingError


def _restore_interrupts(handler: Callable[[int, FrameType | None], Any] | int | None) -> None:
    """Makes ``handler`` that of Ctrl-C again; None stands for one that was not installed by Python."""
    if handler is not None:
        signal.signal(signal.SIGINT, handler)


# gmsh takes Ctrl-C away from Python, some versions even on import: keep Python's handler throughout
_handler = signal.getsignal(signal.SIGINT)
import gmsh  # noqa: E402

_restore_interrupts(_handler)

__all__ = ["gmsh", "gmsh_session", "muted_output"]

_OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "General.AbortOnError": 2,  # errors become exceptions
    "Geometry.OCCParallel": 0,
    "Geometry.OCCUnionUnify": 1,
    "Mesh.Algorithm": 6,  # frontal Delaunay in the plane
    "Mesh.Algorithm3D": 1,  # Delaunay in space
    "Mesh.ElementOrder": 1,
    "Mesh.RandomSeed": 1,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomFactor3D": 1e-12,
    "Mesh.Optimize": 1,
    "Mesh.OptimizeNetgen": 0,
    "Mesh.MinimumCircleNodes": 8,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 1,
}


@contextmanager
def gmsh_session(part: str) -> Iterator[None]:
    """Runs the block inside a fresh gmsh model; gmsh is finalised however the block ends.

    gmsh has one global state: sessions do not nest, and one started elsewhere must have been finalised.

    Args:
        part: the link that is meshed, for messages.

    Raises:
        MeshingError: gmsh reports an error; carries the last error line of its log.
    """
    handler = signal.getsignal(signal.SIGINT)
    gmsh.initialize([], False)
    _restore_interrupts(handler)
    try:
        for option, value in _OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.logger.start()
        gmsh.model.add("link")
        yield
    except Exception as failure:
        # gmsh raises bare Exceptions; anything more specific is not gmsh's
        if type(failure) is not Exception:
            raise
        errors = [line for line in gmsh.logger.get() if line.startswith("Error")]
        reason = errors[-1].partition(":")[2].strip() if errors else str(failure)
        remedy = "Simplify the shape, or change the element size"
        raise MeshingError(part, f"gmsh reports {reason!r}", remedy) from failure
    finally:
        gmsh.finalize()
        _restore_interrupts(handler)


@contextmanager
def muted_output() -> Iterator[None]:
    """Discards the output of libraries to this process's standard output inside the block; not Python's output."""
    flush = ctypes.CDLL(None).fflush
    flush(None)  # C libraries' buffers were filled before the block
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)
