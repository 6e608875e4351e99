"""The server of the live page: who gets in, hostile messages, and a solver process that dies."""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import aiohttp
import pytest

from fenicsmech.files import file_names
from fenicsmech.live import (
    LARGEST,
    MOST_ELEMENTS,
    PER_SECOND,
    Refused,
    Server,
    ServerOptions,
    example,
    read_project,
    serve,
)

# answers each task with its targets, but hangs at a displacement of 6.66, dies at 5.55, and writes no JSON at 4.44
ECHO = """
import json, sys, time
print(json.dumps({"event": "ready"}), flush=True)
for line in sys.stdin:
    task = json.loads(line)
    print(json.dumps({"event": "began", "task": task["task"]}), flush=True)
    if task["kind"] == "solve":
        if task["project"]["targets"][1]["displacement"] == 6.66:
            time.sleep(1000)
        if task["project"]["targets"][1]["displacement"] == 5.55:
            sys.exit(1)
        if task["project"]["targets"][1]["displacement"] == 4.44:
            print('{"event": ', flush=True)
            continue
        print(json.dumps({"event": "remark", "task": task["task"], "targets": task["project"]["targets"]}), flush=True)
"""
# answers the first task with a curve, and nothing later
ONCE = """
import json, sys
task = json.loads(sys.stdin.readline())["task"]
for event in ({"event": "mesh"}, {"event": "curve", "curve": 0, "iterate": None, "points": [7]}, {"event": "done"}):
    print(json.dumps(event | {"task": task}), flush=True)
sys.stdin.read()
"""
# answers each task with a curve and its errors, which grow
ALWAYS = """
import json, sys
for line in sys.stdin:
    task = json.loads(line)["task"]
    points = [{"displacement": 0.0, "force": 0.0}, {"displacement": 1.5, "force": 0.5}]
    for event in ({"event": "curve", "curve": 0, "iterate": None, "points": points}, {"event": "done"}):
        print(json.dumps(event | {"task": task}), flush=True)
        print(json.dumps({"event": "errors", "curve": 0, "errors": [0.0, 0.5 * task], "task": task}), flush=True)
"""
SILENT = "import sys; sys.stdin.read()"
OPTIONS = ServerOptions(patience=2.0, solver=(sys.executable, "-c", ECHO), stored=None)


def run(test, project=None, options=OPTIONS):
    """Runs a coroutine function with a server, and a client with cookies of none."""

    async def main():
        server = Server(project or example("truss-finger"), options)
        await server.start()
        try:
            async with aiohttp.ClientSession() as client:
                return await asyncio.wait_for(test(server, client), 60)
        finally:
            await server.stop()

    return asyncio.run(main())


def origin(server):
    return {"Origin": f"http://127.0.0.1:{server.port}"}


def socket(server, client):
    return client.ws_connect(server.address + "ws", headers=origin(server))


async def until(page, event, **values):
    """The next event of a sort with some values."""
    while True:
        found = json.loads((await page.receive(timeout=30)).data)
        if found["event"] == event and all(found[key] == value for key, value in values.items()):
            return found


def edit(displacement):
    change = {"kind": "set", "path": ["targets", 1, "displacement"], "value": displacement}
    return json.dumps({"kind": "edit", "changes": [change], "settled": True})


def test_the_page_comes_with_its_token_alone_and_loads_nothing_from_elsewhere():
    async def test(server, client):
        async with client.get(server.address) as found:
            assert found.status == 200 and "default-src 'self'" in found.headers["Content-Security-Policy"]
            assert "http" not in (await found.text()).replace("http-equiv", "")
        other = server.address.replace(server.token, "guess")
        statuses = []
        for address in (other, other + "ws", f"http://127.0.0.1:{server.port}/", server.address + "page/../server.py"):
            async with client.get(address, headers=origin(server)) as found:
                statuses.append(found.status)
        assert statuses[:3] == [403, 403, 403] and statuses[3] in (403, 404)
        for encoded in ("page/%2e%2e/server.py", "page/..%2fserver.py"):
            async with client.get(server.address + encoded) as found:
                assert found.status in (403, 404)

    run(test)


