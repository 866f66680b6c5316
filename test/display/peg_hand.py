"""Helpers for the peg in its bore on the page: they read its pose and the picture, and drag it."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from page_hand import (
    CHOSEN,
    DRAWN,
    LENGTH,
    ON_SCREEN,
    SENT,
    button,
    choose,
    decoded,
    enter,
    field,
    press,
    tab,
)

PAIR = "peg - block"

POSITION = "name => window.__viserMutable.nodeRefFromName[name].position.toArray()"


def held(page):
    """Return the peg's position (mm) in the picture: the fields show typed numbers at once."""
    return [100.0 * x for x in page.evaluate(POSITION, "/parts/0")]  # the page's unit is 0.1 m


def turned(page):
    """Return the peg's turn in degrees."""
    return [float(field(page, "Turn [deg]", i).input_value()) for i in range(3)]


# The end points of a node's lines, three numbers each.
CORNERS = """name => {
  const bytes = window.__viserSceneTree.getState()[name].message.props.points;
  const at = bytes.byteOffset ?? 0;
  return [...new Float32Array(bytes.buffer.slice(at, at + bytes.byteLength))];
}"""


IS_SHOWN = "name => window.__viserSceneTree.getState()[name]?.effectiveVisibility ?? false"


def gap_on_screen(page):
    """Return where the closest points of the only pair are on the screen, (2, 2) in pixels."""
    ends = np.array(page.evaluate(CORNERS, "/distances/points")).reshape(-1, 2, 3)[:, 0]
    assert len(ends) == 2
    page.evaluate(DRAWN)
    return np.array([page.evaluate(ON_SCREEN, ["/distances/points", end.tolist()]) for end in ends])


BAND = """name => {
  const node = window.__viserSceneTree.getState()[name];
  return node ? node.message.props.vertices.byteLength / 36 : 0;
}"""


# The pixels between two clearances in the plot, the place of a third, and the plot's height.
IN_PLOT = """([first, second, third]) => {
  const {chart} = Object.values(window.__viserTestpoints.uplots)[0];
  const at = value => chart.valToPos(value, 'y');
  return [at(second) - at(first), at(third), chart.over.clientHeight];
}"""


# Whether a press on the middle of an element reaches it, because nothing covers it there.
UNCOVERED = """each => {
  each.scrollIntoView({block: 'nearest'});  // within the panel's own half
  const r = each.getBoundingClientRect();
  const met = document.elementFromPoint(r.left + r.width / 2, r.top + r.height / 2);
  return each.contains(met) || met.contains(each);
}"""


def dragged(page, axis, pixels):
    """Drag the arrow of an axis along itself by some pixels, and keep the button pressed."""
    handle = 0.75 * page.evaluate(LENGTH) * np.eye(3)[axis]
    page.evaluate(DRAWN)
    begin = np.array(page.evaluate(ON_SCREEN, ["/gizmo", handle.tolist()]))
    along = np.array(page.evaluate(ON_SCREEN, ["/gizmo", (1.1 * handle).tolist()])) - begin
    end = begin + pixels * along / np.linalg.norm(along)
    page.mouse.move(*begin)
    page.evaluate(DRAWN)
    page.mouse.down()
    page.mouse.move(*end, steps=8)


def pick(page, label, option):
    """Choose an option of a list."""
    field(page, label).click()
    page.locator("[role=option]:visible").get_by_text(option, exact=True).click()
    page.evaluate(SENT)


def at_place(page, place):
    return held(page) == pytest.approx(place, abs=1e-6)


# The positions of nodes' origins at one moment, in the page's units.
PLACES = """names => names.map(name => {
  const node = window.__viserMutable.nodeRefFromName[name];
  node.updateWorldMatrix(true, false);
  return node.matrixWorld.elements.slice(12, 15);
})"""


def place(page):
    """Return where the peg is drawn, in the page's units; its fields may be updated later."""
    return np.array(page.evaluate(PLACES, ["/parts/0"])[0])


def apart(page):
    """Return the vector from the peg to its handles, in the page's units."""
    return np.subtract(*page.evaluate(PLACES, ["/gizmo", "/parts/0"]))


def end_drag(page, wait, before):
    """End a drag, and wait until the peg, which follows in steps, is at its handles as before."""
    page.mouse.up()
    page.evaluate(SENT)
    wait(lambda: apart(page) == pytest.approx(before, abs=1e-6), "the peg at its handles")


WIDTH = "image => image.complete && image.naturalWidth"


def newest_stop(page):
    """Return the row of the newest event in which the clearance fell below stop; empty: none."""
    stops = page.locator("#pm-events .pm-row", has_text="→ ■ STOP")
    return stops.first.inner_text() if stops.count() else ""


def look_back_at_stop(page, wait, before=""):
    """Press the row of the newest stop event, once it differs from the row `before`."""
    tab(page, "Session")
    wait(lambda: newest_stop(page) not in ("", before), "the event in the list")
    stop = page.locator("#pm-events .pm-row", has_text="→ ■ STOP").first
    stop.dispatch_event("pointerdown")


def picture_of_event(page, wait):
    """Return the pixels of the picture of the event that is looked at."""
    picture = page.locator("#pm-event img")
    wait(lambda: picture.count() and picture.evaluate(WIDTH) > 200, "the picture")
    return decoded(base64.b64decode(picture.get_attribute("src").partition(",")[2]))


def back_to_live(page, wait):
    """Return to the present, and end the highlighting of a pair."""
    button(page, "Back to live").click()
    wait(lambda: page.get_attribute("#pm-connection", "data-state") == "live", "the present")
    tab(page, "Clearances")
    press(page, CHOSEN)


def put_there(page, wait, *place):
    """Type a position of the peg in mm, upright, and wait until the page shows the peg there."""
    choose(page, "peg")
    for i in range(3):
        enter(page, "Turn [deg]", "0", i)
    for i, number in enumerate(place):
        enter(page, "Position [mm]", f"{number}", i)
    button(page, "Put it there").click()
    wait(lambda: at_place(page, place), f"the peg at {place}")


def let_go(page):
    """Let the peg go, so that its own source moves it."""
    choose(page, "peg")
    release = button(page, "Let go: its own source moves it")
    if release.is_enabled():
        release.click()
