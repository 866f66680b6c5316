"""Draw the pictures of the page in docs/images: make demo's page, in a browser without a window.

pip install '.[ros,display]' playwright    # and a Chromium, such as Debian's package
python tools/render_display.py
"""

from __future__ import annotations

import argparse
import random
import shutil
import signal
import subprocess
import sys
from os import environ
from pathlib import Path
from threading import Thread

from playwright.sync_api import Locator, Page, sync_playwright

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
SIZE = {"width": 1440, "height": 860}
SMALL = {"width": 1000, "height": 640}
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
REPORT_HIGH = 860.0
"""Pixels of a conflict's section to show: the pictures, the numbers, and the first change."""
PATIENCE_MS = 240_000
NEAR_S = 0.2
"""A time in the engine's motion, s, when two pistons are nearer to the crankshaft than `warn`."""
TRIES = 20
FRESH = "getComputedStyle(document.body).getPropertyValue('--pm-now') !== 'none'"
# Each tick restarts an animation of the style sheet; the page is stale when the animation ends.
AGES = "() => { window.aged = false; document.body.onanimationend = () => { window.aged = true } }"
# While `held` is set, nothing is drawn: the canvas keeps its last picture, and takes no time.
HOLDING = """for (const name of [
  'clear', 'drawArrays', 'drawArraysInstanced', 'drawElements', 'drawElementsInstanced',
  'drawRangeElements',
]) {
  const draw = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...given) {
    if (!window.held) draw.apply(this, given);
  };
}"""
ADDRESS_PREFIX = "Drag the parts and see their clearances at "


