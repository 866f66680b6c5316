"""What the page must never do: show unknown things as known, or let one browser harm another."""

from __future__ import annotations

import signal
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from urllib.parse import urlsplit

import numpy as np
import pytest
from page_hand import (
    CHOSEN,
    SENT,
    button,
    choose,
    decoded,
    drag,
    enter,
    field,
    listed,
    opened,
    press,
    row,
    select,
    tab,
    word,
)

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

GREEN = (0, 158, 115)
STATE = "() => document.querySelector('#pm-connection')?.dataset.state"


@pytest.fixture(scope="module")
def pages(open_page):
    """Two browsers that look at one display."""
    return open_page(), open_page()


@pytest.fixture
def two(pages, sources, wait):
    """Both browsers, live and with all pairs clear."""
    for page in pages:
        at_present(page, wait)
        wait(lambda page=page: word(page) == "clear", "all to be clear")
    yield pages
    sources.restore()
    for page in pages:
        assert page.errors == []


@pytest.fixture
def one(pages, wait):
    """The first browser, live, whatever the second does."""
    at_present(pages[0], wait)
    yield pages[0]
    assert pages[0].errors == []


def look_back(page):
    """Return the slider of the moment that is shown."""
    return page.get_by_role("slider").and_(page.locator(":visible")).first


def at_present(page, wait):
    """Return to the present, whatever moment the test before has looked at."""

    def is_live():
        look_back(page).press("End")  # again, if the slider's end was already past
        page.evaluate(SENT)
        return page.evaluate(STATE) == "live"

    tab(page, "Clearances")
    wait(is_live, "the present")


def coloured(page):
    """Return how many pixels of the window have clear's green, and how many stop's vermilion."""
    red, green, blue = np.moveaxis(decoded(page.screenshot()).astype(int), -1, 0)
    greens = (green - red > 60) & (green - blue > 25)
    vermilions = (red - green > 70) & (green - blue > 40)
    return int(greens.sum()), int(vermilions.sum())


def words(page):
    """Return the visible text of the panel: connection, banner and list."""
    return page.inner_text("#pm-connection") + page.inner_text("#pm-banner") + "".join(
        text for _, _, text in listed(page).values()
    )  # fmt: skip


# The texts that cover the window once the data is old; empty while it is fresh.
VEIL = """() => ['::before', '::after'].map(part => getComputedStyle(document.body, part))
  .map(style => style.display === 'none' ? '' : style.content)"""
OLD = ['""', '"? no news: everything shown is old"']


def all_is_old(page, said="#pm-pairs"):
    """Return whether the scene and the text of a tab show nothing as known."""
    grey = coloured(page) == (0, 0) and page.evaluate(VEIL) == OLD
    return grey and not set("●■") & set(page.inner_text(said))


def test_choice_hide_and_search_belong_to_each_browser(two, wait):
    one, other = two
    press(one, '[data-pair="table - die"]')
    one.wait_for_selector(f'{CHOSEN}[data-pair="table - die"]')
    press(one, '[data-word="ignore:ball - die"]')
    wait(lambda: "ball - die" not in listed(one), "the pair to go")
    enter(one, "Search", "table")
    wait(lambda: set(listed(one)) <= {"table - ball", "table - die", "table - cursor"}, "the rest")
    assert "ball - die" in listed(other)
    assert "die - cursor" in listed(other)
    assert other.locator(CHOSEN).count() == 0
    enter(one, "Search", "")
    press(one, '[data-word="ignore:ball - die"]')
    press(one, CHOSEN)
    wait(lambda: "ball - die" in listed(one) and not one.locator(CHOSEN).count(), "all again")


def test_who_looks_back_is_alone_there_and_reads_past_not_live(two, wait):
    one, other = two
    slider = look_back(one)
    wait(lambda: float(slider.get_attribute("aria-valuemax") or 0.0) > 2.0, "some past")
    slider.press("Home")
    wait(lambda: one.evaluate(STATE) == "past", "the past")
    assert "live" not in one.inner_text("#pm-connection")
    assert "looking back" in one.inner_text("#pm-connection")
    assert other.evaluate(STATE) == "live"
    wait(lambda: one.inner_text("#pm-banner").startswith("● clear\nnow: "), "the banner's word")
    slider.press("End")
    wait(lambda: one.evaluate(STATE) == "live", "the present")


def test_the_end_of_the_slider_is_now_also_for_a_slow_browser(one, wait):
    slider = look_back(one)

    def at(what):
        return float(slider.get_attribute(f"aria-value{what}") or 0.0)

    wait(lambda: at("max") > 4.0, "some past")
    for _ in range(9):  # 0.1 s each: the end that a slow browser may know
        slider.press("ArrowLeft")
    wait(lambda: at("now") == at("max"), "the end")
    assert one.evaluate(STATE) == "live"


