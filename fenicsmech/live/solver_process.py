"""The solver process: it is given tasks, tells events, and is started again when it dies or does not answer."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from fenicsmech.live.job import ended, events
from fenicsmech.live.problems import too_long
from fenicsmech.log import logger

_log = logger(__name__)


class SolverProcess:
    """The solver process, started again when it dies.

    Args:
        command: that reads tasks from standard input and writes events to standard output, a line each.
        receive: called with every event.
        restarts: within ``within`` seconds; more are a failure.
        within: seconds.
        patience: seconds after which a process that does not leave its task for the next one is started again.
        longest: seconds that it may take for a task, and ``patience`` more.
    """

    def __init__(
        self,
        command: tuple[str, ...],
        receive: Callable[[dict[str, Any]], None],
        *,
        restarts: int,
        within: float,
        patience: float,
        longest: float,
    ) -> None:
        self._command, self._receive = command, receive
        self._restarts, self._within, self._patience, self._longest = restarts, within, patience, longest
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task | None = None
        self._last: Mapping[str, Any] | None = None
        self._given: tuple[asyncio.subprocess.Process, int] | None = None  # the last task, and who has it
        self._begun = 0  # the last task that was heard of
        self._waiting: asyncio.TimerHandle | None = None  # since a task was given that has not begun
        self._working: asyncio.TimerHandle | None = None  # since a task has begun
        self._ends: deque[float] = deque(maxlen=restarts)
        self._starting, self._stopped = asyncio.Lock(), False

    @property
    def pid(self) -> int | None:
        """Of the process at work."""
        return None if self._process is None else self._process.pid

    async def start(self) -> None:
        """Starts it."""
        async with self._starting:
            await self._start()

    async def _start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            *self._command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=2**26,
        )
        self._reader = asyncio.create_task(self._read(self._process))

    async def _start_again(self) -> bool:
        """Starts it where another one was; whether that was possible."""
        try:
            await self._start()
        except OSError as error:  # the machine has no memory or no processes left
            _log.warning("the solver process cannot be started: %s", error)
            self._process = None
            self._receive({"event": "lost"})
            return False
        return True

    async def ask(self, task: Mapping[str, Any]) -> None:
        """Gives it a task, which cancels the one before."""
        self._last = task
        async with self._starting:
            if self._process is None and not self._stopped:  # it was lost; another task may do
                self._ends.clear()
                await self._start_again()
        if task is not self._last:
            return  # a later one has come
        await self._give(task)

    async def _give(self, task: Mapping[str, Any]) -> None:
        await self._write(task)
        if self._waiting is None and self._process is not None:
            self._wait()

    async def interrupt(self, number: int) -> None:
        """Ends the task at work; a process that does not leave it in time is started again."""
        self._last = {"task": number, "kind": "nothing"}
        await self._give(self._last)

    async def stop(self) -> None:
        """Ends the process."""
        self._stopped = True
        async with self._starting:
            process, self._process = self._process, None
        if self._reader is not None:
            self._reader.cancel()
        self._rest()
        if self._waiting is not None:
            self._waiting.cancel()
        if process is not None and process.returncode is None:
            process.kill()
            await ended(process)

    def _urge(self) -> None:
        """Ends a process that has not begun its last task."""
        self._waiting = None
        if self._last is not None and self._begun < self._last["task"] and self._process is not None:
            _log.warning("the solver process does not answer and is started again")
            with suppress(ProcessLookupError):
                self._process.kill()

    def _rest(self) -> None:
        """Ends the time of the task that has begun last."""
        if self._working is not None:
            self._working.cancel()
            self._working = None

    def _overdue(self, task: int) -> None:
        """Ends a process that does not end a task by itself; the next one is done by another."""
        if self._last is None or self._last["task"] != task or self._process is None:
            return
        _log.warning("the solver process does not end its task and is started again")
        self._last = None
        with suppress(ProcessLookupError):
            self._process.kill()
        self._receive({"event": "failed", "task": task, **too_long(self._longest)})

    def _wait(self) -> None:
        self._waiting = asyncio.get_running_loop().call_later(self._patience, self._urge)

    def _heard(self, task: int) -> None:
        """Notes a task that has begun; the patience for a later one begins."""
        if task <= self._begun:
            return
        self._begun = task
        self._rest()
        longest = self._longest + self._patience
        self._working = asyncio.get_running_loop().call_later(longest, self._overdue, task)
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None
            if self._last is not None and task < self._last["task"]:
                self._wait()

    async def _write(self, task: Mapping[str, Any]) -> None:
        process = self._process
        if process is None or process.stdin is None or self._given == (process, task["task"]):
            return  # where the start of a process and a task meet, both bring the task
        self._given = process, task["task"]
        with suppress(ConnectionError, RuntimeError):  # it has just died, and gets the task when it is back
            process.stdin.write(json.dumps(task).encode() + b"\n")
            await process.stdin.drain()

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        try:
            async for event in events(process):
                self._heard(event.get("task", 0))
                if event["event"] in ("done", "cancelled", "failed") and event["task"] == self._begun:
                    self._rest()
                self._receive(event)
        except Exception:  # nobody waits for this: it would end silently
            _log.exception("an event of the solver process is not as it should be")
            with suppress(ProcessLookupError):
                process.kill()
        await ended(process)
        if process is not self._process or self._stopped:
            return
        _log.warning("the solver process ended with %s", process.returncode)
        now = asyncio.get_running_loop().time()
        if len(self._ends) == self._restarts and now - self._ends[0] < self._within:
            self._process = None
            self._receive({"event": "lost"})
            return
        self._ends.append(now)
        async with self._starting:
            again = await self._start_again()
        if again and self._last is not None:
            await self._write(self._last)
