"""Logging: the standard library's, on MPI rank 0 only."""

from __future__ import annotations

import logging

ROOT = "fenicsmech"


class _RankZero(logging.Filter):
    """Drops the records of every rank but the first, so that a message appears once whatever the number of ranks."""

    def filter(self, record: logging.LogRecord) -> bool:
        from mpi4py import MPI  # here, not above: describing a mechanism must not start MPI

        return MPI.COMM_WORLD.rank == 0


class _Console(logging.StreamHandler):
    """The handler `configure` installs; a class of its own, so that configuring again replaces it."""

    def __init__(self) -> None:
        super().__init__()  # standard error as it is now
        self.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S"))


_RANK_ZERO = _RankZero()


def logger(name: str) -> logging.Logger:
    """The logger of a module.

    Args:
        name: the module's `__name__`.

    Returns:
        The standard logger of that name; it emits on rank 0 of MPI.COMM_WORLD only.
    """
    found = logging.getLogger(name)
    found.addFilter(_RANK_ZERO)  # on each logger: a filter on a parent does not see the records of its children
    return found


def configure(level: int = logging.INFO) -> None:
    """Show the package's messages on standard error, for scripts; an application sets up `logging` itself.

    Args:
        level: the lowest level shown, `logging.DEBUG`, `logging.INFO` and so on.
    """
    package = logging.getLogger(ROOT)
    for handler in [handler for handler in package.handlers if isinstance(handler, _Console)]:
        package.removeHandler(handler)
    package.addHandler(_Console())
    package.setLevel(level)
    package.propagate = False
    # Importing FFCx gives the root logger a handler, and compiling a form makes it show every compiler command.
    others = logging.getLogger()
    if not others.handlers:
        others.addHandler(logging.StreamHandler())
    for handler in others.handlers:
        if type(handler) is logging.StreamHandler:  # not the handlers of an application or a test runner
            handler.setLevel(max(handler.level, logging.WARNING))
