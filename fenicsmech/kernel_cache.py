"""The cache of compiled forms, and the options of the compiler.

FFCx marks a form as being compiled by its C file, and other processes wait until it is finished. A process killed
while compiling leaves an unfinished file, for which later ones would wait indefinitely. Processes
therefore compile under a shared lock on the folder; one that gets the exclusive lock removes unfinished files.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

from fenicsmech.log import logger

_log = logger(__name__)

# Strict IEEE arithmetic (no -ffast-math): energies rely on cancellation-free forms and on NaN where J ≤ 0.
# Without -fno-schedule-insns2 some versions of gcc take half a minute for the tangent of solids; the code is as fast.
_FLAGS = "-O3 -march=native -fno-math-errno -fno-trapping-math -fno-schedule-insns2 -g0"


def _processor() -> str:
    """A short name for the instruction set of this processor: compiled kernels run on their own only."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        text = platform.processor()
    flags = next((line for line in text.splitlines() if line.startswith(("flags", "Features"))), text)
    return hashlib.sha256(flags.encode()).hexdigest()[:12]


FOLDER = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "fenicsmech" / "kernels" / _processor()


def options() -> dict:
    """FFCx's options, a new dictionary."""
    return {"cffi_extra_compile_args": _FLAGS.split(), "cache_dir": FOLDER, "timeout": 300}


@contextmanager
def compiling(folder: Path = FOLDER) -> Iterator[None]:
    """A context for code that may compile into ``folder``."""
    _remove_unfinished(folder)
    with _lock(folder, fcntl.LOCK_SH):
        yield


@contextmanager
def _lock(folder: Path, how: int) -> Iterator[bool]:
    """A context that holds the lock; yields False without it: some network and read-only file systems have none."""
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            fcntl.flock(stack.enter_context(open(folder / "lock", "w")), how)
            locked = True
        except OSError:
            locked = False
        yield locked


@cache
def _remove_unfinished(folder: Path) -> None:
    """Removes unfinished C files, once per process and unless another process compiles."""
    with _lock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB) as alone:
        for source in folder.glob("libffcx_*.c") if alone else ():
            if not source.with_suffix(".c.cached").exists():
                _log.warning("%s was left unfinished by a process that was stopped; it is compiled anew", source.name)
                source.unlink(missing_ok=True)