@pytest.mark.parametrize("headers", [{"Host": "evil.example"}, {"Origin": "https://evil.example"}, {"Origin": "null"}])
def test_pages_of_other_origins_get_nothing(headers):
    async def test(server, client):
        for address in (server.address, server.address + "page/main.js"):
            async with client.get(address, headers=headers) as found:
                assert found.status == 403
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await client.ws_connect(server.address + "ws", headers=origin(server) | headers)
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await client.ws_connect(server.address + "ws")  # no browser leaves out the origin

    run(test)


def test_an_edit_reaches_every_page_and_the_solver():
    async def test(server, client):
        async with socket(server, client) as one, socket(server, client) as other:
            await until(one, "project")
            await one.send_str(edit(7.5))
            for page in (one, other):
                while (await until(page, "remark"))["targets"][1]["displacement"] != 7.5:
                    pass

    run(test)


def test_a_solver_process_that_is_killed_gets_the_project_again():
    async def test(server, client):
        async with socket(server, client) as page:
            await page.send_str(edit(7.5))
            while (await until(page, "remark"))["targets"][1]["displacement"] != 7.5:
                pass
            before = server.solver_pid
            os.kill(before, signal.SIGKILL)
            assert (await until(page, "remark"))["targets"][1]["displacement"] == 7.5
            assert server.solver_pid != before
            await page.send_str('{"kind": "undo"}')
            assert (await until(page, "remark"))["targets"][1]["displacement"] == 9.0

    run(test)


@pytest.mark.parametrize("fatal", [5.55, 4.44])
def test_a_solver_process_that_dies_again_and_again_is_started_for_the_next_gesture(fatal):
    async def test(server, client):
        async with socket(server, client) as page:
            await page.send_str(edit(fatal))
            await until(page, "solver", state="failed")
            await page.send_str('{"kind": "undo"}')
            assert (await until(page, "remark"))["targets"][1]["displacement"] == 9.0

    run(test)


def test_a_solver_process_that_hangs_is_replaced_at_the_next_gesture():
    async def test(server, client):
        async with socket(server, client) as page:
            await page.send_str(edit(6.66))
            await until(page, "project")
            before = server.solver_pid
            await page.send_str(edit(7.0))
            while (await until(page, "remark"))["targets"][1]["displacement"] != 7.0:
                pass
            assert server.solver_pid != before

    run(test)


def test_a_solver_process_that_does_not_end_its_task_in_time_is_replaced_and_the_reason_told():
    options = replace(OPTIONS, longest_solve=0.2)

    async def test(server, client):
        async with socket(server, client) as page:
            await until(page, "remark")
            await page.send_str(edit(6.66))
            failed = await until(page, "failed")
            assert "longer than 0.2 s" in failed["problem"] and "larger elements" in failed["remedy"]
            await page.send_str(edit(7.0))
            assert (await until(page, "remark"))["targets"][1]["displacement"] == 7.0

    run(test, options=options)


def test_a_solver_process_that_hangs_is_replaced_after_a_stop():
    async def test(server, client):
        async with socket(server, client) as page:
            await until(page, "remark")
            await page.send_str(edit(6.66))
            await until(page, "solver", state="busy")
            before = server.solver_pid
            await asyncio.sleep(0.3)
            await page.send_str('{"kind": "stop"}')
            await until(page, "solver", state="idle")
            while server.solver_pid == before:
                await asyncio.sleep(0.05)

    run(test, options=replace(OPTIONS, patience=0.5))


def test_a_solver_process_that_cannot_be_started_again_is_reported(monkeypatch):
    create = asyncio.create_subprocess_exec

    async def test(server, client):
        async def never(*command, **options):
            raise BlockingIOError("no processes are left")

        async with socket(server, client) as page:
            await until(page, "remark")
            monkeypatch.setattr(asyncio, "create_subprocess_exec", never)
            os.kill(server.solver_pid, signal.SIGKILL)
            await until(page, "solver", state="failed")
            await page.send_str(edit(7.5))
            await until(page, "solver", state="failed")
            monkeypatch.setattr(asyncio, "create_subprocess_exec", create)
            await page.send_str(edit(7.0))
            assert (await until(page, "remark"))["targets"][1]["displacement"] == 7.0

    run(test)


