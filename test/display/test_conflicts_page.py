"""Decisions about conflicts on the page: a monitor, a display that is started again, a browser."""

from __future__ import annotations

import json
import signal

import pytest
from page_hand import CHOSEN, button, field, press, row, tab

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

PAIR = "table - ball"


@pytest.fixture
def page(shared_page):
    yield shared_page
    assert shared_page.errors == []


def highlighted(page):
    tab(page, "Clearances")
    if not page.locator(CHOSEN).count():
        press(page, f'[data-pair="{PAIR}"]')


def test_a_decision_is_in_the_file_and_on_the_page_of_the_next_display(
    page, display, start_display, scene_file, wait, browser
):
    highlighted(page)
    page.get_by_text("Status of the pair", exact=True).click()
    note = page.locator("#pm-decided")
    wait(lambda: PAIR in note.inner_text(), "the pair in the panel")
    field(page, "Status").click()
    page.locator("[role=option]:visible").get_by_text("accepted", exact=True).click()
    field(page, "Comment").fill("hält Abstand 间隙")
    button(page, "Keep the status").click()
    told = "accepted at 200.000 mm: hält Abstand 间隙"
    wait(lambda: told in note.inner_text(), "the decision in the panel")
    wait(lambda: told in row(page, PAIR)[2], "the decision in the list")
    kept = json.loads((scene_file.parent / "cell.conflicts.json").read_text(encoding="utf-8"))
    (entry,) = kept["conflicts"]
    assert (entry["a"], entry["b"], entry["status"]) == ("table", "ball", "accepted")
    assert entry["upper_m"] == pytest.approx(0.2)
    display[0].stop(signal.SIGKILL)
    _, address = start_display(0)
    next_page = browser.new_page(viewport={"width": 1000, "height": 640})
    next_page.goto(address)
    wait(lambda: told in row(next_page, PAIR)[2], "the decision on the next display's page")
    next_page.close()
