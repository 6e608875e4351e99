"""Messages of a run on MPI rank 0 only, by the standard library's logging; progress and time of long work."""

from __future__ import annotations

import logging
import math
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import monotonic, perf_counter
from typing import TextIO

from fenicsmech.errors import positive

ROOT = "fenicsmech"


class _RankZero(logging.LoggerAdapter):
    """A logger that is silent on every rank but the first, so that a message appears once."""

    def isEnabledFor(self, level: int) -> bool:
        from mpi4py import MPI  # here, not above: describing a mechanism must not start MPI

        return MPI.COMM_WORLD.rank == 0 and super().isEnabledFor(level)


class _Console(logging.StreamHandler):
    """The handler `configure_logging` installs; a class of its own, so that configuring again replaces it."""


def logger(name: str) -> logging.LoggerAdapter:
    """The standard logger of ``name``, a module's `__name__`, which emits on rank 0 of MPI.COMM_WORLD only."""
    return _RankZero(logging.getLogger(name), {})


def configure_logging(level: int = logging.INFO) -> None:
    """Shows the package's messages on standard error, for scripts; an application sets up `logging` itself.

    Args:
        level: the lowest level shown, `logging.DEBUG`, `logging.INFO` and so on.
    """
    package = logging.getLogger(ROOT)
    for handler in [handler for handler in package.handlers if isinstance(handler, _Console)]:
        package.removeHandler(handler)
    console = _Console()  # standard error as it is now
    console.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S"))
    package.addHandler(console)
    package.setLevel(level)
    package.propagate = False
    # Importing FFCx gives the root logger a handler, and compiling a form makes it show every compiler command.
    others = logging.getLogger()
    if not others.handlers:
        others.addHandler(logging.StreamHandler())
    for other in others.handlers:
        if type(other) is logging.StreamHandler:  # not the handlers of an application or a test runner
            other.setLevel(max(other.level, logging.WARNING))


def print_once(*values: object, sep: str = " ") -> None:
    """As ``print``, on rank 0 of MPI.COMM_WORLD only, for scripts that run on any number of processes. Local.

    All ranks call it where the values are computed together: ``print_once(curve.error_estimates())``.
    """
    from mpi4py import MPI

    if MPI.COMM_WORLD.rank == 0:
        print(*values, sep=sep, flush=True)


_TERMINAL_PAUSE = 0.5  # s between redrawn lines
_LOG_PAUSE = 5.0  # s between lines in a file or pipe


# The task whose context was entered first, of those that are open in this thread. A task knows nothing of the ones that
# it is a part of, so that it cannot be given them; tasks of other threads are no part of it.
_outermost: ContextVar[Progress | None] = ContextVar("outermost", default=None)


class Progress:
    """The progress of one task, shown on a stream.

    A terminal gets one line that is redrawn at most twice a second, a file or pipe a line every five seconds. The last
    update is always shown. Use it as a context manager, or call :meth:`close` at the end; tasks within the context of
    another one are not shown.

    Args:
        total: of the task; None if it is not known.
        label: name of the task.
        stream: the output; None is the standard error stream.
        shown: whether this process shows anything; with several, one of them should.
        clock: seconds from an arbitrary start, increasing.

    Raises:
        DescriptionError: ``total`` is not positive.
    """

    def __init__(
        self,
        total: float | None,
        label: str,
        stream: TextIO | None = None,
        *,
        shown: bool = True,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._total = None if total is None else positive(f"progress of '{label}'", total)
        self._label, self._clock, self._shows = label, clock, shown
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._start, self._last = clock(), -math.inf
        self._pending, self._open_line = "", False

    def update(self, done: float, note: str = "") -> None:
        """Reports that ``done`` of the total is finished; ``note`` is a remark on the latest step."""
        if not self._shows or _outermost.get() not in (None, self):
            return
        now = self._clock()
        self._pending = self._describe(done, note, now - self._start)
        complete = self._total is not None and done >= self._total
        if complete or now - self._last >= (_TERMINAL_PAUSE if self._terminal else _LOG_PAUSE):
            self._show(now)

    def close(self) -> None:
        """Shows the last update and ends the line."""
        if self._pending:
            self._show(self._clock())
        if self._open_line:
            self._stream.write("\n")
            self._stream.flush()
            self._open_line = False

    def __enter__(self) -> Progress:
        self._entered = _outermost.set(_outermost.get() or self)
        return self

    def __exit__(self, *error: object) -> None:
        _outermost.reset(self._entered)
        self.close()

    def _describe(self, done: float, note: str, elapsed: float) -> str:
        line = f"{self._label}: {done:g}"
        if self._total is not None:
            line += f"/{self._total:g}"
        line += f"  {_duration(elapsed)}"
        if self._total is not None and 0 < done < self._total:
            line += f", {_duration(elapsed * (self._total - done) / done)} left"
        return f"{line}  {note}" if note else line

    def _show(self, now: float) -> None:
        line, self._pending, self._last = self._pending, "", now
        if self._terminal:
            width = shutil.get_terminal_size().columns - 1  # a full line would wrap and not be overwritten
            self._stream.write(f"\r{line[:width]}\x1b[K")
            self._open_line = True
        else:
            self._stream.write(f"{line}\n")
        self._stream.flush()


def _duration(seconds: float) -> str:
    """``seconds`` as 4.2 s, 3:07 min or 2:05:09 h."""
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}:{rest:02d} min"
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d} h"


class Clock:
    """A stopwatch with named phases.

    Attributes:
        seconds: phase → seconds so far.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = 0.0  # s, of phases inside the present one

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Adds the time inside the block to phase ``name``, less that of the phases inside it."""
        outer, self._inner = self._inner, 0.0
        start = perf_counter()
        try:
            yield
        finally:
            spent = perf_counter() - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent - self._inner
            self._inner = outer + spent

    def since(self, before: dict[str, float]) -> dict[str, float]:
        """Seconds per phase since ``before``, an earlier copy of ``seconds``."""
        return {name: total - before.get(name, 0.0) for name, total in self.seconds.items()}
