"""What the tests do and read on the page in Chromium, as a user's hand and eye would."""

from __future__ import annotations

import csv
import io
import time

import imageio.v3 as iio
import numpy as np
from deadlines import DEADLINE_S, START_DEADLINE_S

SAVE_MS = 180_000.0
# Hides the library's notifications, such as that of software graphics: they cover the picture.
NO_NOTES = """addEventListener('DOMContentLoaded', () => {
  const style = document.createElement('style');
  style.textContent = '.mantine-Notification-root { display: none !important }';
  document.head.append(style);
})"""
# Draws about ten pictures a second. If a picture takes long, the next one waits for twice that time
# but for half a second at most. Without a graphics card a picture costs as much as all else that a
# test looks at, and nobody sees the skipped ones. The limit is needed because after a longer wait
# there is more to draw, which takes longer: on a busy machine each picture waited longer than the
# last.
SELDOM = """(() => {
  const frame = requestAnimationFrame.bind(window), waiting = new Map();
  let made = 0, took = 0, planned = false;
  const plan = () => {
    planned = true;
    setTimeout(frame, Math.min(Math.max(80, 2 * took), 500), picture);
  };
  // All that was asked for before a picture is in it, as without this.
  const picture = moment => {
    const begun = performance.now();
    for (const i of [...waiting.keys()]) {
      const draw = waiting.get(i);
      if (!waiting.delete(i)) continue;  // cancelled by one before it
      try { draw(moment); } catch (error) { reportError(error); }
    }
    setTimeout(() => {  // once the picture is there
      took = performance.now() - begun;
      planned = false;
      if (waiting.size) plan();
    });
  };
  window.requestAnimationFrame = draw => {
    waiting.set(++made, draw);
    if (!planned) plan();
    return made;
  };
  window.cancelAnimationFrame = i => { waiting.delete(i); };
})()"""
# Where a node's local point is on the screen, in CSS pixels.
ON_SCREEN = """([name, local]) => {
  const m = window.__viserMutable, node = m.nodeRefFromName[name];
  node.updateWorldMatrix(true, false);
  m.camera.updateMatrixWorld();
  const p = node.position.clone().set(...local).applyMatrix4(node.matrixWorld).project(m.camera);
  const r = m.canvas.getBoundingClientRect();
  return [r.left + (p.x + 1) * r.width / 2, r.top + (1 - p.y) * r.height / 2];
}"""
# The length of the gizmo's arrows, in the page's units.
LENGTH = """() => {
  let length = null;
  window.__viserMutable.nodeRefFromName['/gizmo'].traverse(each => {
    if (length === null && each.scale.x !== 1) length = each.scale.x;
  });
  return length;
}"""
# Whether the pointer is at one of the gizmo's handles.
LIT = """() => {
  let lit = false;
  window.__viserMutable.nodeRefFromName['/gizmo'].traverse(each => {
    lit ||= each.material?.color?.getHexString() === 'ffff40';
  });
  return lit;
}"""
CANVAS = "() => window.__viserMutable.canvas.getBoundingClientRect().toJSON()"
CAMERA = "() => window.__viserMutable.camera.position.toArray()"
# Resolves when everything that is known now is drawn.
DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
# Resolves when a value just put into an input is sent. The library sends one message in 50 ms; of
# the values that come meanwhile it sends only the last, whichever input that belongs to.
SENT = "() => new Promise(done => setTimeout(done, 100))"
# The texts of the labels that are shown under a node.
TEXTS = """under => Object.entries(window.__viserSceneTree.getState())
  .filter(([name, node]) => name.startsWith(under) && node.effectiveVisibility)
  .map(([, node]) => node.message.props.text).filter(text => text)"""
OPACITY = "i => window.__viserSceneTree.getState()[`/parts/${i}/mesh`].message.props.opacity"
# The largest distance of a corner of a part's mesh from the part's origin.
REACH = """i => {
  const props = window.__viserSceneTree.getState()[`/parts/${i}/mesh`].message.props;
  const bytes = props.vertices, at = bytes.byteOffset ?? 0;
  const all = new Float32Array(bytes.buffer.slice(at, at + bytes.byteLength));
  let reach = 0;
  for (let k = 0; k < all.length; k += 3)
    reach = Math.max(reach, Math.hypot(all[k], all[k + 1], all[k + 2]));
  return reach;
}"""
# Whether the first pair's row is seen without scrolling.
FIRST_IS_SEEN = """() => {
  const row = document.querySelector('#pm-pairs .pm-row');
  for (let each = row; each; each = each.parentElement) each.scrollTop = 0;
  const {left, top, height} = row.getBoundingClientRect();
  return row.contains(document.elementFromPoint(left + 20, top + height / 2));
}"""
# Keeps the characters that were drawn for labels.
GLYPHS_DRAWN = """(() => {
  const draw = CanvasRenderingContext2D.prototype.fillText;
  window.glyphs = new Set();
  CanvasRenderingContext2D.prototype.fillText = function (text, ...given) {
    window.glyphs.add(text);
    return draw.call(this, text, ...given);
  };
})()"""
ROWS = "all => all.map(r => [r.dataset.pair, [+r.dataset.lower, +r.dataset.upper, r.innerText]])"
# Only rows of the list of pairs: a press on a row of conflicts or events looks back instead.
CHOSEN = "#pm-pairs .pm-row.pm-chosen"
HIDDEN = "#pm-pairs ~ .pm-small .pm-press"