def test_what_a_page_pushes_and_edits_ends_with_it():
    push = '{"kind": "push", "curve": 0, "force": 0.2}'
    unsettled = json.loads(edit(7.5)) | {"settled": False}

    async def test(server, client):
        async with socket(server, client) as other:
            async with socket(server, client) as page:
                await page.send_str(json.dumps(unsettled))
                await page.send_str(push)
                await until(other, "solver", state="busy", task=3)
            assert (await until(other, "solver", state="busy", task=4)) and not server.session.solved
            await other.send_str(edit(6.0))
            await other.send_str('{"kind": "undo"}')
            while (found := await until(other, "project"))["project"]["targets"][1]["displacement"] != 7.5:
                pass
            assert found["undo"]

    run(test)


def test_curves_of_another_project_are_not_those_of_one_that_is_opened_or_opened_again():
    async def kinds(server, client):
        async with socket(server, client) as page:
            await page.send_str('{"kind": "stop solid"}')
            found = []
            while not found or found[-1]["heard"] < 1:
                found.append(json.loads((await page.receive(timeout=30)).data))
            return {event["event"] for event in found}, next(own for own in found if own["event"] == "first")["curves"]

    async def test(server, client):
        async with socket(server, client) as page:
            while not (first := (await until(page, "first"))["curves"]):
                pass
            await page.send_str('{"kind": "example", "name": "snapping-switch"}')
            await until(page, "project", opened=2)
            events, curves = await kinds(server, client)
            assert "curve" not in events and "errors" not in events and not curves
            await page.send_str('{"kind": "undo"}')
            await until(page, "project", opened=1)
            assert (await kinds(server, client))[1] == first

    once = ALWAYS.replace('["task"]\n', '["task"]\n    if task > 1:\n        continue\n', 1)
    run(test, options=ServerOptions(solver=(sys.executable, "-c", once), stored=None))


