"""The live page in a browser, with its solver: what somebody does who holds the curve in the hand.

Screenshots stay in results/live/.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from selenium.webdriver import ActionChains, Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.actions import interaction
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.pointer_input import PointerInput
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

import fenicsmech as fm
from fenicsmech.live import Server, ServerOptions, edited, example, project_of

pytestmark = pytest.mark.slow
PICTURES = Path(__file__).parents[2] / "results" / "live"
LONGEST = 200.0  # s, of one solve on a machine that does other things as well


def with_few_frames(name, steps):
    """An example whose curves have few frames."""
    project = example(name)
    curves = range(len(project["curves"]))
    return edited(project, [{"kind": "set", "path": ["curves", k, "steps"], "value": steps} for k in curves])


FINGER = with_few_frames("truss-finger", 4)
MOTOR = with_few_frames("four-bar-with-a-motor", 2) | {"fit": False}


@contextmanager
def serving():
    """A server in a thread of its own."""
    loop, server = asyncio.new_event_loop(), Server(FINGER, ServerOptions(stored=None))
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    asyncio.run_coroutine_threadsafe(server.start(), loop).result(60)
    try:
        yield server
    finally:
        asyncio.run_coroutine_threadsafe(server.stop(), loop).result(60)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


@pytest.fixture(scope="module")
def server():
    with serving() as found:
        yield found


@pytest.fixture(scope="module")
def chrome():
    options = ChromeOptions()
    for option in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--hide-scrollbars",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--force-prefers-reduced-motion",  # without a graphics card, an animation takes a processor from the solver
    ):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    yield browser
    browser.quit()


class Page:
    """The page, as its user sees it."""

    def __init__(self, chrome, address):
        self.chrome = chrome
        chrome.set_window_size(1280, 800)
        chrome.get(address)

    def run(self, script):
        return self.chrome.execute_script(script)

    def until(self, condition, seconds=LONGEST):
        """Waits for a condition in JavaScript, and returns its value."""
        end = monotonic() + seconds
        while not (found := self.run(f"return {condition}")):
            assert monotonic() < end, f"not in time: {condition}; {self.run('return document.body.innerText')}"
            sleep(0.05)
        return found

    def settled(self):
        """Waits until all is solved that was asked for."""
        self.until("document.body.dataset.solver === 'idle' && live.store.linear && live.store.curves[0]")

    def misses(self):
        return [
            abs(float(item.get_attribute("data-miss")))
            for item in self.chrome.find_elements(By.CSS_SELECTOR, "#targets li")
        ]

    def wanted(self):
        return self.run("return live.store.project.targets.map(t => t.displacement)")

    def picture(self, name):
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.chrome.save_screenshot(str(PICTURES / f"{name}.png"))

    def drag(self, element, across, down, *, steps=30, during=lambda: None):
        """Moves an element with the pointer."""
        ActionChains(self.chrome, duration=0).move_to_element(element).click_and_hold().perform()
        places = [(round(across * k / steps), round(down * k / steps)) for k in range(steps + 1)]  # whole pixels
        for (x, y), (after_x, after_y) in pairwise(places):
            ActionChains(self.chrome, duration=10).move_by_offset(after_x - x, after_y - y).perform()
        during()
        ActionChains(self.chrome).release().perform()


@pytest.fixture
def page(chrome, server):
    found = Page(chrome, server.address)
    found.settled()
    yield found
    errors = [entry for entry in chrome.get_log("browser") if entry["level"] == "SEVERE"]
    assert not errors, errors


def target(page, number):
    return page.chrome.find_elements(By.CSS_SELECTOR, "#chart .target")[number]


def test_a_target_that_is_dragged_is_previewed_and_then_met(page):
    page.picture("finished-example")
    assert max(page.misses()) < 0.01
    across = page.run("return live.chart.px([7.2, 0])[0] - live.chart.px([9, 0])[0]")
    previewed = []

    def during():
        page.picture("dragging")
        previewed.append(page.run("return document.querySelectorAll('#chart .preview, #view .preview').length"))
        previewed.append(page.run("return live.chart.frames"))

    before = page.run("return live.store.curves[0].points.map(p => p.displacement)")
    page.drag(target(page, 1), across, 0, during=during)
    assert previewed[0] == 2 and previewed[1] >= 10
    assert page.wanted()[1] == pytest.approx(7.2, rel=0.02)
    page.until("live.store.curves[0].points.at(-1).displacement < 1.1 * live.store.project.targets[1].displacement")
    page.settled()
    page.until("[...document.querySelectorAll('#targets li')].every((item) => Math.abs(item.dataset.miss) < 0.01)")
    page.picture("after-drag")
    after = page.run("return live.store.curves[0].points.map(p => p.displacement)")
    assert after[-1] == pytest.approx(page.wanted()[1], rel=0.01)
    page.chrome.find_element(By.TAG_NAME, "body").send_keys(Keys.CONTROL, "z")
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()
    assert page.run("return live.store.curves[0].points.map(p => p.displacement)") == pytest.approx(before, rel=1e-3)


def choose(page, mode):
    page.chrome.find_element(By.ID, f"mode-{mode}").click()


def test_a_control_point_that_is_dragged_bends_the_link_and_its_curve(page):
    choose(page, "shape")
    page.until("document.querySelectorAll('.handle.control').length")
    page.picture("shape")
    before, scale = page.run("window.first = live.store.linear; return [first.design.offsets, live.view.scale]")
    previewed = []

    def during():
        page.until(
            "document.querySelectorAll('#chart .preview').length && document.querySelectorAll('#view .preview').length",
            20,
        )
        page.picture("bending")
        shape = "live.store.linear.curves[0].values.length && live.store.previewed.filter(s => s).length"
        previewed.append(page.run(f"return {shape}"))
        page.until("live.store.linear !== first")  # it is solved where the hand rests

    page.drag(page.chrome.find_elements(By.CSS_SELECTOR, ".handle.control")[0], 12, 8, steps=4, during=during)
    page.until("!document.querySelector('.handle.held') && document.body.dataset.solver === 'idle'")
    assert previewed == [2]
    change = np.subtract(page.run("return live.store.project.design.offsets"), before)
    assert sorted(change[abs(change) > 1e-3]) == pytest.approx([-8 / scale, 12 / scale], rel=0.01)
    page.chrome.find_element(By.ID, "undo").click()
    page.until("!document.querySelector('#redo').disabled")
    page.settled()
    choose(page, "move")


def test_a_joint_that_is_dragged_changes_the_mechanism_and_its_design_follows(page):
    choose(page, "shape")
    page.until("document.querySelectorAll('.handle.joint').length === 4")
    page.drag(page.chrome.find_elements(By.CSS_SELECTOR, ".handle.joint")[2], -30, -20, steps=10)
    page.until("live.store.project.joints[2].at[0] < -1")
    page.until("document.body.dataset.solver === 'idle'")
    page.settled()
    page.picture("joint-dragged")
    assert page.run("return live.store.project.joints[2].at[1]") > 61.0
    assert max(page.misses()) < 0.01
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.joints[2].at[0] === 0")
    page.settled()
    choose(page, "move")


def change(page, *path, value):
    """Sets a value of the project, and waits for what it leads to."""
    edit = {"kind": "edit", "changes": [{"kind": "set", "path": path, "value": value}], "settled": True}
    page.run(f"live.send({json.dumps(edit)})")
    page.until("document.body.dataset.solver === 'idle'")
    page.settled()


PREVIEWED = """
    const own = live.store.base().curves[0], s = live.store.previewed;
    const row = own.jacobian.at(-1);
    return own.values.at(-1) + row.reduce((sum, slope, k) => sum + slope * s[k], 0);
