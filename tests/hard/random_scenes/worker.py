"""Scenes judged in a process of their own, which may be stopped when it hangs, and may crash without harm.

A scene hangs when it has used a processor for too long, however busy the machine: a timer of the process itself ends it
by SIGPROF. One that waits for ever uses none; for that case there is a much longer limit by the clock.
"""

from __future__ import annotations

import io
import logging
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import redirect_stderr
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Generic, TypeVar

T = TypeVar("T")

_WAITING = 3600.0  # seconds by the clock, also for what uses no processor


class Crashed(Exception):
    """The process ended without a result."""


class Worker(Generic[T]):
    """One process that judges scene after scene.

    Args:
        judge: the result of a seed; a function of a module, which the process imports.
        limit: seconds of a processor after which a scene is taken to hang; compilers are not counted.
    """

    def __init__(self, judge: Callable[[int], T], limit: float) -> None:
        self._judge, self._limit = judge, limit
        self._process, self._pipe = None, None

    def __call__(self, seed: int) -> T:
        """The result of a scene.

        Raises:
            TimeoutError: it hangs.
            Crashed: the process died, or an exception escaped.
        """
        if self._process is not None and not self._process.is_alive():  # it died between two scenes
            self.close()
        if self._process is None:
            self._start()
        try:
            self._pipe.send(seed)
            if self._pipe.poll(_WAITING):
                return self._pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            hangs = self._process.exitcode == -signal.SIGPROF
            self.close()
            if not hangs:
                raise Crashed from None
        self.close()
        raise TimeoutError(f"limit {self._limit:g} s of a processor, {_WAITING:g} s by the clock")

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._judge, self._limit), daemon=True)
        self._process.start()
        theirs.close()


def side_by_side(
    judge: Callable[[int], T],
    seeds: Sequence[int],
    failed: Callable[[int, TimeoutError | Crashed], T],
    *,
    limit: float,
    processes: int,
) -> Iterator[T]:
    """The results of scenes in the order in which they are found, by several workers.

    Args:
        judge: as of a worker.
        seeds: of the scenes.
        failed: the result of a scene that hangs or crashes.
        limit: as of a worker.
        processes: number of workers.
    """
    free = SimpleQueue[Worker[T]]()
    for _ in range(processes):
        free.put(Worker(judge, limit))

    def result(seed: int) -> T:
        worker = free.get()
        try:
            return worker(seed)
        except (TimeoutError, Crashed) as failure:
            return failed(seed, failure)
        finally:
            free.put(worker)

    with ThreadPoolExecutor(processes) as threads:
        for done in as_completed([threads.submit(result, seed) for seed in seeds]):
            yield done.result()
    for _ in range(processes):
        free.get().close()


def _serve(pipe: Connection, judge: Callable[[int], T], limit: float) -> None:
    logging.getLogger("fenicsmech").setLevel(logging.ERROR)
    while True:
        try:
            seed = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_PROF, limit)
        with redirect_stderr(io.StringIO()):  # progress of curves
            result = judge(seed)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        pipe.send(result)