def test_a_request_without_a_path_is_refused():
    async def test(server, _):
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(f"OPTIONS * HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
        assert b" 403 " in await reader.readline()
        writer.close()

    run(test)


def test_a_page_has_stored_results_of_its_project_before_the_solver_answers(tmp_path, monkeypatch):
    card = tmp_path / "package" / "rubber.toml"
    card.parent.mkdir()
    card.write_text("E = 1")
    monkeypatch.setattr(sys.modules["fenicsmech.live.stored"], "PACKAGE", card.parent)

    async def solved(server, client):
        async with socket(server, client) as page:
            await until(page, "curve")
            await until(page, "solver", state="idle")

    async def at_once(server, client):
        async with socket(server, client) as page:
            await page.send_str('{"kind": "stop"}')
            found = [{}]
            while found[-1].get("state") != "idle":
                found.append(json.loads((await page.receive(timeout=30)).data))
            return [event["points"] for event in found if event.get("event") == "curve"]

    once, silent = (
        ServerOptions(solver=(sys.executable, "-c", solver), stored=tmp_path / "stored") for solver in (ONCE, SILENT)
    )
    assert run(at_once, options=silent) == []
    run(solved, options=once)
    assert run(at_once, options=silent) == [[7]] and (tmp_path / "stored").stat().st_mode & 0o777 == 0o700
    other = example("truss-finger") | {"name": "another finger"}
    assert run(at_once, other, silent) == []
    card.write_text("E = 2")
    assert run(at_once, options=silent) == []
    card.write_text("E = 1")
    (path,) = (tmp_path / "stored").iterdir()
    path.write_text("[1, 2")
    assert run(at_once, options=silent) == []


def test_without_a_home_nothing_is_stored(monkeypatch):
    def home():
        raise RuntimeError("no home")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("pathlib.Path.home", home)
    assert ServerOptions().stored is None


def test_curves_of_the_project_as_it_was_opened_stay_to_be_compared_with():
    async def test(server, client):
        async with socket(server, client) as page:
            while not (found := (await until(page, "first"))["curves"]):
                pass
            await page.send_str(edit(7.5))
            await until(page, "errors")
        async with socket(server, client) as page:
            assert (await until(page, "first"))["curves"] == found
        return found

    (first,) = run(test, options=ServerOptions(solver=(sys.executable, "-c", ALWAYS), stored=None))
    assert first["points"] == [[0.0, 0.0], [2.0, 0.5]] and first["force"]["name"] == "push on tip"


def test_two_tasks_that_find_no_solver_start_one():
    def children():
        found = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
        return {pid for pid in found if ECHO.encode() in Path(f"/proc/{pid}/cmdline").read_bytes()}

    async def test(server, client):
        pages = [await socket(server, client) for _ in range(2)]
        await pages[0].send_str(edit(5.55))
        for page in pages:
            await until(page, "solver", state="failed")
        await asyncio.gather(*(page.send_str(edit(7.0 + k)) for k, page in enumerate(pages)))
        assert (await until(pages[0], "remark"))["targets"][1]["displacement"] in (7.0, 8.0)
        return children() - before, {str(server.solver_pid)}

    before = children()
    found, wanted = run(test)
    assert found == wanted


def test_a_task_that_meets_the_start_of_its_solver_is_done_once(monkeypatch):
    create = asyncio.create_subprocess_exec

    async def test(server, client):
        starting = asyncio.Event()

        async def slowly(*command, **options):
            starting.set()
            await asyncio.sleep(0.3)
            return await create(*command, **options)

        async with socket(server, client) as page:
            await until(page, "remark")
            monkeypatch.setattr(asyncio, "create_subprocess_exec", slowly)
            os.kill(server.solver_pid, signal.SIGKILL)
            await starting.wait()
            await page.send_str(edit(7.5))
            await until(page, "remark")
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(until(page, "remark"), 0.5)

    run(test)


def test_events_tell_which_messages_of_their_page_they_know():
    async def test(server, client):
        async with socket(server, client) as one, socket(server, client) as other:
            for k in range(1, 4):
                await one.send_str(edit(7.0 + k))
                found = await until(one, "project", heard=k)
                assert found["project"]["targets"][1]["displacement"] == 7.0 + k
            while (found := await until(other, "project"))["project"]["targets"][1]["displacement"] != 10.0:
                pass
            assert found["heard"] == 0

    run(test)


def test_a_page_opens_however_large_the_project_is(monkeypatch):
    monkeypatch.setattr(sys.modules["fenicsmech.live.server"], "MOST_WAITING", 10)

    async def test(server, client):
        async with socket(server, client) as page:
            await until(page, "solver", state="busy")
            await until(page, "project")  # the last of what a page gets first

    run(test, options=ServerOptions(solver=(sys.executable, "-c", SILENT), stored=None))


def test_the_address_is_not_on_the_command_line_of_the_browser(monkeypatch, capsys):
    opened = []

    def browser(door):
        opened.append(door)
        raise InterruptedError

    monkeypatch.setattr("webbrowser.open", browser)
    with pytest.raises(InterruptedError):
        serve(example("truss-finger"), options=OPTIONS)
    (door,), (address, token) = opened, capsys.readouterr().out.split()[-1].rstrip("/").rsplit("/", 1)
    assert door.startswith(f"{address}/open/") and len(token) == 32 and token not in door


SCRIPT = """
import sys
import fenicsmech as fm
beam = fm.Mechanism("beam")
ground = beam.rigid("ground", fixed=True)
leaf = beam.flexible("leaf", fm.strip([(0, 0), (40, 0)], thickness=2.0, depth=5.0), fm.ONYX)
beam.weld(ground, leaf, at=(0, 0), interface_radius=2.0)
pull = beam.force(on=leaf, at=(40, 0), direction=(0, 1))
sim = fm.Simulation(fm.Scene(beam), space="plane-stress", size=2.0)
targets = [fm.Target(pull, force=0.1, displacement=1.0)]
fm.live(fm.DesignProblem(sim, [fm.SplineDesign(leaf, 2)], targets=targets), browse=False)
print("ended", file=sys.stderr)
"""


@pytest.mark.thorough
def test_a_script_serves_its_problem_here_alone_under_a_token_until_it_is_interrupted():
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=pipe, stderr=pipe, text=True) as process:
        try:
            address = process.stdout.readline().split()[-1]
            host, token = re.fullmatch(r"http://([^:]+):\d+/([\w-]{32})/", address).groups()
            process.send_signal(signal.SIGPIPE)  # as what is written to a page that has gone
            with urllib.request.urlopen(address) as page:
                assert host == "127.0.0.1" and page.status == 200
            with urllib.request.urlopen(address + "export/project") as found:
                assert json.load(found)["targets"][0]["displacement"] == 1.0
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(address.replace(token, "x" * 32))
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            solvers = [own for own in children if "live.solver" in Path(f"/proc/{own}/cmdline").read_text()]
            process.send_signal(signal.SIGINT)
            assert "ended" in process.communicate(timeout=30)[1] and process.returncode == 0
            assert solvers and not any(Path(f"/proc/{own}").exists() for own in solvers)
        finally:
            process.kill()