"""
END = "return live.store.curves[0].points.at(-1).displacement"


def test_the_preview_of_a_joint_that_is_dragged_leads_where_the_solve_does(page):
    change(page, "fit", value=False)
    choose(page, "shape")
    page.until("document.querySelectorAll('.handle.joint').length === 4")
    page.run("window.first = live.store.linear")
    before, found = page.run(END), []

    def during():
        found.append(page.run(PREVIEWED))
        found.append(page.run("return document.querySelectorAll('#chart .preview, #view .preview').length"))
        found.append(page.run("return [...document.querySelectorAll('#view .preview')].at(-1).getAttribute('d')"))
        page.picture("joint-preview")

    page.drag(page.chrome.find_elements(By.CSS_SELECTOR, ".handle.joint")[3], 4, 0, steps=4, during=during)
    page.until("live.store.project.joints[3].at[0] > 40 && document.body.dataset.solver === 'idle'")
    page.settled()
    after = page.run(END)
    assert found[1] >= 2 and abs(after - before) > 0.05
    to = page.run("return live.store.project.joints[3].at")
    tip = next(own for own in found[2].split("M") if own.endswith("Z"))  # a rigid link with a joint, and a force
    corners = [[float(part) for part in own.split()] for own in tip.rstrip("Z").split("L")]
    assert len(corners) == 3 and min(np.linalg.norm(np.subtract(corners, to), axis=1)) < 0.02
    assert found[0] - before == pytest.approx(after - before, rel=0.2)
    line = page.run("return live.store.project.links[4].shape.line")
    assert line[2] == page.run("return live.store.project.joints[5].at") and 18.0 < line[1][0] < line[2][0] - 22.0
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.joints[3].at[0] === 40 && live.store.project.fit")
    page.settled()
    choose(page, "move")


def test_the_preview_of_a_force_that_is_turned_leads_where_the_solve_does(page):
    change(page, "fit", value=False)
    choose(page, "shape")
    page.until("document.querySelectorAll('.handle.direction').length")
    before, found = page.run(END), []

    def during():
        page.until("document.querySelectorAll('#chart .preview').length", 20)
        found.append(page.run(PREVIEWED))
        found.append(page.run("return document.querySelectorAll('#view .preview').length"))
        page.picture("direction-preview")

    page.drag(page.chrome.find_element(By.CSS_SELECTOR, ".handle.direction"), 0, -3, steps=3, during=during)
    page.until("live.store.project.forces[0].direction[1] > 0.05 && document.body.dataset.solver === 'idle'")
    page.settled()
    after = page.run(END)
    assert abs(after - before) > 0.05 and found[0] - before == pytest.approx(after - before, rel=0.4)
    assert found[1] == 0  # no link at rest changes its shape
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.forces[0].direction[1] === 0 && live.store.project.fit")
    page.settled()
    choose(page, "move")


def test_the_surroundings_of_a_joint_on_a_polygon_go_with_it_and_those_of_others_stay(page):
    corners, joints = [[0, -2], [0, 2], [20, 3], [40, 2], [40, -2], [20, -3]], [[1, 0], [39, 0]]
    found = page.chrome.execute_script(
        "return import('./page/preview.js').then((own) => own.cornersAfter(...arguments))",
        corners,
        joints,
        [[0, 0], [4, 6]],
    )
    moved = np.subtract(found, corners)
    assert moved[[2, 5]] == pytest.approx(np.array([[2.0, 3.0]] * 2), abs=0.25)
    assert moved[[3, 4]] == pytest.approx(np.array([[4.0, 6.0]] * 2), abs=0.05)
    assert moved[[0, 1]] == pytest.approx(0.0, abs=0.05)


BOXES = """
    const parts = [...document.querySelectorAll("section, svg, button, input, footer")];
    return parts.map((own) => own.getBoundingClientRect()).map(({ x, y, width, height }) => [x, y, width, height]);
