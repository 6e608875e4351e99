"""Scenes judged in a process of their own, which may be stopped when it hangs, and may crash without harm."""

from __future__ import annotations

import io
import logging
import multiprocessing
from contextlib import redirect_stderr
from multiprocessing.connection import Connection

from .scene_result import SceneResult, judge


class Worker:
    """One process that judges scene after scene.

    Args:
        limit: seconds after which a scene is taken to hang.
        quick: whether scenes are simulated with larger elements and fewer loads.
    """

    def __init__(self, limit: float, *, quick: bool = False) -> None:
        self._limit, self._quick = limit, quick
        self._process, self._pipe = None, None

    def judge(self, seed: int) -> SceneResult:
        """The outcome of a scene; a hang or a crash is one too."""
        if self._process is None:
            self._start()
        self._pipe.send(seed)
        try:
            if self._pipe.poll(self._limit):
                return self._pipe.recv()
            end = "wrong: hangs"
        except (EOFError, ConnectionError):
            end = "wrong: crashes"
        self.close()
        return SceneResult(seed, "", end, f"limit {self._limit:g} s", self._limit)

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
        self._process = context.Process(target=_serve, args=(theirs, self._quick), daemon=True)
        self._process.start()
        theirs.close()


def _serve(pipe: Connection, quick: bool) -> None:
    logging.getLogger("fenicsmech").setLevel(logging.ERROR)
    while True:
        try:
            seed = pipe.recv()
        except EOFError:
            return
        with redirect_stderr(io.StringIO()):  # progress of curves
            pipe.send(judge(seed, quick=quick))
