"""The server of the live page: static files and a WebSocket on 127.0.0.1, in front of a solver process.

Addresses begin with a random token. Requests with another Host, and WebSockets with another Origin, are refused: no
page of another site gets anything, not by a name that it makes point to this machine either. The browser is opened by
an address without the token, which leads to the page once. The page has no paths of the disk. The solver process is
started again when it dies, with the last task; it gets the whole project each time. A page that is opened before the
solver is up has the results that an earlier start stored (``stored``).
"""

from __future__ import annotations

import asyncio
import json
import re
import secrets
import signal
import sys
import webbrowser
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from fenicsmech.compat import ignore_broken_pipes
from fenicsmech.errors import DescriptionError
from fenicsmech.live.build import constants
from fenicsmech.live.job import Job, ended
from fenicsmech.live.messages import EXPORTS, LARGEST, PER_SECOND, read_message
from fenicsmech.live.project import LARGEST_PROJECT, MOST_ADDED, Project, example_names, materials
from fenicsmech.live.schema import Refused
from fenicsmech.live.script import script
from fenicsmech.live.session import Session
from fenicsmech.live.solver_process import SolverProcess
from fenicsmech.live.stored import StoredResults, user_cache
from fenicsmech.log import logger

if TYPE_CHECKING:
    from aiohttp import web

    Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

_log = logger(__name__)
PAGE = Path(__file__).parent / "page"
MOST_WAITING = 2**26  # characters for a page that does not read; a solid has some 2**25


def _aiohttp() -> Any:
    """The package, which nothing but the live page needs.

    Raises:
        DescriptionError: it is missing.
    """
    try:
        import aiohttp.web
    except ImportError:
        remedy = "Install it: apt-get install python3-aiohttp"
        raise DescriptionError("live page", "the Python package aiohttp is missing", remedy) from None
    return aiohttp


_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data: blob:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}
# results that a page which is opened later needs
_KEPT = ("mesh", "curve", "responses", "errors", "linear", "fitted", "iterate", "required", "failed")


@dataclass(frozen=True)
class ServerOptions:
    """Options of the server.

    Attributes:
        port: on 127.0.0.1; 0 for a free one.
        restarts: of the solver process within ``within`` seconds; more are a failure that pages show.
        within: seconds.
        patience: seconds after which a solver that does not leave its task for the next one is started again; compiling
            new forms, which nothing ends, takes up to a minute.
        longest_solve: seconds that the solver may take for a task, with the optimisation; then it ends at its next
            factor, says so and keeps what it has found. One that does not end within ``patience`` is started again.
        longest_solid: seconds that a solve in space may take.
        longest_export: seconds that the files of an export may take.
        door: seconds for which the address that opens the browser works.
        stored: folder of first results for the next start; None: none are stored.
        solver: command of the solver process.
        solid: command of the process that solves in space.
    """

    port: int = 0
    restarts: int = 3
    within: float = 30.0
    patience: float = 120.0
    longest_solve: float = 600.0
    longest_solid: float = 3600.0
    longest_export: float = 300.0
    door: float = 30.0
    stored: Path | None = field(default_factory=user_cache)
    solver: tuple[str, ...] = (sys.executable, "-c", "from fenicsmech.live.solver import main; main()")
    solid: tuple[str, ...] = (sys.executable, "-c", "from fenicsmech.live.solid import main; main()")