"""


@pytest.mark.parametrize("width", [1400, 420])
def test_nothing_moves_when_something_is_told_or_while_it_is_solved(page, width):
    size = {"width": width, "height": 860, "deviceScaleFactor": 1, "mobile": width < 500}
    page.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        sleep(0.5)
        before, told = (
            page.run(BOXES),
            "Held back by the thickness of the diagonal. Widen these bounds, or relax a target.",
        )
        for k in range(4):
            page.run(f"live.store.tell('{k}: {told}', {str(k == 0).lower()})")
        page.picture(f"told-{width}")
        assert page.run(BOXES) == before
        page.run("delete live.store.errors[0]; delete live.store.peaks[0]; live.store.listTargets()")
        assert page.run(BOXES) == before
        curve = "const own = live.store.curves[0]; delete live.store.curves[0]; live.store.listTargets();"
        assert (
            page.run(f"{curve} const boxes = (() => {{ {BOXES} }})(); live.store.curves[0] = own; return boxes")
            == before
        )
    finally:
        page.run("live.store.tell(null)")
        page.chrome.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_the_preview_of_a_push_at_a_point_leads_where_the_solve_does(page):
    page.run("live.store.load = 0.5; live.store.show()")
    view = page.chrome.find_element(By.ID, "view")
    x, y = page.run("""
        const { view, store } = live, tip = store.drawnMesh().rigid.findIndex((own) => own.name === "tip");
        const [a, b] = view.now.rigid[tip], { width, height } = view.svg.getBoundingClientRect();
        const [across, up] = [0, 1].map((k) => view.scale * (a[k] + b[k]) / 2);
        return [view.origin[0] + across - width / 2, view.origin[1] - up - height / 2];
    """)
    hand = ActionChains(page.chrome, duration=0).move_to_element_with_offset(view, round(x), round(y))
    hand.click_and_hold().perform()
    page.until("live.handles.pushed.from && live.handles.pushed.asked === null", 20)
    assert page.run("return live.handles.pushed.held.at.link") == "tip"
    page.run("window.first = live.handles.pushed.from; live.store.leans = 0")
    for _ in range(8):
        ActionChains(page.chrome, duration=10).move_by_offset(0, 1).perform()
    ActionChains(page.chrome).pause(0.3).perform()
    page.until("live.handles.pushed.asked === null && live.handles.pushed.from !== first", 20)
    assert page.run("return live.store.leans") >= 4
    assert page.run("return document.querySelectorAll('#view .preview').length") == 1
    page.picture("pushed-at-a-point")
    first, now, by = page.run("return [first, live.handles.pushed.from, live.handles.pushed.by]")
    assert now["by"] == pytest.approx(by, rel=1e-3, abs=1e-6) and by[1] < -0.003
    before, wanted = (np.concatenate(own["state"]["nodes"]) for own in (first, now))
    rates = [np.concatenate(own["nodes"]) for own in first["rates"]]
    missed = before + by[0] * rates[0] + by[1] * rates[1] - wanted
    assert np.abs(missed).max() < 0.1 * np.abs(wanted - before).max()
    ActionChains(page.chrome).release().perform()
    page.until("!live.store.pushed && !live.store.leaning")


def test_the_mechanism_moves_while_it_is_played(page):
    play = page.chrome.find_element(By.ID, "play")
    assert play.get_attribute("aria-pressed") == "false"  # for somebody who prefers reduced motion
    play.click()
    page.until("live.store.load > 0.1", 20)
    play.click()
    after = "return new Promise((go) => setTimeout(() => go(live.store.load), 200))"
    assert page.run("return live.store.load") == page.run(after)


def test_a_push_beyond_the_curve_is_solved(page):
    view = page.chrome.find_element(By.ID, "view")
    corner = [round(-0.47 * view.rect[side]) for side in ("width", "height")]
    hand = ActionChains(page.chrome, duration=0).move_to_element_with_offset(view, *corner)
    hand.click_and_hold().perform()
    for _ in range(15):
        ActionChains(page.chrome, duration=10).move_by_offset(14, 0).perform()
    page.until("live.store.leaning && live.store.pushed && live.store.pushed.force > 0.41")
    page.picture("pushed")
    assert page.run("return live.store.pushed.displacement") > page.run(
        "return live.store.curves[0].points.at(-1).displacement"
    )
    ActionChains(page.chrome).release().perform()
    page.until("!live.store.pushed")


def test_the_solid_is_seen_at_once_and_solved_in_space_beside_the_plane(page):
    choose(page, "solid")
    page.until("live.solid.drawn > 1000", 20)
    before = page.run("return live.solid.yaw")
    page.drag(page.chrome.find_element(By.CSS_SELECTOR, "#solid canvas"), 60, 0, steps=6)
    assert page.run("return live.solid.yaw") > before + 0.4
    page.chrome.find_element(By.CSS_SELECTOR, "#solid canvas").send_keys(Keys.ARROW_LEFT, Keys.HOME, "+")
    assert page.run("return [live.solid.yaw, live.solid.zoom]") == [before, 1.25]
    page.run("document.body.dataset.solid = ''")
    page.chrome.find_element(By.ID, "solve-solid").click()
    page.until("document.body.dataset.solid === 'solving' && !document.querySelector('#progress').hidden", 60)
    page.chrome.find_element(By.ID, "solve-solid").click()  # now it stops
    page.until("document.body.dataset.solid === 'cancelled'", 60)
    page.chrome.find_element(By.ID, "solve-solid").click()
    page.until("document.body.dataset.solid === 'solved'")
    page.picture("solid")
    ends = page.run("return [live.store.solid, live.store.curves[0]].map(own => own.points.at(-1).displacement)")
    assert ends[0] == pytest.approx(ends[1], rel=0.05)
    assert page.run("return document.querySelectorAll('#chart .solid-curve').length") == 1
    assert "plane" in page.chrome.find_element(By.ID, "solid-state").text
    choose(page, "move")


def test_a_target_is_dragged_by_touch(page):
    page.run("document.body.dataset.solver = ''")
    box = target(page, 1).rect
    x, y = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
    across = round(page.run("return live.chart.px([8.5, 0])[0] - live.chart.px([9, 0])[0]"))
    finger = ActionBuilder(page.chrome, mouse=PointerInput(interaction.POINTER_TOUCH, "finger"), duration=10)
    finger.pointer_action.move_to_location(x, y).pointer_down()
    for k in range(1, 11):
        finger.pointer_action.move_to_location(round(x + across * k / 10), y)
    finger.pointer_action.pointer_up()
    finger.perform()
    page.until("live.store.project.targets[1].displacement < 8.7")
    assert page.wanted()[1] == pytest.approx(8.5, rel=0.02)
    page.until("document.body.dataset.solver === 'idle'")
    page.chrome.find_element(By.ID, "undo").click()
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()


def test_keys_move_add_and_remove_targets_joints_and_pushes(page):
    body = page.chrome.find_element(By.TAG_NAME, "body")
    page.run("document.querySelectorAll('#chart .target')[1].focus()")
    page.chrome.switch_to.active_element.send_keys(Keys.ARROW_LEFT)
    page.until("live.store.project.targets[1].displacement < 9 && !document.querySelector('#undo').disabled")
    page.run("document.querySelectorAll('#chart .target')[0].focus()")
    page.chrome.switch_to.active_element.send_keys(Keys.DELETE)
    page.until("live.store.project.targets.length === 1")
    for _ in range(2):
        body.send_keys(Keys.CONTROL, "z")
    page.until("live.store.project.targets.length === 2 && live.store.project.targets[1].displacement === 9")
    body.send_keys(Keys.CONTROL, "y")
    page.until("live.store.project.targets[1].displacement < 9")
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()
    page.run("document.getElementById('view').focus()")
    page.chrome.switch_to.active_element.send_keys(Keys.ARROW_RIGHT * 3)
    page.until("live.store.pushing && live.handles.pushed.force > 0.05")
    page.chrome.switch_to.active_element.send_keys(Keys.ESCAPE)
    page.until("!live.store.pushing")
    choose(page, "shape")
    page.run("document.querySelectorAll('.handle.force')[0].focus()")
    ActionChains(page.chrome).send_keys(Keys.ARROW_UP).perform()  # to what has the focus, drawn anew or not
    page.until("live.store.project.forces[0].at[1] > 70")
    page.until("document.activeElement.matches('.handle.force')", 20)  # keys go on with it
    labelled = (
        "return [...document.querySelectorAll('[tabindex=\"0\"]')].every((own) => own.getAttribute('aria-label'))"
    )
    assert page.run(labelled)
    page.chrome.find_element(By.ID, "undo").click()
    page.until("live.store.project.forces[0].at[1] === 70")
    page.settled()
    choose(page, "move")


def test_keys_add_up_while_they_are_solved_and_escape_takes_a_drag_back(page):
    choose(page, "shape")
    page.until("document.querySelectorAll('.handle.control').length")
    # what each key moves by: the scale follows the curves, which are solved between keys
    page.run("""
        window.steps = [];
        window.note = () => steps.push(5 / live.view.scale);
        addEventListener("keydown", note, true);
    """)
    before = page.run("return live.store.project.design.offsets")
    page.run("document.querySelectorAll('.handle.control')[0].focus()")
    page.run("""
        const key = { key: "ArrowUp", bubbles: true, cancelable: true };
        const press = () => document.activeElement.dispatchEvent(new KeyboardEvent("keydown", key));
        for (let k = 0; k < 8; k++) setTimeout(press, 8 * k); // some before the answer to the last, some after
    """)
    page.until("steps.length === 8 && document.body.dataset.solver === 'idle'")
    change = np.subtract(page.run("return live.store.project.design.offsets"), before)
    steps = page.run("return steps.splice(0)")
    assert change[abs(change) > 1e-3] == pytest.approx([sum(steps)], rel=0.01)
    before = page.run("return live.store.project.design.offsets")
    page.run("document.querySelectorAll('.handle.slope')[0].focus()")
    ActionChains(page.chrome).send_keys(Keys.ARROW_UP).perform()  # to what has the focus, drawn anew or not
    page.until("document.body.dataset.solver === 'idle'")
    page.picture("slopes")
    change = np.subtract(page.run("return live.store.project.design.offsets"), before)
    (step,) = page.run("removeEventListener('keydown', note, true); return steps")
    assert change[abs(change) > 1e-3] == pytest.approx([3 * step], rel=0.01)  # of the tangent, at a third of it
    page.chrome.find_element(By.ID, "reset").click()
    page.settled()
    choose(page, "move")

    def during():
        page.until("live.chart.held?.sent && live.store.project.targets[1].displacement < 8.9", 20)  # it is solved
        ActionChains(page.chrome).send_keys(Keys.ESCAPE).perform()
        page.until("live.store.project.targets[1].displacement === 9", 20)

    page.drag(target(page, 1), -30, 0, steps=5, during=during)
    page.settled()
    assert page.wanted()[1] == 9 and not page.chrome.find_elements(By.CSS_SELECTOR, ".held")


def test_a_curve_of_a_new_force_is_added_dragged_and_removed(page):
    page.chrome.find_element(By.ID, "add-curve").click()
    page.until(
        "live.store.project.curves.length === 2 && live.store.curves[1] && live.store.curves[1].iterate === null"
    )
    page.until("document.querySelectorAll('.handle.direction').length")
    before = page.run("return live.store.project.forces[1].direction")
    page.drag(page.chrome.find_element(By.CSS_SELECTOR, ".handle.direction"), 0, 40, steps=8)
    page.until(f"live.store.project.forces[1].direction[1] < {before[1] - 0.3}")
    page.settled()
    page.until("live.store.curves[1] && live.store.curves[1].iterate === null")
    page.picture("second-curve")
    page.chrome.find_element(By.ID, "add").click()
    page.until("live.store.project.targets.length === 3 && live.store.project.targets[2].curve === 1")
    page.chrome.find_element(By.ID, "remove-curve").click()
    page.until("live.store.project.curves.length === 1 && live.store.project.forces.length === 1")
    assert len(page.wanted()) == 2
    page.chrome.find_element(By.ID, "reset").click()
    page.settled()
    choose(page, "move")


def field(page, name):
    """The last field of that name beside the pictures."""
    rows = [own for own in page.chrome.find_elements(By.CSS_SELECTOR, "#side label") if own.text.split("\n")[0] == name]
    return rows[-1].find_element(By.CSS_SELECTOR, "input, select")


def enter(page, name, value):
    """Gives a number to a field."""
    found = field(page, name)
    found.clear()
    found.send_keys(str(value), Keys.ENTER)


def pick(page, name, text):
    """Chooses from a list."""
    Select(field(page, name)).select_by_visible_text(text)


def test_materials_springs_model_and_constant_forces_are_changed_beside_the_pictures(page):
    before = page.run("return live.store.curves[0].points[1].displacement")
    change(page, "fit", value=False)
    pick(page, "material", "numbers of its own…")
    page.until("live.store.project.links[4].material.E === 1.9", 20)
    page.until("document.querySelector('#side').innerText.includes('E [MPa]')", 20)
    enter(page, "E [MPa]", 2.5)
    page.until("live.store.project.links[4].material.E === 2.5", 20)
    page.settled()
    assert page.run("return live.store.curves[0].points[1].displacement") < 0.95 * before
    enter(page, "ν", 0.6)
    page.until("document.getElementById('told').innerText.includes('nu: not between')", 20)
    assert page.run("return live.store.project.links[4].material.nu") == 0.475
    enter(page, "stiffness [N mm]", 50)
    page.until("live.store.project.effects.some((own) => own.stiffness === 50)", 20)
    pick(page, "model", "plane strain")
    page.until("live.store.project.simulation.space === 'plane-strain'", 20)
    page.chrome.find_element(By.ID, "add-force").click()
    page.until("live.store.project.curves[0].others['force 2'] === 0.04", 20)
    page.settled()
    page.picture("constant-force")
    enter(page, "constant [N]", 0)
    page.until("!('force 2' in live.store.project.curves[0].others)", 20)
    page.until("document.querySelector('#side').innerText.includes('Remove force 2')", 20)  # the fields are made anew
    page.settled()
    field(page, "changes shape").click()
    page.until("live.store.project.links[4].design === null && document.body.dataset.solver === 'idle'")
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.fit && live.store.project.forces.length === 1")
    page.settled()


def test_a_curve_takes_another_force_and_its_own_is_removed_with_it(page):
    page.chrome.find_element(By.ID, "add-curve").click()
    page.until("live.store.project.curves.length === 2 && live.store.shown === 1", 20)
    pick(page, "force", "push on tip")
    page.until("live.store.project.curves[1].force === 'push on tip' && live.store.project.forces.length === 1", 20)
    page.settled()
    page.until("live.store.curves[1] && live.store.curves[1].iterate === null")
    ends = page.run("return [0, 1].map((k) => live.store.curves[k].points.at(-1).displacement)")
    assert ends[1] == pytest.approx(ends[0], rel=1e-4)
    page.chrome.find_element(By.ID, "reset").click()
    page.settled()
    choose(page, "move")


def test_the_button_for_curves_rests_at_the_last_that_the_page_adds(page):
    add = page.chrome.find_element(By.ID, "add-curve")
    for count in (2, 3, 4):
        add.click()
        page.until(f"live.store.project.curves.length === {count} && live.store.shown === {count - 1}", 20)
    assert not add.is_enabled()
    page.chrome.find_element(By.ID, "reset").click()
    page.until("live.store.project.curves.length === 1 && live.store.shown === 0", 20)
    assert add.is_enabled()
    page.until("document.body.dataset.solver === 'idle'")
    choose(page, "move")


def open_project(page, project):
    """Opens another project."""
    page.chrome.execute_script("live.send({kind: 'open', project: arguments[0]})", project)


def test_a_problem_of_a_script_is_shown_with_what_it_requires(page):
    switch = import_module("demos.switch")
    described = switch.describe()
    sim = fm.Simulation(described[0], space="plane-stress", size=4.0, order=1)
    wanted = switch.wanted(*described)
    (link,) = described[0].mechanism.flexible_links
    wanted["targets"].append(fm.Target(fm.LinkVolume(link), at_most=2000.0))
    project = project_of(fm.DesignProblem(sim, **wanted)) | {"fit": False}
    open_project(page, project)
    page.until("live.store.project.name === 'switch' && live.store.required.length === 1")
    listed = [item.text for item in page.chrome.find_elements(By.CSS_SELECTOR, "#carried li")]
    assert len(listed) == 2 and "reached" in listed[0] and "spring" in listed[1]
    assert page.run("return live.store.curves[0].points.at(-1).displacement") == pytest.approx(15.0)
    page.until("document.body.dataset.solver === 'idle' && live.store.linear")
    page.picture("script")
    previewed = []

    def during():
        previewed.append(page.run("return document.querySelectorAll('#chart .preview').length"))
        page.picture("held-target")

    across, up = page.run(
        "return [[0, 0], [2, 0.2]].map((at) => live.chart.px(at)).reduce((a, b) => [b[0] - a[0], b[1] - a[1]])"
    )
    page.drag(target(page, 0), across, up, steps=5, during=during)  # of a force at a displacement that is held
    page.until("live.store.project.targets[0].displacement > 5")
    assert page.run("return live.store.project.targets[0]") == pytest.approx(
        {"curve": 0, "displacement": 5.4, "force": 1.2, "weight": 10.0}, rel=0.05
    )
    assert previewed == [1]
    open_project(page, FINGER)
    page.until("live.store.project.name === 'truss finger' && !document.querySelector('#carried li')")
    page.settled()


@pytest.fixture
def motor_page(page):
    """The page with a motor's project, solved; the next test finds the finger again."""
    open_project(page, MOTOR)
    page.until("live.store.project.motors.length && document.querySelector('#side input[type=range]')")
    page.settled()
    yield page
    open_project(page, FINGER)
    page.until("live.store.project.name === 'truss finger'")
    page.settled()


