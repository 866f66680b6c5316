"""Decisions about conflicts on the page: a monitor, a display that is started again, a browser."""

from __future__ import annotations

import base64
import json
import re
import signal

import numpy as np
import pytest
from page_hand import (
    CANVAS,
    CHOSEN,
    DRAWN,
    ON_SCREEN,
    OPACITY,
    SENT,
    button,
    choose,
    decoded,
    enter,
    field,
    lines_of,
    listed,
    opened,
    press,
    row,
    saved,
    select,
    tab,
)

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")
pytestmark = pytest.mark.long

PAIR = "table - ball"
# Whether an element's middle is on the screen, without scrolling, and nothing covers it.
SEEN = """each => {
  const r = each.getBoundingClientRect();
  return each.contains(document.elementFromPoint(r.left + r.width / 2, r.top + r.height / 2));
}"""
# How wide the panel's content is with a text beside the pill, and how wide the panel is.
WIDTHS = """text => {
  const line = document.querySelector('#pm-connection .pm-cut');
  line.textContent = text;
  const panel = line.closest('.mantine-ScrollArea-viewport');
  return [panel.scrollWidth, panel.clientWidth];
}"""
# The camera's position, and the point it looks at.
EYE = """() => {
  const {camera, cameraControl} = window.__viserMutable;
  return [camera.position.toArray(), cameraControl.getTarget(camera.position.clone()).toArray()];
}"""
GIZMO = "() => window.__viserSceneTree.getState()['/gizmo'].effectiveVisibility"


@pytest.fixture
def page(shared_page):
    yield shared_page
    assert shared_page.errors == []


def highlighted(page):
    tab(page, "Clearances")
    if not page.locator(CHOSEN).count():
        press(page, f'[data-pair="{PAIR}"]')


@pytest.fixture
def near(page, sources, wait):
    """The ball was clear, then below `stop` above the table, and is clear again."""
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.2), "the ball to be seen")
    sources.move("ball", (-0.2, 0.0, 0.11))
    wait(lambda: "STOP" in row(page, PAIR)[2], "the ball to be near")
    wait(lambda: row(page, PAIR)[1] == pytest.approx(0.01), "the clearance")
    sources.restore()
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.2), "the ball to be away")


def test_the_buttons_for_the_gap_are_seen_at_once_and_the_margin_is_told(page, wait):
    """The window has 1000 by 640 pixels. Folders that are open do not push the buttons away."""
    highlighted(page)
    wait(lambda: "margin to warn: at least 100.000 mm" in row(page, PAIR)[2], "the margin")
    page.get_by_text("Status of the pair", exact=True).dispatch_event("click")
    number = page.locator("#pm-decided .pm-num")
    wait(lambda: number.inner_text() == "200.000 mm", "the clearance to decide about")
    wait(lambda: number.evaluate(SEEN), "it to be seen")
    page.get_by_text("Filter and group", exact=True).focus()
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Group by")
    for name in ("Section through it", "Zoom to the gap", "Whole scene"):
        assert button(page, name).evaluate(SEEN), name
    page.evaluate("() => document.activeElement.blur()")  # keys are not for a field
    for _ in range(len(listed(page)) - 1):  # the list is below the folders, and partly out of view
        before = page.locator(CHOSEN).get_attribute("data-pair")
        page.keyboard.press("n")
        wait(lambda b=before: page.locator(CHOSEN).get_attribute("data-pair") != b, "a key's pair")
        wait(lambda: page.locator(CHOSEN).evaluate(SEEN), "the pair's row to be in view")
    for folder in ("Status of the pair", "Filter and group"):
        page.get_by_text(folder, exact=True).dispatch_event("click")
    press(page, CHOSEN)


def test_a_long_reason_is_cut_and_makes_the_panel_no_wider(page):
    told, panel = page.evaluate(WIDTHS, "no recent pose: " + "one of many, " * 20)
    assert told <= panel


def decide(page, wait, status, comment):
    """Give the highlighted pair a status; return the line about it."""
    if not field(page, "Comment").is_visible():
        page.get_by_text("Status of the pair", exact=True).click()
    note = page.locator("#pm-decided")
    wait(lambda: PAIR in note.inner_text(), "the pair in the panel")
    select(page, field(page, "Status"), status)
    enter(page, "Comment", comment)
    button(page, "Save the status").click()
    return note


