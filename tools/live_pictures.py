"""The pictures of the live page in its documentation: python3 tools/live_pictures.py (chromium and selenium)."""

import asyncio
from pathlib import Path

from PIL import Image
from selenium.webdriver import ActionChains, Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from fenicsmech.live import Server, example

FOLDER = Path(__file__).parents[1] / "docs" / "static"
MIDDLE_OF_LINK = """
    const { view } = live, nodes = view.now.nodes[0], { width, height } = view.svg.getBoundingClientRect();
    const [low, high] = [Math.min, Math.max].map((pick) => pick(...nodes.map((node) => node[1])));
    const apart = (node) => Math.abs(node[1] - 0.5 * (low + high));
    const [x, y] = nodes.reduce((best, node) => apart(node) < apart(best) ? node : best);
    return [view.origin[0] + view.scale * x - width / 2, view.origin[1] - view.scale * y - height / 2].map(Math.round);
"""
SOLVED = "return document.body.dataset.solver === 'idle' && live.store.linear && live.store.curves[0]"


def show(address: str) -> None:
    """Drags a target, pushes, and solves in 3D."""
    options = ChromeOptions()
    for option in (
        "--headless=new",
        "--no-sandbox",
        "--hide-scrollbars",
        "--disable-dev-shm-usage",
        "--use-angle=swiftshader",
    ):
        options.add_argument(option)
    page = Chrome(service=Service("/usr/bin/chromedriver"), options=options)

    def until(condition: str) -> None:
        WebDriverWait(page, 60).until(lambda driver: driver.execute_script(condition), condition)

    try:
        page.set_window_size(1280, 800)
        page.get(address)
        until(SOLVED)
        target = page.find_elements(By.CSS_SELECTOR, "#chart .target")[1]
        ActionChains(page, duration=0).move_to_element(target).click_and_hold().perform()
        for _ in range(7):
            ActionChains(page, duration=20).move_by_offset(-10, 0).perform()
        until("return document.querySelectorAll('#view .preview, #chart .preview').length === 2")
        page.save_screenshot(str(FOLDER / "live.png"))
        ActionChains(page).release().perform()
        page.find_element(By.ID, "reset").click()
        until("return live.store.project.targets[1].displacement === 9")
        until(SOLVED)
        page.find_element(By.ID, "play").click()
        page.execute_script("const load = document.getElementById('load'); load.value = 0.5; load.oninput()")
        across, down = page.execute_script(MIDDLE_OF_LINK)
        hand = ActionChains(page, duration=0).move_to_element_with_offset(
            page.find_element(By.ID, "view"), across, down
        )
        hand.click_and_hold().perform()
        until("return live.handles.pushed.from && live.handles.pushed.asked === null")
        page.execute_script("live.handles.answered = () => {}")  # before the solve returns
        ActionChains(page, duration=20).move_by_offset(-18, -24).perform()
        page.save_screenshot(str(FOLDER / "live-push.png"))
        ActionChains(page).release().perform()
        until(SOLVED)
        page.find_element(By.ID, "mode-solid").click()
        page.find_element(By.ID, "solve-solid").click()
        until("return document.body.dataset.solid === 'solved'")
        page.execute_script("const load = document.getElementById('load'); load.value = 1; load.oninput()")
        dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
        until("return matchMedia('(prefers-color-scheme: dark)').matches")
        page.save_screenshot(str(FOLDER / "live-solid.png"))
    finally:
        page.quit()
    for path in FOLDER.glob("live*.png"):  # few colours
        with Image.open(path) as picture:
            few = picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
            few.save(path, optimize=True)


async def main() -> None:
    """Serves the finger while its page is shown."""
    server = Server(example("truss-finger"))
    await server.start()
    try:
        await asyncio.to_thread(show, server.address)
    finally:
        await server.stop()


if __name__ == "__main__":
    asyncio.run(main())