def test_the_slider_of_a_motor_is_the_same_while_it_is_dragged(motor_page):
    page, seen = motor_page, []
    slider = page.chrome.find_element(By.CSS_SELECTOR, "#side input[type=range]")
    # the panel is longer than the window and scrolls
    page.chrome.execute_script("arguments[0].scrollIntoView({block: 'center'})", slider)

    def during():
        page.until("Object.values(live.store.project.curves[live.store.shown].positions).some(at => at)")
        page.until(
            "document.querySelectorAll('#chart .preview').length && document.querySelectorAll('#view .preview').length"
        )
        page.picture("motor-preview")
        seen.append(page.run("return document.activeElement.matches('#side input[type=range]')"))

    page.drag(slider, 20, 0, steps=8, during=during)
    assert seen == [True]
    page.until("!document.activeElement.matches('#side input')")
    page.settled()
    before = page.run("return live.store.curve().points.at(-1).displacement")
    number = next(own for own in page.chrome.find_elements(By.CSS_SELECTOR, "#side label") if "[rad]" in own.text)
    field = number.find_element(By.TAG_NAME, "input")
    field.clear()
    field.send_keys("0.3", Keys.ENTER)
    page.until("Object.values(live.store.project.curves[live.store.shown].positions).includes(0.3)")
    page.settled()
    assert page.run("return live.store.curve().points.at(-1).displacement") != before


