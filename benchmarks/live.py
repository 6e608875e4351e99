"""Times and memory of the live page: cold start, preview, first results after a release, cancelling, gestures in a row.

    python3 -m benchmarks.live [--gestures N] [--drags N] [--write]

A frame is the median time of one frame of the truss finger's curve in plane stress, measured before each value that is
given in frames: other work on the machine slows down both. The server and its solver are processes of their own, as
``python3 -m fenicsmech.live`` starts them, with the bytecode that the first start leaves; the browser is Debian's
Chromium without a screen. In the browser times are the page's own, from the release of the pointer on; previews are
counted as they are drawn, in a drag that moves with every frame of the screen.
"""

import asyncio
import json
import os
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import aiohttp
from selenium.webdriver import ActionChains, Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By

from fenicsmech.live import draw, example, forces_of
from fenicsmech.report import format_table

from .table import command, publish

DRIVER = "/usr/bin/chromedriver"
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1280,800")
HEADERS = ("figure", "median", "worst", "unit", "median in frames", "worst in frames", "wanted")
LONGEST = 300.0  # s, of anything that is waited for
# bytecode is kept, whatever the environment says
BYTECODE = TemporaryDirectory()
ENVIRONMENT = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": BYTECODE.name}

# times of the page itself after a release, and previews drawn while the pointer moves with the screen
WATCH = """
const watch = window.watch = {}, state = document.getElementById("state"), now = () => performance.now();
addEventListener("pointerdown", (event) => { watch.pointer = event.pointerId; }, true);
addEventListener("pointerup", () => {
  Object.assign(watch, { released: now(), first: null, shown: null, idle: null, curve: live.store.curves[0] });
}, true);
new MutationObserver(() => {
  if (watch.released && !watch.first && /step [1-9]/.test(state.textContent)) watch.first = now() - watch.released;
}).observe(state, { childList: true, characterData: true, subtree: true });
const look = () => {
  if (watch.released && !watch.shown && live.store.curves[0] !== watch.curve) watch.shown = now() - watch.released;
  if (watch.first && !watch.idle && document.body.dataset.solver === "idle") watch.idle = now() - watch.released;
  requestAnimationFrame(look);
};
look();
watch.move = (handle, x, y, seconds) => new Promise((resolve) => {
  const count = () => live.chart.frames + live.store.leans, began = now(), before = count(), gaps = [];
  let last = began;
  const frame = (time) => {
    gaps.push(time - last);
    last = time;
    const clientX = x + 40 * Math.sin((now() - began) / 250);
    const pointerId = watch.pointer;
    handle.dispatchEvent(new PointerEvent("pointermove", { pointerId, clientX, clientY: y, bubbles: true }));
    if (now() - began < 1000 * seconds) requestAnimationFrame(frame);
    else resolve([(count() - before) / (now() - began) * 1000, Math.max(...gaps.slice(1))]);
  };
  requestAnimationFrame(frame);
});
"""

# a node in the middle of the link, from the middle of the picture and of the window
MIDDLE = """
const { view } = live, nodes = view.now.nodes[0], box = view.svg.getBoundingClientRect();
const middle = nodes.reduce((sum, node) => sum + node[1], 0) / nodes.length;
const apart = (node) => Math.abs(node[1] - middle);
const node = nodes.reduce((best, node) => apart(node) < apart(best) ? node : best);
const [x, y] = [view.origin[0] + view.scale * node[0], view.origin[1] - view.scale * node[1]];
return [x - box.width / 2, y - box.height / 2, box.x + x, box.y + y].map(Math.round);
"""


class Frames:
    """The time of a frame of the finished example's drawn design, mesh and forms ready."""

    def __init__(self) -> None:
        project = example("truss-finger")
        drawing = draw(project)
        self._simulation = drawing.simulation
        self._request = drawing.request(project, 0, forces_of(project, 0))
        self.seconds()

    def seconds(self) -> float:
        """Of one frame, now: the median over the loaded frames of a curve."""
        frames = self._simulation.compute(self._request).frames
        return median(frame.seconds for frame in frames if frame.force)


@dataclass(frozen=True)
class Running:
    """A live page at work.

    Attributes:
        process: the server.
        address: of the page.
    """

    process: subprocess.Popen
    address: str

    @property
    def solver(self) -> int:
        """The solver's process."""
        pid = self.process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return next(int(own) for own in children if "live.solver" in Path(f"/proc/{own}/cmdline").read_text())

    def memory(self) -> tuple[float, float]:
        """Resident memory of server and solver, MB."""
        return _resident(self.process.pid), _resident(self.solver)

    @property
    def origin(self) -> dict[str, str]:
        """The header of its own page."""
        return {"Origin": self.address.rsplit("/", 2)[0]}


def _resident(pid: int) -> float:
    found = re.search(r"VmRSS:\s*(\d+)", Path(f"/proc/{pid}/status").read_text())
    assert found is not None, "it runs"
    return int(found[1]) / 1024.0


