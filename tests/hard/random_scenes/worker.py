"""Scenes judged in a process of their own, which may be stopped when it hangs, and may crash without harm.

A scene hangs when it has used a processor for too long, however busy the machine: a timer of the process itself ends it
by SIGPROF. One that waits for ever uses none; for that case there is a much longer limit by the clock.
"""

from __future__ import annotations

import io
import logging
import multiprocessing
import signal
import time
from contextlib import redirect_stderr
from multiprocessing.connection import Connection

from .scene_result import SceneResult, judge

_WAITING = 3600.0  # seconds by the clock, also for what uses no processor


class Worker:
    """One process that judges scene after scene.

    Args:
        limit: seconds of a processor after which a scene is taken to hang; compilers are not counted.
        quick: whether scenes are simulated with larger elements and fewer loads.
    """

    def __init__(self, limit: float, *, quick: bool = False) -> None:
        self._limit, self._quick = limit, quick
        self._process, self._pipe = None, None

    def judge(self, seed: int) -> SceneResult:
        """The outcome of a scene; a hang or a crash is one too."""
        if self._process is None:
            self._start()
        start = time.perf_counter()
        self._pipe.send(seed)
        try:
            if self._pipe.poll(_WAITING):
                return self._pipe.recv()
            end = "wrong: waits"
        except (EOFError, ConnectionError):
            self._process.join()
            end = "wrong: hangs" if self._process.exitcode == -signal.SIGPROF else "wrong: crashes"
        self.close()
        return SceneResult(
            seed, "", end, f"limit {self._limit:g} s of a processor, {_WAITING:g} s in all", time.perf_counter() - start
        )

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
        self._process = context.Process(target=_serve, args=(theirs, self._limit, self._quick), daemon=True)
        self._process.start()
        theirs.close()


def _serve(pipe: Connection, limit: float, quick: bool) -> None:
    logging.getLogger("fenicsmech").setLevel(logging.ERROR)
    while True:
        try:
            seed = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_PROF, limit)
        with redirect_stderr(io.StringIO()):  # progress of curves
            result = judge(seed, quick=quick)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        pipe.send(result)
