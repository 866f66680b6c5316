"""Measure how long a user waits for the page, by the browser's own clock.

    python benchmark/browser.py drag --steps 200     # in an environment with '.[ros,display]'
    python benchmark/browser.py crowd --seconds 30   # and playwright, with Chromium

`drag` holds one of 20 parts of 20,480 triangles by its handles and moves the mouse in steps. For
each of the browser's pointer events it takes the time until the panel shows the new clearance, and
until the next frame is drawn. The nearest part rests and the 18 others move meanwhile, so that only
the drag changes the clearance. `crowd` has 1,000 moving bodies and 10,476 pairs in range. It takes
the times between successive lists of pairs, and between successive frames.

Monitor, player, display and Chromium share the machine's cores. Without a graphics card, Chromium
draws in software, which takes most of their time; `--small` makes its window smaller. With
`--undrawn` nothing is drawn: the result is about what a user with a graphics card waits for.
"""

from __future__ import annotations

import argparse
import itertools
import os
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path

from display import SIDE, START_S, Child, crowd_text
from drag import HELD, NAMES, PAIR, drag_text, percentiles
from playwright.sync_api import Page, sync_playwright

# Chromium chooses how to draw, in software if need be. Run by root, it cannot be sandboxed.
FLAGS = ("--enable-unsafe-swiftshader", "--no-sandbox")
PATIENCE_S = 60.0
"""Seconds for the page to finish an action."""

# Hides the library's notifications (such as that it draws in software): they would cover the panel.
NO_NOTES = """addEventListener('DOMContentLoaded', () => {
  const style = document.createElement('style');
  style.textContent = '.mantine-Notification-root { display: none !important }';
  document.head.append(style);
})"""
# Makes WebGL accept all data but draw nothing.
UNDRAWN = """for (const name of [
  'drawArrays', 'drawArraysInstanced', 'drawElements', 'drawElementsInstanced', 'drawRangeElements',
]) WebGL2RenderingContext.prototype[name] = () => {};"""
# Returns the screen positions of two points on the x handle; see test/display/page_hand.py.
HANDLE = """() => {
  const m = window.__viserMutable, node = m.nodeRefFromName['/gizmo'];
  let length = null;
  node.traverse(each => { if (length === null && each.scale.x !== 1) length = each.scale.x; });
  node.updateWorldMatrix(true, false);
  m.camera.updateMatrixWorld();
  const r = m.canvas.getBoundingClientRect();
  return [0.75, 0.85].map(share => {
    const p = node.position.clone().set(share * length, 0, 0)
      .applyMatrix4(node.matrixWorld).project(m.camera);
    return [r.left + (p.x + 1) * r.width / 2, r.top + (1 - p.y) * r.height / 2];
  });
}"""
# After each pointer event, takes the times (ms) to the pair's new number and to the frame after it.
# `innerText` would make the browser lay out the page at each change, so `textContent` is read.
WATCH_DRAG = """pair => {
  window.took = [];
  let begun = null, before = null;
  const number = () => {
    const lines = [...document.querySelectorAll('#pm-near .pm-line')];
    const line = lines.find(each => each.textContent.includes(pair));
    return line && line.querySelector('.pm-num').textContent;
  };
  addEventListener('pointermove', event => {
    before = number();
    begun = event.timeStamp;
  }, true);
  new MutationObserver(() => {
    if (begun === null) return;
    const now = number();
    if (!now || now === before) return;
    const told = performance.now() - begun, from = begun;
    begun = null;
    requestAnimationFrame(() => requestAnimationFrame(
      () => window.took.push([told, performance.now() - from])));
  }).observe(document.body, {subtree: true, childList: true, characterData: true});
}"""
# Takes the times (ms) at which the page replaces its list of pairs, and at which it draws a frame.
WATCH_LIST = """() => {
  window.lists = [];
  window.frames = [];
  let before = null;
  new MutationObserver(() => {
    const now = document.querySelector('#pm-pairs');
    if (now && now !== before) { before = now; window.lists.push(performance.now()); }
  }).observe(document.body, {subtree: true, childList: true});
  const frame = () => { window.frames.push(performance.now()); requestAnimationFrame(frame); };
  frame();
}"""