def test_what_is_hidden_is_not_clear_for_that(two, sources, wait):
    one, other = two
    press(one, '[data-word="ignore:table - ball"]')
    wait(lambda: "table - ball" not in listed(one), "the pair to go")
    sources.move("ball", (-0.2, 0.0, 0.11))
    wait(lambda: (word(one), word(other)) == ("hidden", "STOP"), "both to know")
    said = " ".join(one.inner_text("#pm-banner").split())
    assert "1 hidden pair is not clear: STOP table - ball" in said
    other.get_by_text("Filter and group").click()
    select(other, field(other, "State"), "clear")
    left_out = "1 pair is not clear and left out by the filter"
    wait(lambda: other.get_by_text(left_out).count(), "the list to say what it leaves out")
    assert "table - ball" not in listed(other)
    press(other, "#pm-left-out")
    wait(lambda: next(iter(listed(other))) == "table - ball", "the pair to be listed")
    other.get_by_text("Filter and group").click()
    colour = "() => getComputedStyle(document.querySelector('#pm-banner')).borderTopColor"
    assert one.evaluate(colour) != "rgb({}, {}, {})".format(*GREEN)
    press(one, "#pm-pairs ~ .pm-small .pm-press")
    wait(lambda: word(one) == "STOP", "the pair to come back")
    assert next(iter(listed(one))) == "table - ball"


@pytest.fixture
def other_site(address):
    """A page of another server on this machine that shows ours in a frame."""

    class Framing(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(f"<iframe src='{address}'></iframe>".encode())

        def log_message(self, *_):
            """Say nothing."""

    server = HTTPServer(("127.0.0.1", 0), Framing)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


def test_another_site_cannot_show_the_page_in_a_frame(browser, other_site, wait):
    page = browser.new_page()
    page.goto(other_site)
    wait(lambda: page.frames[1:] and page.frames[1].url not in ("", "about:blank"), "the frame")
    assert page.frames[1].url.startswith("chrome-error:")
    page.close()


# The tests below end browsers and processes that others need: they come last, in this order.


def test_a_held_part_has_an_owner_and_is_let_go_with_it(two, sources, wait):
    one, other = two
    choose(other, "die")
    sources.release("die")
    drag(other, (-0.05, 0.0, 0.0))
    wait(lambda: sources.heard("die"), "the die to be held")
    wait(lambda: "held here" in other.inner_text("#pm-held"), "its holder to know")
    tab(one, "Move")
    field(one, "Part").click()
    one.get_by_role("option", name="die").click()
    wait(lambda: "held by browser 2" in one.inner_text("#pm-held"), "the owner to be shown")
    # A browser draws picture and panel one after the other, so each is waited for.
    visible = "() => window.__viserSceneTree.getState()['/gizmo'].effectiveVisibility"
    wait(lambda: not one.evaluate(visible), "no handles")
    wait(button(one, "Put it there").is_disabled, "no button")
    other.close()
    wait(lambda: one.evaluate(visible), "the die to be let go")
    wait(lambda: "take the part" in one.inner_text("#pm-held"), "the panel to say so")
    tab(one, "Clearances")
    sources.restore()
    wait(lambda: row(one, "table - die")[0] == pytest.approx(0.225), "its own source")


@pytest.fixture
def mixed(one, sources, wait):
    """The first browser: it shows one pair below stop, others clear, and all data fresh."""
    sources.move("ball", (-0.2, 0.0, 0.11))
    wait(lambda: word(one) == "STOP", "the ball to be near")
    choose(one, "ball")
    wait(lambda: set("●■") <= set(one.inner_text("#pm-near")), "both signs in the panel")
    tab(one, "Clearances")
    wait(lambda: min(coloured(one)) > 100, "both colours")
    assert "live" in words(one) and "● clear" in words(one) and "■ STOP" in words(one)
    assert one.evaluate(VEIL) == ["", ""]
    return one


def reads_as_old(page):
    """Return whether the panel names the pair that was near, and calls nothing live or clear."""
    said = words(page)
    return "? was STOP" in said and not any(each in said for each in ("live", "clear", "●", "■"))


def test_with_the_display_killed_all_is_grey_and_reads_as_old(mixed, display, start_display, wait):
    page, (process, address) = mixed, display
    process.popen.send_signal(signal.SIGKILL)
    wait(lambda: all_is_old(page), "the page to turn grey")
    assert reads_as_old(page)
    assert "? no news" in words(page)
    process.popen.wait()
    start_display(urlsplit(address).port)
    wait(lambda: page.query_selector("#pm-pairs .pm-row") and min(coloured(page)) > 100, "life")


def test_with_the_monitor_killed_all_is_grey_and_reads_as_old_to_who_comes_later_too(
    mixed, sources, browser, address, wait
):
    page = mixed
    sources.monitor.popen.send_signal(signal.SIGKILL)
    wait(lambda: all_is_old(page), "the page to turn grey")
    assert reads_as_old(page)
    wait(lambda: page.evaluate(STATE) in ("stale", "disconnected"), "the page to say so")
    tab(page, "Move")
    assert all_is_old(page, "#pm-near")
    tab(page, "Clearances")
    later = opened(browser, address)
    wait(lambda: later.query_selector("#pm-pairs .pm-row"), "the last list")
    assert coloured(later) == (0, 0)
    assert later.evaluate(VEIL) == OLD
    later.close()