class Server:
    """The live page of one project.

    Args:
        project: shown first.
        options: of the server.

    Attributes:
        session: the project and its history.
        address: of the page, token included; after ``start``.
    """

    def __init__(self, project: Project, options: ServerOptions | None = None) -> None:
        self.session, self._options = Session(project), options or ServerOptions()
        self.token, self.address = secrets.token_urlsafe(24), ""
        self._pages: set[Outbox] = set()
        self._doors: dict[str, float] = {}  # codes, and when they end
        self._solver = SolverProcess(
            self._options.solver,
            self._from_solver,
            restarts=self._options.restarts,
            within=self._options.within,
            patience=self._options.patience,
            longest=self._options.longest_solve,
        )
        self._solid = Job(self._options.solid, self._tell, self._options.longest_solid)
        self._number, self._pushed = 1, False
        self._kept: dict[tuple[str, int | None], str] = {}
        self._stored = StoredResults(self._options.stored)
        self._opened = None if self.session.task["fit"] else self.session.project  # whose results may be stored
        self._state: dict[str, Any] = {"event": "solver", "state": "starting"}
        self._drawn: Mapping[str, Any] | None = None  # the last final curve
        self._pushing: Outbox | None = None  # the page of the last push
        self._editing: Outbox | None = None  # the page of the last edit that was not settled
        self._runner: Any = None
        self._exporting = asyncio.Semaphore(1)

    async def start(self) -> None:
        """Starts the solver, and listens."""
        ignore_broken_pipes()  # pages and solvers go at any time
        web = _aiohttp().web
        await self._solver.start()
        if self._opened is not None:
            self._kept = self._stored.find(self._opened)

        @web.middleware
        async def guard(request: Any, handler: Handler) -> Any:
            return await self._guarded(request, handler)

        app = web.Application(middlewares=[guard])
        app.router.add_get("/open/{code}", self._open, allow_head=False)  # which would use it up
        app.router.add_get(f"/{self.token}/", self._index)
        app.router.add_get(f"/{self.token}/ws", self._socket)
        app.router.add_get(f"/{self.token}/export/{{what}}", self._export)
        app.router.add_static(f"/{self.token}/page/", PAGE)
        self._runner = runner = web.AppRunner(app, access_log=None)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", self._options.port, shutdown_timeout=1.0).start()
        self.port = runner.addresses[0][1]
        self.address = f"http://127.0.0.1:{self.port}/{self.token}/"
        await self._ask(self.session.task)

    async def stop(self) -> None:
        """Ends the solver and closes all pages."""
        await self._solid.stop()
        await self._solver.stop()
        for page in list(self._pages):
            await page.close()
        if self._runner is not None:
            await self._runner.cleanup()

    def door(self) -> str:
        """An address that leads to the page once and soon: every user may read the command line of a browser."""
        code = secrets.token_urlsafe(24)
        self._doors[code] = monotonic() + self._options.door
        return f"http://127.0.0.1:{self.port}/open/{code}"

    @property
    def solver_pid(self) -> int | None:
        """Of the solver process."""
        return self._solver.pid

    # -- requests ------------------------------------------------------------------------------------------------

    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        names = {f"{host}:{self.port}" for host in ("127.0.0.1", "localhost")}
        origin = request.headers.get("Origin")
        foreign = request.headers.get("Host") not in names
        foreign = foreign or (origin is not None and origin.removeprefix("http://") not in names)
        given = request.path.partition("/")[2].partition("/")[0]  # a path may be *
        known = given == "open" or secrets.compare_digest(given.encode(), self.token.encode())
        if foreign or not known:
            raise _aiohttp().web.HTTPForbidden(text="This page is not for you.")
        response = await handler(request)
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    async def _open(self, request: web.Request) -> web.StreamResponse:
        web = _aiohttp().web
        if self._doors.pop(request.match_info["code"], 0.0) <= monotonic():
            raise web.HTTPForbidden(text="This address has been used or is too old. Open the one that is printed.")
        return web.Response(status=302, headers={"Location": self.address})

    async def _index(self, _request: web.Request) -> web.StreamResponse:
        return _aiohttp().web.FileResponse(PAGE / "index.html")

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        web = _aiohttp().web
        if request.headers.get("Origin") is None:
            raise web.HTTPForbidden(text="This page is not for you.")
        page = web.WebSocketResponse(max_msg_size=LARGEST, heartbeat=30.0)
        await page.prepare(request)
        outbox = Outbox(page, request.transport, self._opening())
        self._pages.add(outbox)
        recent: deque[float] = deque(maxlen=PER_SECOND)
        try:
            async for message in page:
                now = monotonic()
                outbox.heard += 1
                try:
                    if message.type is not web.WSMsgType.TEXT:
                        raise Refused("", "not a text")
                    if len(recent) == PER_SECOND and now - recent[0] < 1.0:
                        raise Refused("", f"more than {PER_SECOND} messages a second")
                    recent.append(now)
                    await self._from_page(read_message(message.data), outbox)
                except Refused as refused:
                    why = {"event": "refused", "place": refused.place, "problem": refused.problem}
                    for event in (self._state, self._project_event(), why):  # it may show what was refused
                        outbox.put(json.dumps(event))
        finally:
            self._pages.discard(outbox)
            outbox.end()
            await self._end_gestures(outbox)
        return page

    async def _end_gestures(self, page: Outbox) -> None:
        """Releases what a page that is gone pushes, and settles what it edits."""
        if self._editing is page:
            self._editing = None
            if self.session.settle():
                self._tell(self._project_event())
        if self._pushing is page:
            self._pushing = None
            if self._pushed:
                await self._from_page({"kind": "release"}, page)

    async def _export(self, request: web.Request) -> web.StreamResponse:
        web, what = _aiohttp().web, request.match_info["what"]
        try:
            EXPORTS.check(what, "export")
        except Refused as refused:
            raise web.HTTPNotFound(text=str(refused)) from None
        project = self.session.project
        stem = re.sub(r"[^A-Za-z0-9]+", "-", project["name"]).strip("-") or "mechanism"
        if what == "project":
            name, data = f"{stem}.json", json.dumps(project, indent=1, ensure_ascii=False).encode()
        elif what == "script":
            name, data = f"{stem}.py", script(project).encode()
        else:
            async with self._exporting:
                head, _, data = (await self._exported(project, what)).partition(b"\n")
            made = json.loads(head or b'{"problem": "The files could not be made."}')
            if "problem" in made:
                self._tell({"event": "refused", "place": f"export of {what}", "problem": made["problem"]})
                raise web.HTTPConflict(text=made["problem"])
            name = made["name"] if made["name"] != "files.zip" else f"{stem}-{what}.zip"
        headers = {"Content-Disposition": f'attachment; filename="{re.sub(r"[^A-Za-z0-9.-]+", "-", name)}"'}
        return web.Response(body=data, content_type="application/octet-stream", headers=headers)

    async def _exported(self, project: Project, what: str) -> bytes:
        """What the process that makes files writes."""
        pipe, none = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        command = (sys.executable, "-c", "from fenicsmech.live.export import main; main()")
        process = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, stderr=none)
        try:
            task = json.dumps({"project": project, "what": what}).encode()
            return (await asyncio.wait_for(process.communicate(task), self._options.longest_export))[0]
        except TimeoutError:
            return json.dumps({"problem": f"it takes longer than {self._options.longest_export:g} s"}).encode()
        finally:
            if process.returncode is None:
                process.kill()
                await ended(process)

    async def _from_page(self, message: Mapping[str, Any], page: Outbox) -> None:
        if message["kind"] == "solve solid":
            self.session.check_curve(message["curve"])
            await self._solid.start({"project": self.session.project, "curve": message["curve"]})
            self._tell(self._state)
            return
        if message["kind"] == "stop solid":
            if await self._solid.stop() or (self._solid.last or {}).get("state") == "solving":
                self._solid.tell({"event": "solid", "state": "cancelled"})
            self._tell(self._state)
            return
        opened = self.session.opened
        answer = self.session.answer(message)
        if message["kind"] == "push":
            self._pushing = page
        elif message["kind"] == "edit":
            self._editing = None if message["settled"] else page
        if answer.stop or answer.task is not None:
            self._number += 1  # before anything is awaited: results of earlier tasks are not of this project
        if answer.changed:
            self._tell(self._project_event())
        if opened != self.session.opened:
            self._kept.clear()
            self._drawn = None
            self._tell(self._first_event())
        if answer.stop:
            self._pushed = False
            self._say("idle")
            await self._solver.interrupt(self._number)
        elif answer.task is not None:
            await self._ask(answer.task)
        else:
            self._tell(self._state)  # every message is answered with one
        if opened != self.session.opened:
            await self._solid.forget()

    # -- solver --------------------------------------------------------------------------------------------------

    async def _ask(self, task: Mapping[str, Any]) -> None:
        self._pushed = task["kind"] == "push"
        self._say("busy")
        await self._solver.ask({**task, "task": self._number, "longest": self._options.longest_solve})

    def _from_solver(self, event: dict[str, Any]) -> None:
        if event["event"] in ("ready", "lost"):
            if event["event"] == "lost":
                self._say("failed")
            return
        if event["task"] != self._number:
            return
        if event["event"] in ("iterate", "fitted"):
            self.session.designed(event["design"])
        if event["event"] in ("done", "failed") and not self._pushed:
            self.session.solved = True
        if event["event"] in ("done", "cancelled", "failed"):
            self._say("idle", seconds=event.get("seconds"))
        text = json.dumps(event)
        if event["event"] in _KEPT and not self._pushed:
            if event["event"] == "mesh":
                self._kept.clear()
            self._kept[event["event"], event.get("curve")] = text
        if event["event"] == "done" and event["task"] == 1 and self._opened is not None:
            self._stored.store(self._opened, self._kept)
        self._send(text)
        self._note_first(event)

    def _note_first(self, event: Mapping[str, Any]) -> None:
        """Keeps curves of the project as it was opened, with their errors, to be compared with."""
        if event["event"] == "curve" and event["iterate"] is None and event["points"]:
            self._drawn = event
        if event["event"] != "errors" or self._drawn is None or self._drawn["curve"] != event["curve"]:
            return
        number, project = event["curve"], self.session.project
        first = self.session.first_curves
        if number not in first and self.session.untouched:
            own = project["curves"][number]
            first[number] = {
                "force": next(force for force in project["forces"] if force["name"] == own["force"]),
                "positions": own["positions"],
                "others": own["others"],
                "held": own.get("held", False),
                "ratios": own.get("ratios"),
                "largest": own["largest"],
                "points": [
                    [point["displacement"], point["force"] + error]
                    if own.get("held")
                    else [point["displacement"] + error, point["force"]]
                    for point, error in zip(self._drawn["points"], event["errors"], strict=True)
                ],
            }
            self._tell(self._first_event())

    def _say(self, state: str, **more: Any) -> None:
        self._state = {"event": "solver", "state": state, "task": self._number, **more}
        self._tell(self._state)

    # -- pages ---------------------------------------------------------------------------------------------------

    def _opening(self) -> list[str]:
        """What a page gets first."""
        project = json.dumps(self._project_event())
        opening = [project, json.dumps(self._first_event()), json.dumps(self._state), *self._kept.values()]
        if self._solid.last is not None:
            opening.append(json.dumps(self._solid.last))
        return [*opening, project]  # designs of what is kept may be those of an earlier task

    def _project_event(self) -> dict[str, Any]:
        return {
            "event": "project",
            "project": self.session.project,
            "undo": self.session.can_undo,
            "redo": self.session.can_redo,
            "opened": self.session.opened,
            "examples": example_names(),
            "materials": materials(),
            "most": {**MOST_ADDED, "bytes": LARGEST_PROJECT},
            "constants": constants(),
        }

    def _first_event(self) -> dict[str, Any]:
        return {"event": "first", "curves": list(self.session.first_curves.values())}

    def _tell(self, event: Mapping[str, Any]) -> None:
        self._send(json.dumps(event))

    def _send(self, text: str) -> None:
        for page in self._pages:
            page.put(text)