def test_a_curve_of_the_same_force_is_added_with_the_motor_elsewhere(motor_page):
    page = motor_page
    count = page.run("return live.store.project.curves.length")
    page.chrome.find_element(By.ID, "add-position").click()
    page.until(f"live.store.project.curves.length === {count + 1} && live.store.shown === {count}", 20)
    page.until(f"live.store.curves[{count}] && live.store.curves[{count}].iterate === null")
    first, added = page.run("return [live.store.project.curves[0], live.store.project.curves.at(-1)]")
    assert first["force"] == added["force"] and page.run("return live.store.project.forces.length") == 1
    (motor,) = added["positions"]
    assert added["positions"][motor] == pytest.approx(first["positions"].get(motor, 0.0) + 0.2)
    page.settled()
    page.picture("position")


def test_the_finger_becomes_a_fifth_stiffer_by_one_button(page):
    page.chrome.find_element(By.ID, "stiffer").click()
    page.until("live.store.project.targets[1].displacement === 7.5")
    page.settled()
    page.until("document.getElementById('stiffness-now').textContent.includes('20 % stiffer')")
    page.picture("stiffer")
    assert max(page.misses()) < 0.01
    page.chrome.find_element(By.ID, "undo").click()
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()


def test_files_are_downloads_of_the_page(page):
    fetch = "return fetch(arguments[0]).then(found => found.text())"
    assert "fm.Mechanism('truss finger')" in page.chrome.execute_script(fetch, "export/script")
    assert page.chrome.execute_script(fetch, "export/step").startswith("ISO-10303-21")