@pytest.mark.thorough
def test_a_page_ends_by_an_interrupt_that_another_thread_receives():
    struck = """
import signal, sys, threading
from fenicsmech.live import example, serve

def strike():
    sys.stdin.readline()
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)

threading.Thread(target=strike, daemon=True).start()
serve(example("truss-finger"), browse=False)
print("ended")
"""
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", struck], stdin=pipe, stdout=pipe, text=True) as process:
        try:
            assert process.stdout.readline().startswith("Live page: ")
            time.sleep(1.0)  # until nothing happens but the interrupt
            assert process.communicate("now\n", timeout=30)[0] == "ended\n" and process.returncode == 0
        finally:
            process.kill()


def test_the_address_that_opens_the_browser_works_once_soon_and_here_alone():
    async def status(client, address, **headers):
        async with client.get(address, headers=headers, allow_redirects=False) as found:
            return found.status, found.headers.get("Location")

    async def test(server, client):
        door = server.door()
        assert await status(client, door, Host="evil.example") == (403, None)
        assert await status(client, door) == (302, server.address)
        assert await status(client, door) == (403, None)
        assert await status(client, door[:-1]) == (403, None)

    async def too_late(server, client):
        assert await status(client, server.door()) == (403, None)

    run(test)
    run(too_late, options=ServerOptions(door=0.0, solver=OPTIONS.solver, stored=None))


def test_project_and_script_are_downloads_and_nothing_else_is():
    async def test(server, client):
        async with client.get(server.address + "export/project") as found:
            assert json.loads(await found.text()) == example("truss-finger")
            assert found.headers["Content-Disposition"] == 'attachment; filename="truss-finger.json"'
        async with client.get(server.address + "export/script") as found:
            compile(await found.text(), "design.py", "exec")
        for what in ("passwd", "..%2f..%2fetc%2fpasswd", "step/more"):
            async with client.get(server.address + "export/" + what) as found:
                assert found.status == 404

    run(test)


# -- hostile projects and messages ---

ODDITIES = ({"hostile": 1}, [[[]]], math.nan, math.inf, -math.inf, 10**400, "\x00", "x" * 1000, {"__class__": "x"})


def mutilated(rng, data):
    """Plain data with one value replaced by what no schema allows there, or one entry more in a record."""
    data = deepcopy(data)
    at = data
    while True:
        steps = list(at) if isinstance(at, dict) else list(range(len(at)))
        step = rng.choice(steps)
        deeper = isinstance(at[step], dict | list) and at[step]
        if deeper and rng.random() < 0.85:
            at = at[step]
        elif isinstance(at, dict) and rng.random() < 0.2:
            at["hostile"] = rng.choice(ODDITIES)  # no record has it, and no mechanism such a part
            return data
        else:
            at[step] = rng.choice(ODDITIES)
            return data


def places(data, path=()):
    """All paths in plain data."""
    own = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for step, value in own:
        yield [*path, step]
        yield from places(value, (*path, step))


