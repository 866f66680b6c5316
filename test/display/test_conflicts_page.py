"""Decisions about conflicts on the page: a monitor, a display that is started again, a browser."""

from __future__ import annotations

import base64
import json
import re
import signal

import numpy as np
import pytest
from page_hand import (
    CHOSEN,
    DRAWN,
    OPACITY,
    SAVE_MS,
    button,
    choose,
    decoded,
    enter,
    field,
    lines_of,
    opened,
    press,
    row,
    select,
    tab,
)

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")
pytestmark = pytest.mark.long

PAIR = "table - ball"
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


def saved(page, name):
    tab(page, "Session")
    with page.expect_download(timeout=SAVE_MS) as download:
        button(page, name).click()
    return download.value


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


def test_a_decision_is_in_the_file_and_on_the_page_of_the_next_display(
    page, display, start_display, scene_file, wait, browser
):
    highlighted(page)
    page.get_by_text("Status of the pair", exact=True).click()
    note = page.locator("#pm-decided")
    wait(lambda: PAIR in note.inner_text(), "the pair in the panel")
    select(page, field(page, "Status"), "accepted")
    enter(page, "Comment", "hält Abstand 间隙")
    button(page, "Save the status").click()
    told = "accepted at 200.000 mm: hält Abstand 间隙"
    wait(lambda: told in note.inner_text(), "the decision in the panel")
    wait(lambda: told in row(page, PAIR)[2], "the decision in the list")
    wait(lambda: "kept in" in note.inner_text(), "that it is written")
    kept = json.loads((scene_file.parent / "cell.conflicts.json").read_text(encoding="utf-8"))
    (entry,) = kept["conflicts"]
    assert (entry["a"], entry["b"], entry["status"]) == ("table", "ball", "accepted")
    assert entry["upper_m"] == pytest.approx(0.2)
    display[0].stop(signal.SIGKILL)
    _, address = start_display(0)
    next_page = opened(browser, address)
    wait(lambda: told in row(next_page, PAIR)[2], "the decision on the next display's page")
    next_page.close()