@contextmanager
def running(project: Path | None = None) -> Iterator[Running]:
    """``python3 -m fenicsmech.live``, until the end of the block."""
    arguments = [] if project is None else [str(project)]
    line = [sys.executable, "-m", "fenicsmech.live", "--no-browser", *arguments]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
    try:
        assert process.stdout is not None, "it is a pipe"
        yield Running(process, process.stdout.readline().split()[-1])
    finally:
        process.terminate()
        process.wait()


@contextmanager
def browsing() -> Iterator[Chrome]:
    """A browser, until the end of the block."""
    options = ChromeOptions()
    for option in OPTIONS:
        options.add_argument(option)
    browser = Chrome(service=Service(DRIVER), options=options)
    try:
        yield browser
    finally:
        browser.quit()


def until(browser: Chrome, condition: str) -> None:
    """Waits for a condition in JavaScript."""
    end = perf_counter() + LONGEST
    while not browser.execute_script(f"return {condition}"):
        assert perf_counter() < end, f"not in time: {condition}"
        sleep(0.005)


SETTLED = "window.live && document.body.dataset.solver === 'idle' && live.store.linear && live.store.curves[0]"


def start(project: Path | None) -> float:
    """Seconds from the command to a page that moves, in a browser that is open."""
    with browsing() as browser:
        began = perf_counter()
        with running(project) as page:
            browser.get(page.address)
            until(browser, "window.live && live.store.curves[0] && live.store.load > 0")
            passed = perf_counter() - began
            until(browser, SETTLED)
            return passed


def starts(frames: Frames, count: int) -> list[tuple]:
    """Cold starts, with and without results of an earlier one."""
    start(None)  # forms are compiled, and first results stored
    again, anew = [], []
    with TemporaryDirectory() as folder:
        for k in range(count):
            frame = frames.seconds()
            again.append((start(None), frame))
            path = Path(folder) / "project.json"
            path.write_text(json.dumps(example("truss-finger") | {"name": f"finger {perf_counter()} {k}"}))
            anew.append((start(path), frame))
    return [
        _line("start to a moving page", again, "s", wanted="≤ 5 s"),
        _line("of a project that was never opened", anew, "s"),
    ]


def drags(frames: Frames, count: int) -> list[tuple]:
    """Drags of a target in the browser, there and back."""
    rates, gaps, first, shown, idle = [], [], [], [], []
    with running() as page, browsing() as browser:
        browser.get(page.address)
        until(browser, SETTLED)
        browser.execute_script(WATCH)
        for k in range(count):
            frame = frames.seconds()
            way = browser.execute_script("return live.chart.px([1, 0])[0] - live.chart.px([0, 0])[0]") * (-1) ** (k + 1)
            handle = browser.find_elements(By.CSS_SELECTOR, "#chart .target")[1]
            ActionChains(browser, duration=0).move_to_element(handle).click_and_hold().perform()
            box = handle.rect
            place = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
            rate, gap = browser.execute_script(
                "return window.watch.move(arguments[0], arguments[1], arguments[2], 2)", handle, *place
            )
            ActionChains(browser, duration=10).move_by_offset(round(way), 0).release().perform()
            until(browser, "window.watch.idle")
            times = browser.execute_script("return [watch.first, watch.shown, watch.idle]")
            rates.append((rate, None))
            gaps.append((gap, None))
            for own, value in zip((first, shown, idle), times, strict=True):
                own.append((value / 1000.0, frame))
            until(browser, SETTLED)
    return [
        _line("previews drawn during a drag", rates, "1/s", wanted="≥ 30 / s", worst=min),
        _line("longest gap between two frames of the screen", gaps, "ms"),
        _line("release to the first iterate", first, "s", wanted="≤ 30 frames"),
        _line("release to the first new curve", shown, "s"),
        _line("release to the end", idle, "s"),
    ]


def pushes(frames: Frames, count: int) -> list[tuple]:
    """Pushes of the middle of the link in the browser: its response, and previews while the solver follows."""
    held, rates, gaps = [], [], []
    with running() as page, browsing() as browser:
        browser.get(page.address)
        until(browser, SETTLED)
        browser.execute_script(WATCH)
        browser.find_element(By.ID, "play").click()
        view = browser.find_element(By.ID, "view")
        for k in range(count):
            frame = frames.seconds()
            browser.execute_script("live.store.load = arguments[0]; live.store.show()", 0.2 + 0.5 * k / count)
            across, down, x, y = browser.execute_script(MIDDLE)
            ActionChains(browser, duration=0).move_to_element_with_offset(view, across, down).click_and_hold().perform()
            began = perf_counter()
            until(browser, "live.handles.pushed.held && live.handles.pushed.from")
            held.append((perf_counter() - began, frame))
            rate, gap = browser.execute_script(
                "return window.watch.move(arguments[0], arguments[1], arguments[2], 2)", view, x, y
            )
            rates.append((rate, None))
            gaps.append((gap, None))
            ActionChains(browser).release().perform()
            until(browser, SETTLED)
    return [
        _line("taking hold of a link to its linear response", held, "s"),
        _line("previews drawn during a push", rates, "1/s", wanted="≥ 30 / s", worst=min),
        _line("longest gap between two frames of the screen in a push", gaps, "ms"),
    ]