class Outbox:
    """What waits to be sent to a page, in its order: a page that does not read holds up no other.

    Args:
        page: an open WebSocket.
        transport: of its connection, which is cut when too much waits; the page connects again, to the present state.
        opening: sent first; however much it is, the page can do with no less.

    Attributes:
        heard: messages of the page so far, which each message to it tells.
    """

    def __init__(
        self, page: web.WebSocketResponse, transport: asyncio.Transport | None, opening: Iterable[str]
    ) -> None:
        self._page, self._transport = page, transport
        self._waiting: asyncio.Queue[tuple[int, str, int]] = asyncio.Queue()  # heard, text, share of the size
        self.heard, self._size = 0, 0
        for text in opening:
            self._waiting.put_nowait((0, text, 0))
        self._work = asyncio.create_task(self._write())

    def put(self, text: str) -> None:
        """Adds a message, a JSON object that is not empty."""
        if self._size > MOST_WAITING and self._transport is not None:
            self._transport.abort()
            return
        self._size += len(text)
        self._waiting.put_nowait((self.heard, text, len(text)))

    async def close(self) -> None:
        """Closes the page."""
        self.end()
        await self._page.close()

    def end(self) -> None:
        """Sends no more."""
        self._work.cancel()

    async def _write(self) -> None:
        while True:
            heard, text, size = await self._waiting.get()
            with suppress(ConnectionError, RuntimeError):  # it has just gone
                await self._page.send_str(f'{{"heard": {heard}, {text[1:]}')
            self._size -= size


def serve(project: Project, *, options: ServerOptions | None = None, browse: bool = True) -> None:
    """Opens the page of a project and serves it until interrupted.

    Args:
        project: shown first.
        options: of the server.
        browse: whether a browser is opened.
    """

    async def run() -> None:
        server, task = Server(project, options), asyncio.current_task()
        assert task is not None, "it runs in one"
        with suppress(ValueError, RuntimeError):  # not in the main thread
            # a plain handler waits for the next event: signals that other threads receive do not wake the loop
            asyncio.get_running_loop().add_signal_handler(signal.SIGINT, task.cancel)
        await server.start()
        print(f"Live page: {server.address}", flush=True)
        try:
            if browse:  # some browsers are waited for
                await asyncio.to_thread(webbrowser.open, server.door())
            await asyncio.Event().wait()
        finally:
            await server.stop()

    with suppress(KeyboardInterrupt, asyncio.CancelledError):
        asyncio.run(run())