def measure_drag(page: Page, chosen: argparse.Namespace) -> None:
    """Drag the part in steps, and print the times."""
    page.get_by_role("tab", name="Move").click()
    page.get_by_role("combobox", name="Part").fill(HELD)
    page.get_by_role("option", name=HELD, exact=True).click()
    page.wait_for_function(
        "() => window.__viserSceneTree.getState()['/gizmo'].effectiveVisibility"
        " && window.__viserMutable.nodeRefFromName['/gizmo']"
    )
    page.wait_for_function(
        f"() => document.querySelector('#pm-near')?.innerText.includes('{PAIR}')"
    )
    time.sleep(1.0)
    begin, along = page.evaluate(HANDLE)
    x, y = begin
    dx, dy = along[0] - x, along[1] - y
    step = [3.0 * each / max(abs(dx), abs(dy)) for each in (dx, dy)]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 5.0 * step[0], y + 5.0 * step[1], steps=5)
    time.sleep(2.0)
    page.evaluate(WATCH_DRAG, PAIR)
    rng, lost = random.Random(2), 0
    for i in range(chosen.steps):
        at = 6.0 - i % 2
        page.mouse.move(x + at * step[0], y + at * step[1])
        # A random pause, so that steps do not coincide with the monitor's ticks. Polling more often
        # would take processor time from the browser.
        time.sleep(rng.uniform(0.3, 0.4))
        ends = time.monotonic() + 5.0
        while len(page.evaluate("() => window.took")) <= i - lost and time.monotonic() < ends:
            time.sleep(0.3)
        lost += time.monotonic() >= ends
    page.mouse.up()
    took = page.evaluate("() => window.took")
    triangles = 20 * 4**chosen.subdivisions
    print(f"{chosen.parts} parts of {triangles:,} triangles, {len(took)} steps, {lost} lost")
    for i, name in enumerate(("to its number", "to the frame after")):
        times = [each[i] for each in took]
        print(f"  {name:20} median, 90 %, 99 % [ms]{percentiles(times)}")


def measure_list(page: Page, chosen: argparse.Namespace) -> None:
    """Watch the list of pairs, and print the times."""
    time.sleep(5.0)
    page.evaluate(WATCH_LIST)
    time.sleep(chosen.seconds)
    lists, frames = page.evaluate("() => [window.lists, window.frames]")
    banner = page.inner_text("#pm-banner").replace("\n", " ")
    print(f"{SIDE**3} bodies, {chosen.seconds:.0f} s, ticks asked for {chosen.rate:g} a second")
    print(f"  the banner                      {banner}")
    for name, stamps in (("lists", lists), ("frames", frames)):
        gaps = [b - a for a, b in itertools.pairwise(stamps)]
        print(f"  {name:20} a second  {1e3 * len(gaps) / sum(gaps):10.1f}")
        told = f"{percentiles(gaps)}, at most {max(gaps):.0f}"
        print(f"  {'':8} between two: median, 90 %, 99 % [ms]{told}")


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("drag", "crowd"))
    parser.add_argument("--steps", type=int, default=200, help="steps of the drag (default: 200)")
    parser.add_argument(
        "--seconds", type=float, default=30.0, help="how long to watch the list (default: 30)"
    )
    parser.add_argument(
        "--parts", type=int, default=20, help="number of parts to drag among (default: 20)"
    )
    parser.add_argument(
        "--subdivisions", type=int, default=5, help="each part has 20 * 4^N triangles (default: 5)"
    )
    parser.add_argument(
        "--rate", type=float, default=0.0, help="ticks per second (drag: 30, crowd: 10)"
    )
    parser.add_argument(
        "--undrawn", action="store_true", help="skip the drawing, as if it took no time"
    )
    parser.add_argument("--small", action="store_true", help="a window of 800 x 400 pixels")
    chosen = parser.parse_args()
    chosen.rate = chosen.rate or {"drag": 30.0, "crowd": 10.0}[chosen.what]
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    size = {"width": 800, "height": 400} if chosen.small else {"width": 1000, "height": 640}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        scene = Path(folder) / "scene.yaml"
        crowd = chosen.what == "crowd"
        dragged = (chosen.parts, chosen.rate, chosen.subdivisions)
        scene.write_text(crowd_text(chosen.rate) if crowd else drag_text(*dragged))
        given = ["-p", f"scene:={scene}"]
        bulk = ["-p", "bulk:=true"] if crowd else []
        children = [
            Child("proximity_monitor.ros.node", given, None),
            Child("proximity_monitor.ros.player", [*given, *bulk], None),
            Child("proximity_monitor.display.run", ["-p", "port:=0"], None),
        ]
        path = shutil.which("chromium") or shutil.which("chromium-browser")
        try:
            address = children[-1].wait_for("display: ")
            browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
            page = browser.new_page(viewport=size)
            page.set_default_timeout(1e3 * START_S)
            page.add_init_script(NO_NOTES)
            if chosen.undrawn:
                page.add_init_script(UNDRAWN)
            page.goto(address)
            page.wait_for_selector("#pm-pairs .pm-row")
            page.set_default_timeout(1e3 * PATIENCE_S)
            used = [child.seconds() for child in children]
            began = time.monotonic()
            (measure_list if crowd else measure_drag)(page, chosen)
            took = time.monotonic() - began
            for name, child, before in zip(NAMES, children, used, strict=True):
                share = 100.0 * (child.seconds() - before) / took
                print(f"  processor time, {name:16}{share:8.1f} % of a core")
            browser.close()
        finally:
            for child in children:
                child.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