def main() -> int:
    """Draw all pictures; return 1 if there is no browser."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chromium", default=shutil.which("chromium"), help="path of Chromium")
    parser.add_argument("--folder", type=Path, default=IMAGES, help="output folder")
    parser.add_argument("--scene", help="only the pictures of this bundled scene")
    chosen = parser.parse_args()
    if chosen.chromium is None:
        print("Chromium is not on the PATH: give its path by --chromium", file=sys.stderr)
        return 1
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chosen.chromium, args=FLAGS)
        for scene, draw, speed, size in SCENES:
            if chosen.scene not in (None, scene):
                continue
            demo, address = start_demo(scene, speed)
            try:
                page = browser.new_page(viewport=size)
                page.set_default_timeout(PATIENCE_MS)
                page.add_init_script(HOLDING)
                page.goto(f"{address}/?smooth")
                page.wait_for_selector("#pm-pairs .pm-row")
                for close in page.locator(".mantine-Notification-closeButton").all():
                    close.click()
                draw(page, chosen.folder)
                page.close()
            finally:
                demo.send_signal(signal.SIGINT)
                demo.wait()
        browser.close()
    return 0


def start_demo(scene: str, speed: float) -> tuple[subprocess.Popen, str]:
    """Start the demo at a speed, on a domain of its own; return it and the page's address."""
    command = [sys.executable, "-m", "proximity_monitor", "demo", "--scene", scene]
    environment = environ | {
        "ROS_DOMAIN_ID": str(random.SystemRandom().randint(1, 100)),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    demo = subprocess.Popen(
        [*command, "--speed", str(speed)], stdout=subprocess.PIPE, text=True, env=environment
    )
    for line in demo.stdout:
        if line.startswith(ADDRESS_PREFIX):
            Thread(target=demo.stdout.read, daemon=True).start()  # a full pipe would stop the demo
            return demo, line.removeprefix(ADDRESS_PREFIX).strip()
    raise RuntimeError("the demo ended before it served a page")


def press(page: Page, pair: str) -> None:
    """Highlight a pair, or end its highlighting."""
    page.locator(f'[data-pair="{pair}"]').dispatch_event("pointerdown")


def tab(page: Page, name: str) -> None:
    """Show a tab of the panel."""
    page.get_by_role("tab", name=name).click()


def settle(page: Page, frames: int = 15) -> None:
    """Wait until some frames have been drawn."""
    page.evaluate(
        "n => new Promise(done => { const f = () => n-- ? requestAnimationFrame(f) : done();"
        " f() })",
        frames,
    )


def shoot(page: Page, path: Path) -> None:
    """Take a screenshot while the page is fresh, with the parts as they were drawn before.

    Drawing in software is so slow that the page would grow stale meanwhile. So drawing is held, and
    a screenshot during which the page has grown stale is taken again.
    """
    for _ in range(TRIES):
        page.evaluate("() => { window.held = true }")
        page.wait_for_function(f"() => {FRESH}")
        page.evaluate(AGES)
        page.screenshot(path=path)
        fresh = page.evaluate(f"() => {FRESH} && !window.aged")
        page.evaluate("() => { window.held = false }")
        if fresh:
            return
        settle(page, 2)
    raise RuntimeError(f"{path.name}: the page was stale in each of {TRIES} pictures")


def play(page: Page, on: bool) -> None:
    """Resume the motion, or pause it at NEAR_S, so that a picture's numbers are of one moment."""
    tab(page, "Session")
    button, then = ("Play", "Pause") if on else ("Pause", "Play")
    page.get_by_role("button", name=button, exact=True).click()
    page.get_by_role("button", name=then, exact=True).wait_for()
    if not on:
        moment = field(page, "Moment [s]", 1)  # the first is the slider
        moment.fill(str(NEAR_S))
        moment.press("Enter")
        settle(page)


def draw_engine(page: Page, folder: Path) -> None:
    """Draw all parts with clearances, one pair alone, what accuracy costs, and bands."""
    settle(page)
    play(page, False)
    tab(page, "Clearances")
    settle(page)
    shoot(page, folder / "display.png")
    press(page, "piston_2 - crankshaft")
    settle(page)
    shoot(page, folder / "display_pair.png")
    press(page, "piston_2 - crankshaft")
    play(page, True)
    tab(page, "Settings")
    slider = page.get_by_role("slider").and_(page.locator(":visible")).nth(4)
    page.wait_for_selector("#pm-cost >> text=as the scene says")
    for percent in (5, 10, 15):
        for _ in range(10):
            slider.press("ArrowRight")
        page.wait_for_selector(f"#pm-cost >> text={percent} % or ")
    play(page, False)
    tab(page, "Settings")
    settle(page)
    page.evaluate("() => document.querySelector('#pm-cost').scrollIntoView({block: 'end'})")
    shoot(page, folder / "display_cost.png")
    for _ in range(30):
        slider.press("ArrowLeft")
    tab(page, "Clearances")
    page.get_by_role("button", name="Whole scene").click()
    page.get_by_text("Picture", exact=True).click()
    page.locator('[data-pair="piston_2 - crankshaft"]').first.wait_for()
    press(page, "piston_2 - crankshaft")
    settle(page)
    whose = field(page, "Look of")
    whose.fill("crankshaft")
    options = page.locator(f"[id='{whose.get_attribute('aria-controls')}'] [role=option]")
    options.get_by_text("crankshaft", exact=True).dispatch_event("click")
    page.locator("input[type=checkbox]:visible").nth(2).click()
    page.wait_for_selector("#pm-bands")
    page.get_by_text("Clash matrix", exact=True).click()
    settle(page, 40)
    page.evaluate("() => document.querySelector('#pm-matrix').scrollIntoView({block: 'start'})")
    settle(page)
    shoot(page, folder / "display_bands.png")


def draw_probe(page: Page, folder: Path) -> None:
    """Draw the 3D cursor: a point with a line to every part near it."""
    settle(page)
    play(page, False)
    tab(page, "Move")
    settle(page, 25)
    shoot(page, folder / "display_cursor.png")


def draw_turbine(page: Page, folder: Path) -> None:
    """Draw parametric surfaces, and a pair with the patches of its points; nothing moves."""
    press(page, "blade_3 - shroud")
    page.wait_for_selector("text=blade_3: patch")
    settle(page, 30)
    shoot(page, folder / "display_turbine.png")


def field(page: Page, label: str, i: int = 0) -> Locator:
    """Return the input with a label, or the i-th of several in a row."""
    found = page.locator(f"xpath=//label[.='{label}']/ancestor::*[.//input][1]//input")
    return found.nth(i)


def put(page: Page, word: str, *place: float) -> None:
    """Type a position (mm) of the only movable part, and wait until the page shows the state."""
    tab(page, "Move")
    for i, number in enumerate(place):
        field(page, "Position [mm]", i).fill(f"{number}")
        page.wait_for_timeout(100)  # viser sends at most one value in 50 ms
    page.get_by_role("button", name="Put it there").click()
    page.wait_for_selector(f'#pm-banner[data-word="{word}"]')
    settle(page)


def draw_peg(page: Page, folder: Path) -> None:
    """Draw a gap of 0.02 mm in a section, an event looked back at, and a session's report."""
    put(page, "clear", 0.0, 0.0, -10.0)
    put(page, "STOP", 0.046, 0.0, -10.0)
    put(page, "warn", 0.03, 0.0, -10.0)
    tab(page, "Clearances")
    for name in ("Section through it", "Zoom to the gap"):
        page.get_by_role("button", name=name).click()
        page.mouse.move(5, 5)  # otherwise a hint would cover the panel
        settle(page)
    shoot(page, folder / "display_section.png")
    page.get_by_role("button", name="Whole scene").click()
    page.set_viewport_size(SIZE)
    put(page, "clear", 0.0, 0.0, 40.0)
    tab(page, "Session")
    page.locator("#pm-events .pm-row", has_text="→ ■").first.dispatch_event("pointerdown")
    page.wait_for_selector("#pm-event img")
    settle(page)
    page.evaluate("() => document.querySelector('#pm-events').scrollIntoView({block: 'start'})")
    settle(page)
    page.screenshot(path=folder / "display_event.png")  # a past event does not grow stale
    page.get_by_role("button", name="Back to live").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Conflicts, illustrated (HTML)").click()
    written = download.value.path().read_text(encoding="utf-8")
    page.goto("about:blank")  # stops its drawing, which would slow down the next picture
    report = page.context.browser.new_page(viewport=SMALL)
    report.set_content(written)
    begin = report.locator("section").first.bounding_box()
    clip = {**begin, "height": REPORT_HIGH}
    report.screenshot(path=folder / "display_report.png", full_page=True, clip=clip)
    report.close()


SCENES = (
    ("engine", draw_engine, 0.2, SIZE),
    ("probe", draw_probe, 0.2, SIZE),
    ("turbine", draw_turbine, 1e-9, SIZE),
    ("peg", draw_peg, 1e-9, SMALL),
)

if __name__ == "__main__":
    sys.exit(main())