async def _edit(page, displacement: float) -> None:
    change = {"kind": "set", "path": ["targets", 1, "displacement"], "value": displacement}
    await page.send_str(json.dumps({"kind": "edit", "changes": [change], "settled": True}))


async def _event(page, *names: str, after: int = -1) -> dict:
    """The next event with one of some names, of a task after one."""
    while True:
        event = json.loads((await page.receive(timeout=LONGEST)).data)
        if event["event"] in names and event.get("task", 0) > after:
            return event


def cancels(frames: Frames, count: int) -> list[tuple]:
    """Gestures at random times of the solve that they cancel."""
    rng, found = random.Random(0), []

    async def run(server: Running) -> None:
        async with aiohttp.ClientSession() as client:
            async with client.ws_connect(server.address + "ws", headers=server.origin, max_msg_size=0) as page:
                await _event(page, "done")
                for k in range(count):
                    frame = frames.seconds()
                    await _edit(page, 8.0 + 0.02 * k)
                    number = (await _event(page, "began"))["task"]
                    await asyncio.sleep(rng.uniform(0.0, 150.0 * frame))
                    began = perf_counter()
                    await _edit(page, 8.01 + 0.02 * k)
                    await _event(page, "began", after=number)
                    found.append((perf_counter() - began, frame))
                    await _event(page, "iterate")

    with running() as server:
        asyncio.run(run(server))
    return [_line("gesture to the end of the solve that it cancels", found, "s")]


def memory(count: int) -> list[tuple]:
    """Growth of both processes by gestures, of which every tenth is waited for and every fiftieth moves a joint."""
    sizes = []

    async def run(server: Running) -> None:
        async with aiohttp.ClientSession() as client:
            async with client.ws_connect(server.address + "ws", headers=server.origin, max_msg_size=0) as page:
                number = (await _event(page, "done"))["task"]
                for k in range(count):
                    if k % 50 == 49:
                        change = {"kind": "set", "path": ["joints", 2, "at"], "value": [0.01 * (k % 7), 60.0]}
                        await page.send_str(json.dumps({"kind": "edit", "changes": [change], "settled": True}))
                    else:
                        await _edit(page, 8.0 + 0.001 * (k % 700))
                    names = ("done", "failed") if k % 10 == 9 else ("iterate", "failed")
                    number = (await _event(page, *names, after=number))["task"]
                    if k + 1 in (max(count // 10, 1), count):
                        sizes.append(server.memory())

    with running() as server:
        asyncio.run(run(server))
    lines, (before, after) = [], sizes
    for name, first, last in zip(("server", "solver"), before, after, strict=True):
        text = f"{name} after {count} gestures, over that after {max(count // 10, 1)} ({first:.0f} MB)"
        lines.append((text, 100.0 * (last / first - 1.0), None, "%", None, None, "≤ 10 %"))
    return lines


def _line(figure: str, found: list[tuple], unit: str, *, wanted: str | None = None, worst=max) -> tuple:
    """A line of the table from values, each with the time of a frame or None."""
    values = [value for value, _ in found]
    ratios = [value / frame for value, frame in found if frame is not None]
    in_frames = (median(ratios), worst(ratios)) if ratios else (None, None)
    return figure, median(values), worst(values), unit, *in_frames, wanted


def main() -> None:
    """Reads the options and measures."""
    parser = command(__doc__)
    parser.add_argument("--gestures", type=int, default=1000, help="of the measurement of memory")
    parser.add_argument("--drags", type=int, default=8, help="in the browser")
    parser.add_argument("--starts", type=int, default=3, help="of each sort")
    parser.add_argument("--cancels", type=int, default=30, help="gestures that cancel a solve")
    options = parser.parse_args()
    frames, lines = Frames(), []
    for measure in (
        lambda: [_line("a frame in plane stress", [(1000.0 * frames.seconds(), None) for _ in range(9)], "ms")],
        lambda: starts(frames, options.starts),
        lambda: drags(frames, options.drags),
        lambda: pushes(frames, options.drags),
        lambda: cancels(frames, options.cancels),
        lambda: memory(options.gestures),
    ):
        found = measure()
        print(*(" ".join(map(str, line)) for line in found), sep="\n", flush=True)
        lines += found
    publish("live", format_table(HEADERS, lines, digits=3), write=options.write)


if __name__ == "__main__":
    main()