def test_the_exported_script_computes_the_curve_of_the_page(page, tmp_path):
    page.chrome.find_element(By.ID, "stiffer").click()
    page.until("live.store.project.targets[1].displacement === 7.5")
    page.settled()
    fetch = "return fetch('export/script').then(found => found.text())"
    (tmp_path / "finger.py").write_text(page.chrome.execute_script(fetch))
    shown = page.run("return live.store.curves[0].points.map(point => point.displacement)")
    page.chrome.find_element(By.ID, "undo").click()
    done = subprocess.run(
        [sys.executable, "finger.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=True,
    )
    printed = next(line for line in done.stdout.splitlines() if len(line.split()) == len(shown))
    assert [float(word) for word in printed.split()] == pytest.approx(shown, rel=1e-4)
    assert (tmp_path / "links" / "diagonal.step").exists()
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()


def test_a_solver_that_is_killed_in_a_fit_loses_nothing(page, server):
    page.chrome.find_element(By.ID, "softer").click()
    page.until("live.store.busy")
    os.kill(server.solver_pid, signal.SIGKILL)
    page.until("live.store.project.targets[1].displacement !== 9")
    page.settled()
    assert max(page.misses()) < 0.01
    page.chrome.find_element(By.ID, "undo").click()
    page.until("live.store.project.targets[1].displacement === 9")
    page.settled()


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("shape", "width"), [("wide", 1440), ("middle", 1000), ("narrow", 390)])
def test_nothing_is_cut_off(page, theme, shape, width):
    scheme = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    page.chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", scheme)
    size = {"width": width, "height": 860, "deviceScaleFactor": 1, "mobile": width < 500}
    page.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        sleep(0.5)
        assert page.run("return document.documentElement.scrollWidth") <= width
        if width < 500:
            height = page.run("return document.documentElement.scrollHeight")
            page.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size | {"height": height})
            sleep(0.5)
        page.picture(f"{theme}-{shape}")
    finally:
        page.chrome.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        page.chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
