"""A job beside the solver: a process that gets one task, tells its events, and is ended at any time."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from typing import Any

from fenicsmech.live.problems import too_long

_LONGEST = 2**27  # bytes of an event
_CLOSING = 1.0  # s, in which the pipe to a process that has ended closes


async def events(process: asyncio.subprocess.Process) -> AsyncIterator[dict[str, Any]]:
    """The events that a process writes, a line each; one that writes something else is ended."""
    assert process.stdout is not None, "it is a pipe"
    try:
        while line := await process.stdout.readline():
            yield json.loads(line)
    except ValueError:  # a line that is cut, or longer than the limit of the pipe
        with suppress(ProcessLookupError):
            process.kill()


async def ended(process: asyncio.subprocess.Process) -> int:
    """How a process ended, which is killed or about to end; what was written to it as it went is given up.

    One that is cancelled waits all the same: what belongs to a process is released only once its end is seen.
    """
    assert process.stdin is not None, "it is a pipe"
    cancelled = None
    while process.returncode is None:
        try:
            await process.wait()
        except asyncio.CancelledError as again:
            cancelled = again
    process.stdin.close()
    if cancelled is not None:
        raise cancelled
    closed = asyncio.ensure_future(process.stdin.wait_closed())
    await asyncio.wait([closed], timeout=_CLOSING)
    if not closed.cancel():
        closed.exception()  # a broken pipe
    return process.returncode


class Job:
    """One process at a time.

    Args:
        command: that reads a task as JSON from standard input, and writes events to standard output, a line each.
        receive: called with each event.
        longest: seconds that a task may take.

    Attributes:
        last: the last event, for pages that are opened later; None before the first, and when it is forgotten.
    """

    def __init__(
        self, command: tuple[str, ...], receive: Callable[[Mapping[str, Any]], None], longest: float = math.inf
    ) -> None:
        self._command, self._receive, self._longest = command, receive, longest
        self._work: asyncio.Task[None] | None = None
        self._changing = asyncio.Lock()  # of two that start at once, the later one lasts
        self.last: Mapping[str, Any] | None = None

    async def start(self, task: Mapping[str, Any]) -> None:
        """Begins a task; the one before is ended."""
        async with self._changing:
            await self._end()
            self._work = asyncio.create_task(self._run(task))

    async def stop(self) -> bool:
        """Ends the task at work; whether there was one."""
        async with self._changing:
            return await self._end()

    async def forget(self) -> None:
        """Ends the task at work, and forgets its last event: its subject is another one."""
        async with self._changing:
            ended, self.last = await self._end(), None
        if ended:
            self._receive({"event": "solid", "state": "cancelled"})

    async def _end(self) -> bool:
        work, self._work = self._work, None
        if work is None or work.done():
            return False
        work.cancel()
        with suppress(asyncio.CancelledError):
            await work
        return True

    def tell(self, event: Mapping[str, Any]) -> None:
        """Sends an event on."""
        self.last = event
        self._receive(event)

    async def _run(self, task: Mapping[str, Any]) -> None:
        try:
            async with asyncio.timeout(None if math.isinf(self._longest) else self._longest):
                problem = await self._problem(task)
        except TimeoutError:
            self.tell({"event": "solid", "state": "failed", **too_long(self._longest)})
            return
        except Exception as error:  # nobody waits for this: it would end silently
            problem = f"{type(error).__name__}: {error}"
        if problem is not None:
            remedy = "Choose larger elements or fewer frames if memory was short, and solve again"
            self.tell({"event": "solid", "state": "failed", "part": "solid", "problem": problem, "remedy": remedy})

    async def _problem(self, task: Mapping[str, Any]) -> str | None:
        """Runs the process; why it ended without telling its end, or None."""
        pipe, none = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=pipe, stdout=pipe, stderr=none, limit=_LONGEST
        )
        try:
            assert process.stdin is not None, "it is a pipe"
            with suppress(ConnectionError):  # the process has just died
                process.stdin.write(json.dumps(task).encode())
                await process.stdin.drain()
            process.stdin.close()
            complete = False
            async for event in events(process):
                complete = event["state"] in ("solved", "failed")
                self.tell(event)
            return None if complete else f"its process ended with {await ended(process)}"
        finally:
            if process.returncode is None:
                process.kill()
            await ended(process)
