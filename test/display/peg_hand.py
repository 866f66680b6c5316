"""The peg in its bore on the page: where it is, what is drawn, and a hand that drags it."""

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
    """The peg's position in mm, where the picture has it: the fields show what is typed at once."""
    return [100.0 * x for x in page.evaluate(POSITION, "/parts/0")]  # the page's unit is 0.1 m


def turned(page):
    """Its turn in degrees."""
    return [float(field(page, "Turn [deg]", i).input_value()) for i in range(3)]


# The corners of the lines of a node, three numbers each.
CORNERS = """name => {
  const bytes = window.__viserSceneTree.getState()[name].message.props.points;
  const at = bytes.byteOffset ?? 0;
  return [...new Float32Array(bytes.buffer.slice(at, at + bytes.byteLength))];
}"""


IS_SHOWN = "name => window.__viserSceneTree.getState()[name]?.effectiveVisibility ?? false"


def gap_on_screen(page):
    """Where the closest points of the one pair are on the screen, (2, 2) in pixels."""
    ends = np.array(page.evaluate(CORNERS, "/distances/points")).reshape(-1, 2, 3)[:, 0]
    assert len(ends) == 2
    page.evaluate(DRAWN)
    return np.array([page.evaluate(ON_SCREEN, ["/distances/points", end.tolist()]) for end in ends])


BAND = """name => {
  const node = window.__viserSceneTree.getState()[name];
  return node ? node.message.props.vertices.byteLength / 36 : 0;
}"""


# How many pixels are between two clearances in the plot, and whether the plot shows a third.
IN_PLOT = """([first, second, third]) => {
  const {chart} = Object.values(window.__viserTestpoints.uplots)[0];
  const at = value => chart.valToPos(value, 'y');
  return [at(second) - at(first), at(third), chart.over.clientHeight];
}"""


# Whether the middle of an element is what a press there would meet.
UNCOVERED = """each => {
  each.scrollIntoView({block: 'nearest'});  // within the panel's own half
  const r = each.getBoundingClientRect();
  const met = document.elementFromPoint(r.left + r.width / 2, r.top + r.height / 2);
  return each.contains(met) || met.contains(each);
}"""


def dragged(page, axis, pixels):
    """Drag the arrow of an axis by so many pixels along itself."""
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
    """Choose of a list."""
    field(page, label).click()
    page.locator("[role=option]:visible").get_by_text(option, exact=True).click()
    page.evaluate(SENT)


def at_place(page, place):
    return held(page) == pytest.approx(place, abs=1e-6)


# Where nodes' origins are at one moment, in units of the page.
PLACES = """names => names.map(name => {
  const node = window.__viserMutable.nodeRefFromName[name];
  node.updateWorldMatrix(true, false);
  return node.matrixWorld.elements.slice(12, 15);
})"""


def place(page):
    """Where the peg is drawn, in units of the page; its fields may be told later."""
    return np.array(page.evaluate(PLACES, ["/parts/0"])[0])


def apart(page):
    """How far its handles are from the peg, in the same units."""
    return np.subtract(*page.evaluate(PLACES, ["/gizmo", "/parts/0"]))


def end_drag(page, wait, before):
    """End a drag; then the peg, which follows by steps, is `apart` from its handles as before."""
    page.mouse.up()
    page.evaluate(SENT)
    wait(lambda: apart(page) == pytest.approx(before, abs=1e-6), "the peg at its handles")


WIDTH = "image => image.complete && image.naturalWidth"


def newest_stop(page):
    """What is listed of the newest event at which the peg came too near; empty: there is none."""
    stops = page.locator("#pm-events .pm-row", has_text="→ ■ STOP")
    return stops.first.inner_text() if stops.count() else ""


def look_back_at_stop(page, wait, before=""):
    """Press the newest of these events, once it is another than that before."""
    tab(page, "Session")
    wait(lambda: newest_stop(page) not in ("", before), "the event in the list")
    stop = page.locator("#pm-events .pm-row", has_text="→ ■ STOP").first
    stop.dispatch_event("pointerdown")


def picture_of_event(page, wait):
    """The pixels of the picture of the event that is looked at."""
    picture = page.locator("#pm-event img")
    wait(lambda: picture.count() and picture.evaluate(WIDTH) > 200, "the picture")
    return decoded(base64.b64decode(picture.get_attribute("src").partition(",")[2]))


def back_to_live(page, wait):
    """Look at the present again, and at all pairs."""
    button(page, "Back to live").click()
    wait(lambda: page.get_attribute("#pm-connection", "data-state") == "live", "the present")
    tab(page, "Clearances")
    press(page, CHOSEN)


def put_there(page, wait, *place):
    """Type a position of the peg in mm, and wait until the page shows it there, upright."""
    choose(page, "peg")
    for i in range(3):
        enter(page, "Turn [deg]", "0", i)
    for i, number in enumerate(place):
        enter(page, "Position [mm]", f"{number}", i)
    button(page, "Put it there").click()
    wait(lambda: at_place(page, place), f"the peg at {place}")


def let_go(page):
    """Leave the peg to its own source."""
    choose(page, "peg")
    release = button(page, "Let go: its own source moves it")
    if release.is_enabled():
        release.click()