def test_the_report_shows_each_conflict_at_its_smallest_clearance(page, near, browser, tmp_path):
    page.evaluate(DRAWN)
    file = saved(page, "Conflicts, illustrated (HTML)").path()
    text = file.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=.?(http|//|file)", text)
    target = tmp_path / "report.html"
    target.write_text(text, encoding="utf-8")
    told = browser.new_page()
    told.goto(target.as_uri())
    section = told.locator("section", has_text=PAIR)
    words = " ".join(section.inner_text().split())
    assert "■ STOP, lower bound 10.000 mm, upper bound 10.000 mm" in words
    assert "warn 100.000 mm, stop 20.000 mm" in words
    assert "● clear → ▲ warn" in words or "● clear → ■ STOP" in words
    for conflict in told.locator("section").all():  # searches cut on a busy machine add conflicts
        assert re.search("[▲△■□✖]", conflict.inner_text()), "it was always clear"
    image, close, *of_events = section.locator("img").all()
    assert image.evaluate("each => each.complete && each.naturalWidth") > 200
    assert len({each.get_attribute("src") for each in of_events}) >= 2  # one per change of state
    pixels, near = (
        decoded(base64.b64decode(each.get_attribute("src").partition(",")[2])).astype(int)
        for each in (image, close)
    )
    # The picture shows the smallest clearance, not now: stop's colour, and the ball not dim.
    assert (np.abs(pixels - (213, 94, 0)).max(axis=2) < 40).sum() > 20
    # The gap is 4 pixels high in it. The second picture shows the gap large, between hatched parts.
    rows = np.flatnonzero((np.abs(near - (213, 94, 0)).max(axis=2) < 40).any(axis=1))
    assert np.ptp(rows) > 0.3 * min(near.shape[:2])
    dark = near.max(axis=2) < 190
    assert dark[: rows.min() - 30].any() and dark[rows.max() + 30 :].any()
    assert not dark[rows.min() + 30 : round(rows.mean()), :50].any()
    red, green, blue = np.moveaxis(pixels, 2, 0)
    assert ((blue > green + 20) & (green > red + 20)).mean() > 0.01
    told.close()
    assert page.evaluate(OPACITY, 2) is None  # the die is no longer dim


def test_the_table_of_conflicts_has_bounds_moment_and_status(page, near):
    (line,) = [each for each in lines_of(saved(page, "Conflicts as CSV")) if each["b"] == "ball"]
    assert (line["a"], line["decided"], line["worst_state"]) == ("table", "new", "stop")
    assert float(line["min_lower [mm]"]) == pytest.approx(10.0)
    assert float(line["min_upper [mm]"]) == pytest.approx(10.0)
    assert float(line["z_b [mm]"]) == pytest.approx(10.0)
    assert line["state"] == "clear" and float(line["lower [mm]"]) == pytest.approx(200.0)


def test_parts_that_are_attached_move_together_until_they_are_detached(page, sources, wait):
    choose(page, "die")
    select(page, field(page, "Attached to"), "ball")
    note = page.locator("#pm-held")
    wait(lambda: "attached to ball" in note.inner_text(), "the die to be attached")
    assert not page.evaluate(GIZMO)
    tab(page, "Clearances")
    wait(lambda: np.isnan(row(page, "ball - die")[0]), "their pair to be watched no more")
    sources.move("ball", (-0.2, 0.0, 0.4))
    wait(lambda: row(page, "table - die")[0] == pytest.approx(0.325), "the die to go along")
    tab(page, "Move")
    select(page, field(page, "Attached to"), "(nothing)")
    wait(lambda: page.evaluate(GIZMO), "the die to be free")
    tab(page, "Clearances")
    wait(lambda: row(page, "table - die")[0] == pytest.approx(0.225), "its own source")
    sources.restore()
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.2), "the ball to be back")


def test_a_press_on_a_conflict_brings_back_the_camera_of_who_decided(page, near, wait):
    def look_back(what):
        then = "■ STOP" if what == "conflicts" else "→ ■ STOP"
        tab(page, "Session")
        press(page, f"#pm-{what} .pm-row:has-text('{then}'):has-text('{PAIR}')")
        wait(lambda: button(page, "Back to live").is_enabled(), "the past")

    def whole():
        tab(page, "Session")
        if button(page, "Back to live").is_enabled():
            button(page, "Back to live").click()
            wait(lambda: not button(page, "Back to live").is_enabled(), "the present")
        tab(page, "Clearances")
        eye = np.array(page.evaluate(EYE))
        button(page, "Whole scene").click()
        wait(lambda: np.abs(page.evaluate(EYE) - eye).max() > 0.1, "the whole scene")
        page.evaluate(SENT)
        return np.array(page.evaluate(EYE))

    canvas = page.evaluate(CANVAS)
    middle = canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2
    gap = ["/parts/0", [-0.2, 0.0, 0.025 + 0.005]]
    # Nobody has decided: the camera goes to the gap, which was between 0 and 10 mm above the table.
    for what in ("conflicts", "events"):
        look_back(what)
        wait(lambda: page.evaluate(ON_SCREEN, gap) == pytest.approx(middle, abs=3.0), "the gap")
        before = whole()
    highlighted(page)
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 100, middle[1] + 40, steps=5)
    page.mouse.up()
    wait(lambda: np.abs(page.evaluate(EYE) - before).max() > 0.1, "the camera to turn")
    page.evaluate(DRAWN)
    page.evaluate(SENT)
    mine = np.array(page.evaluate(EYE))
    decide(page, wait, "ignored", "seen from here")
    wait(lambda: "ignored" in row(page, PAIR)[2], "the decision in the list")
    whole()
    look_back("conflicts")
    wait(lambda: np.abs(page.evaluate(EYE) - mine).max() < 1e-3, "the camera of who decided")
    whole()
    look_back("events")
    wait(lambda: np.abs(page.evaluate(EYE) - mine).max() > 0.1, "the gap at the event")
    whole()


def test_a_decision_is_in_the_file_and_on_the_page_of_the_next_display(
    page, display, start_display, scene_file, wait, eventually, browser
):
    highlighted(page)
    note = decide(page, wait, "accepted", "hält Abstand 间隙")
    told = "accepted at 200.000 mm: hält Abstand 间隙"
    wait(lambda: told in note.inner_text(), "the decision in the panel")
    wait(lambda: told in row(page, PAIR)[2], "the decision in the list")
    wait(lambda: "kept in" in page.inner_text("#pm-kept"), "that it is written")

    def kept():
        """Check the file. A display that is busy writes it some time after the page tells."""
        text = (scene_file.parent / "cell.conflicts.json").read_text(encoding="utf-8")
        (entry,) = json.loads(text)["conflicts"]
        assert (entry["a"], entry["b"], entry["status"]) == ("table", "ball", "accepted")
        assert entry["upper_m"] == pytest.approx(0.2)

    eventually(kept)
    display[0].stop(signal.SIGKILL)
    _, address = start_display(0)
    next_page = opened(browser, address)
    wait(lambda: told in row(next_page, PAIR)[2], "the decision on the next display's page")
    next_page.close()