def address_of(display, wait):
    """Return the address that a display's process prints for its page."""

    def told():
        assert display.popen.poll() is None, display.text
        line = next((x for x in display.text.splitlines() if x.startswith("display: ")), None)
        return line and line.removeprefix("display: ")

    return wait(told, "the display's address", START_DEADLINE_S)


def opened(browser, address, width=1000, height=640):
    """Open a page at an address, and return it; its `errors` are those of its scripts."""
    page = browser.new_page(
        viewport={"width": width, "height": height}, accept_downloads=True, device_scale_factor=1
    )
    page.set_default_timeout(1e3 * DEADLINE_S)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.add_init_script(NO_NOTES)
    page.add_init_script(SELDOM)
    page.add_init_script(GLYPHS_DRAWN)
    page.goto(address, timeout=1e3 * START_DEADLINE_S)
    return page


def decoded(png):
    """Return the pixels (height, width, 3) of a PNG."""
    return np.asarray(iio.imread(png, extension=".png"))[..., :3]


def ball_is_blue(page, pixels):
    """Return whether a picture of the canvas shows the ball's colour in the ball's middle."""
    x, y = page.evaluate(ON_SCREEN, ["/parts/1", [0, 0, 0]])
    canvas = page.evaluate(CANVAS)
    assert pixels.shape[:2] == (canvas["height"], canvas["width"])
    red, green, blue = pixels[round(y - canvas["top"]), round(x - canvas["left"])].astype(int)
    return blue > green > red


def lines_of(file):
    return list(csv.DictReader(io.StringIO(file.path().read_text(encoding="utf-8"))))


def listed(page):
    """Return the bounds (m) and the text of each pair, in the order of the list."""
    return dict(page.eval_on_selector_all("#pm-pairs .pm-row", ROWS))


def row(page, pair):
    """Return the bounds (m) and the text of a pair, as the list shows them now."""
    return listed(page).get(pair, (np.nan, np.nan, "not listed"))


def word(page):
    return page.get_attribute("#pm-banner", "data-word")


def press(page, selector):
    """Press an element in the panel's HTML; the press is sent through an input as well."""
    page.locator(selector).first.dispatch_event("pointerdown")
    page.evaluate(SENT)


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def field(page, label, i=0):
    """Return the input with a label, or the i-th if the label has several in a row."""
    return page.locator(f"xpath=//label[.='{label}']/ancestor::*[.//input][1]//input").nth(i)


def enter(page, label, text, i=0):
    """Put a text into an input, and take as long as a hand takes to reach the next input."""
    field(page, label, i).fill(text)
    page.evaluate(SENT)


def select(page, found, option):
    """Choose an option of a searchable list, which may open beyond the panel's half of the window.

    The option itself is pressed, because keys that come before the list is drawn choose nothing.
    """
    found.fill(option)
    options = page.locator(f"[id='{found.get_attribute('aria-controls')}'] [role=option]")
    options.get_by_text(option, exact=True).dispatch_event("click")
    page.evaluate(SENT)


def button(page, name):
    return page.get_by_role("button", name=name)


def saved(page, name):
    """Press a button of the tab Session that saves a file, and return its download."""
    tab(page, "Session")
    with page.expect_download(timeout=SAVE_MS) as download:
        button(page, name).click()
    return download.value


def choose(page, part):
    tab(page, "Move")
    field(page, "Part").click()
    page.get_by_role("option", name=part).click()
    page.wait_for_function(
        "() => window.__viserSceneTree.getState()['/gizmo'].effectiveVisibility"
        " && window.__viserMutable.nodeRefFromName['/gizmo']"
    )


def drag(page, along, start=0.12):
    """Drag the gizmo by `along`, a vector in metres along one of its axes."""
    along = np.array(along, float)
    handle = start * np.abs(np.sign(along))
    deadline = time.monotonic() + DEADLINE_S
    page.evaluate(DRAWN)
    while True:
        page.mouse.move(*page.evaluate(ON_SCREEN, ["/gizmo", handle.tolist()]))
        page.evaluate(DRAWN)
        if page.evaluate(LIT):
            break
        assert time.monotonic() < deadline, "no handle of the gizmo lights up"
    to_x, to_y = page.evaluate(ON_SCREEN, ["/gizmo", (handle + along).tolist()])
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=6)
    page.mouse.up()