def hostile(count, seed):
    """Messages that are nearly right, none of which fits."""
    rng, project = random.Random(seed), example("truss-finger")
    paths, nowhere = list(places(project)), ("nothing", "__class__", -1, 10**6, 1.5, None, ["links"], "x" * 50)
    right = [
        {"kind": "edit", "changes": [{"kind": "set", "path": ["targets", 1, "weight"], "value": 2.0}], "settled": True},
        *({"kind": "open", "project": project}, {"kind": "push", "curve": 0, "force": 0.2}),
        *({"kind": "example", "name": "truss-finger"}, {"kind": "undo"}, {"kind": "fit"}, {"kind": "stop"}),
    ]
    for _ in range(count):
        sort = rng.choice(("cut", "mutilated", "value", "nowhere", "letters", "bytes"))
        if sort == "cut":
            text = json.dumps(rng.choice(right))
            yield text[: rng.randrange(len(text))]
        elif sort == "mutilated":
            yield json.dumps(mutilated(rng, rng.choice(right)))
        elif sort == "bytes":
            yield rng.randbytes(rng.randrange(60))
        elif sort == "letters":
            yield "".join(
                chr(rng.choice((rng.randrange(128), rng.randrange(0xD800)))) for _ in range(rng.randrange(40))
            )
        else:
            path, value = list(rng.choice(paths)), rng.choice(ODDITIES)
            if sort == "nowhere":
                path.insert(rng.randrange(len(path) + 1), rng.choice(nowhere))
            change = {"kind": rng.choice(("set", "set", "insert")), "path": path, "value": value}
            yield json.dumps({"kind": "edit", "changes": [change], "settled": rng.random() < 0.5})


NAMES = ("../../x", "/x", "a/b", "..", "a b", "a-b", "A-B", "\u202e\u0301", "x" * 160, "\u6881" * 160)


def test_whatever_project_is_read_has_files_of_its_folder_and_not_too_many_elements(tmp_path):
    rng, text, kept = random.Random(2), json.dumps(example("truss-finger")), 0
    names = [own["name"] for own in example("truss-finger")["links"]]
    for _ in range(300):
        chosen, found = rng.sample(NAMES, len(names)), text
        for before, after in zip(names, chosen, strict=True):
            found = found.replace(f'"{before}"', json.dumps(after))
        project = json.loads(found)
        shapes, size = [own["shape"] for own in project["links"] if "shape" in own], 10 ** rng.uniform(-3, 3)
        project["simulation"] |= {"size": size, "sizes": {rng.choice(chosen): 10 ** rng.uniform(-3, 3)}}
        for own in shapes:
            own["thickness"] *= 10 ** rng.uniform(-3, 2)
        try:
            project = read_project(project)
        except Refused as refused:
            assert refused.place == "simulation.size" or "thickness" in refused.place
            continue
        kept += 1
        for own in shapes:
            length = sum(math.dist(*ends) for ends in itertools.pairwise(own["line"]))
            name = next(link["name"] for link in project["links"] if link.get("shape") == own)
            finest = size * project["simulation"]["sizes"].get(name, 1.0)
            assert length * own["thickness"] / (0.43 * finest**2) <= MOST_ELEMENTS
        for name in file_names(own["name"] for own in project["links"]):
            assert (tmp_path / f"{name}.step").resolve().parent == tmp_path.resolve()
    assert 50 < kept < 250


def test_ten_thousand_hostile_messages_are_refused_and_change_nothing():
    messages = list(hostile(10_000, seed=1))

    async def test(server, client):
        for k in range(0, len(messages), PER_SECOND):  # as many as a page may send in a second
            async with socket(server, client) as page:
                some = messages[k : k + PER_SECOND]
                for message in some:
                    await (page.send_bytes if isinstance(message, bytes) else page.send_str)(message)
                for _ in some:
                    assert "messages a second" not in (await until(page, "refused"))["problem"]
        async with socket(server, client) as page:
            with suppress(aiohttp.ClientOSError, ConnectionError):  # it may be closed before all is sent
                await page.send_str("x" * (LARGEST + 1))
                while (message := await page.receive(timeout=30)).type is aiohttp.WSMsgType.TEXT:
                    pass
                assert message.data == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
        return server.session

    session = run(test)
    assert session.project == example("truss-finger") and not session.can_undo
