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

from playwright.sync_api import Page, sync_playwright

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
SIZE = {"width": 1440, "height": 860}
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
PATIENCE_MS = 240_000
TRIES = 20
FRESH = "getComputedStyle(document.body).getPropertyValue('--pm-now') !== 'none'"
BESIDE = "Drag the parts and see their clearances at "


def main() -> int:
    """Draw all pictures; return 1 if there is no browser."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chromium", default=shutil.which("chromium"), help="the browser's path")
    parser.add_argument("--folder", type=Path, default=IMAGES, help="where the pictures go")
    chosen = parser.parse_args()
    if chosen.chromium is None:
        print("no Chromium on the PATH: name one by --chromium", file=sys.stderr)
        return 1
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chosen.chromium, args=FLAGS)
        for scene, draw, speed in (
            ("engine", draw_engine, 0.2),
            ("probe", draw_probe, 0.2),
            ("turbine", draw_turbine, 1e-9),
        ):
            demo, address = start_demo(scene, speed)
            try:
                page = browser.new_page(viewport=SIZE)
                page.set_default_timeout(PATIENCE_MS)
                page.goto(address)
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
        if line.startswith(BESIDE):
            Thread(target=demo.stdout.read, daemon=True).start()  # a full pipe would stop it
            return demo, line.removeprefix(BESIDE).strip()
    raise RuntimeError("the demo ended without a page")


def press(page: Page, pair: str) -> None:
    """Highlight a pair, or look at all again."""
    page.locator(f'[data-pair="{pair}"]').dispatch_event("pointerdown")


def tab(page: Page, name: str) -> None:
    """Show a tab of the panel."""
    page.get_by_role("tab", name=name).click()


def settle(page: Page, frames: int = 15) -> None:
    """Let some pictures be drawn."""
    page.evaluate(
        "n => new Promise(done => { const f = () => n-- ? requestAnimationFrame(f) : done();"
        " f() })",
        frames,
    )


def shoot(page: Page, path: Path) -> None:
    """Draw a picture while the news is fresh: software draws slowly, and meanwhile it grows old."""
    for _ in range(TRIES):
        page.wait_for_function(f"() => {FRESH}")
        page.screenshot(path=path)
        if page.evaluate(FRESH):
            return
    raise RuntimeError(f"{path.name}: the page was stale in each of {TRIES} pictures")


def draw_engine(page: Page, folder: Path) -> None:
    """All parts with their clearances, one pair alone, and what accuracy costs."""
    settle(page)
    shoot(page, folder / "display.png")
    press(page, "piston_2 - crankshaft")
    settle(page)
    shoot(page, folder / "display_pair.png")
    press(page, "piston_2 - crankshaft")
    tab(page, "Limits")
    slider = page.get_by_role("slider").and_(page.locator(":visible")).nth(4)
    page.wait_for_selector("#pm-cost >> text=as the scene says")
    for percent in (5, 10, 15):
        for _ in range(10):
            slider.press("ArrowRight")
        page.wait_for_selector(f"#pm-cost >> text={percent} %, ")
    settle(page)
    page.evaluate("() => document.querySelector('#pm-cost').scrollIntoView({block: 'end'})")
    shoot(page, folder / "display_cost.png")


def draw_probe(page: Page, folder: Path) -> None:
    """The 3D cursor: a point with a line to every part near it."""
    tab(page, "Move")
    settle(page, 25)
    shoot(page, folder / "display_cursor.png")


def draw_turbine(page: Page, folder: Path) -> None:
    """Parametric surfaces, and one pair with what its points lie on; nothing moves."""
    press(page, "blade_3 - shroud")
    page.wait_for_selector("text=blade_3: patch")
    settle(page, 30)
    shoot(page, folder / "display_turbine.png")


if __name__ == "__main__":
    sys.exit(main())
