"""Every event and every conflict of a long session can be reached, in a real browser."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from page_hand import CHOSEN, button, enter, field, opened, press, select, tab

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import HERE, PARTS, SCENE, frame, page_of

from proximity_monitor.display.paging import ROWS
from proximity_monitor.display.state import STOP, Body, Frame, Pairs

pytestmark = pytest.mark.long
COUNT = 100
PARTNERS = [f"part {i}" for i in range(COUNT)]
BODIES = tuple(Body(name, True, f"/{i}", False, "1") for i, name in enumerate(["tool", *PARTNERS]))
MANY = replace(SCENE, name="many", bodies=BODIES, pairs=COUNT)
POSES = np.tile(HERE, (len(BODIES), 1))
AWAY = 0.3
EVENTS = "#pm-events .pm-row"
CONFLICTS = "#pm-conflicts .pm-row"


def tick(stamp_s, near=None):
    """Return a tick with all pairs away but `near`. It lists `near` and the first three."""
    listed = [i for i in range(COUNT) if i < 3 or i == near]
    bound = np.array([0.01 + 1e-5 * i if i == near else AWAY for i in listed])
    n = len(listed)
    told = Pairs(
        tuple(("tool", PARTNERS[i]) for i in listed), bound, bound, np.zeros((n, 2, 3)),
        np.zeros(n, np.int8), np.where(bound < AWAY, STOP, 0).astype(np.int8), np.zeros(n),
        np.full(n, stamp_s), ("",) * n,
    )  # fmt: skip
    return Frame(stamp_s, POSES, told)


@pytest.fixture
def long_session(browser, server, monkeypatch, tmp_path, wait):
    """A page on which each of 100 pairs was near once, for one tick, and its browser."""
    page = opened(browser, f"http://127.0.0.1:{server.get_port()}")
    wait(server.get_clients, "the browser")
    (client,) = server.get_clients().values()
    made = page_of(server, client, monkeypatch, tmp_path / "many.conflicts.json")
    parts = [PARTS[0]] * len(BODIES)
    made.tell(scene=MANY, parts=parts, frame=tick(0.0))
    for i in range(COUNT):
        made.tell(frame=tick(2.0 * i + 1.0, near=i))
        made.tell(frame=tick(2.0 * i + 2.0))
    tab(page, "Session")
    yield made, page
    assert not made.logged
    assert page.errors == []
    page.close()


# The first text in one column of all rows that a selector finds.
WORDS = """([rows, column]) => [...document.querySelectorAll(rows)]
  .map(row => row.cells[column].firstChild.textContent.trim())"""


def seen(made, page, rows, column):
    """Let the page make another step, and return the words in a column of a list."""
    made.tell()
    return page.evaluate(WORDS, [rows, column])


def test_every_event_is_reached_page_by_page(long_session, wait):
    made, page = long_session
    assert len(made.events.all) == 2 * COUNT
    wait(lambda: seen(made, page, EVENTS, 0)[:1] == ["200.0 s"], "the newest")
    found = []
    while True:
        moments = seen(made, page, EVENTS, 0)
        found += moments
        assert len(moments) <= ROWS
        following = page.locator("#pm-events-from", has_text="next").get_by_text("next")
        if not following.count():
            break
        following.dispatch_event("pointerdown")
        wait(lambda was=moments: seen(made, page, EVENTS, 0) != was, "the next page")
    assert found == [f"{event.stamp_s:.1f} s" for event in reversed(made.events.all)]
    # Events that come meanwhile move nothing under the pointer.
    made.tell(frame=tick(1000.0, near=5))
    made.tell(frame=tick(1001.0))
    assert seen(made, page, EVENTS, 0) == moments
    page.locator("#pm-events-from").get_by_text("first").dispatch_event("pointerdown")
    wait(lambda: seen(made, page, EVENTS, 0)[:1] == ["1001.0 s"], "the newest")


def test_every_conflict_is_reached_and_its_status_too(long_session, wait):
    made, page = long_session
    # Conflicts must be reached even if their events are forgotten and their pairs not listed.
    made.events.clear()
    wait(lambda: len(seen(made, page, CONFLICTS, 1)) == ROWS, "a page of conflicts")
    found = seen(made, page, CONFLICTS, 1)
    for _ in range(2):
        was = seen(made, page, CONFLICTS, 1)
        page.locator("#pm-conflicts-from").get_by_text("next").dispatch_event("pointerdown")
        wait(lambda was=was: seen(made, page, CONFLICTS, 1) != was, "the next page")
        found += seen(made, page, CONFLICTS, 1)
    assert found == [f"tool - {name}" for name in PARTNERS]
    last = page.locator(CONFLICTS).last
    told = [seen(made, page, CONFLICTS, column)[-1] for column in range(4)]
    assert told == ["■ STOP", "tool - part 99", "10.990 mm", "199.0 s"]
    last.dispatch_event("pointerdown")
    tab(page, "Clearances")
    wait(lambda: seen(made, page, CHOSEN, 2) == ["10.990 mm"], "that moment")
    page.get_by_text("Status of the pair", exact=True).click()
    note = page.locator("#pm-decided")
    wait(
        lambda: made.tell() or "refers to this moment: 10.990 mm" in note.inner_text(), "the panel"
    )
    select(page, field(page, "Status"), "accepted")
    enter(page, "Comment", "as drawn")
    button(page, "Save the status").click()
    told = "accepted at 10.990 mm: as drawn"
    wait(lambda: made.tell() or told in note.inner_text(), "the decision")
    tab(page, "Session")
    button(page, "Back to live").click()
    tab(page, "Clearances")
    wait(lambda: seen(made, page, "#pm-pairs .pm-row", 0) == ["● clear"] * 3, "the present")
    page.get_by_text("Filter and group").click()
    select(page, field(page, "Of status"), "accepted")
    tab(page, "Session")
    wait(lambda: seen(made, page, CONFLICTS, 1) == ["tool - part 99"], "the accepted one alone")
    assert told in page.inner_text("#pm-conflicts")
    press(page, "#pm-conflicts ~ [data-word='unfilter:']")
    wait(lambda: len(seen(made, page, CONFLICTS, 1)) == ROWS, "all again")


# By how many pixels the panel's content is wider than the window has room for.
TOO_WIDE = """() => {
  const panel = document.querySelector('#pm-pairs').closest('.mantine-ScrollArea-viewport');
  return panel.getBoundingClientRect().left + panel.scrollWidth - innerWidth;
}"""


def test_a_matrix_of_many_parts_makes_the_panel_no_wider(long_session, wait):
    made, page = long_session
    every = tick(1000.0)
    bound = np.full(COUNT, AWAY)
    whole = replace(
        every.pairs, names=tuple(("tool", name) for name in PARTNERS), lower=bound, upper=bound,
        points=np.zeros((COUNT, 2, 3)), silent=("",) * COUNT,
        **{name: np.zeros(COUNT, getattr(every.pairs, name).dtype)
           for name in ("status", "level", "age_s", "stamp_s")},
    )  # fmt: skip
    made.tell(frame=replace(every, pairs=whole))
    tab(page, "Clearances")
    page.get_by_text("Clash matrix").click()
    page.locator("#pm-matrix tr:nth-child(20)").wait_for()
    assert page.evaluate(TOO_WIDE) <= 0.0


def test_events_are_filtered_by_state_and_part(long_session, wait):
    made, page = long_session
    tab(page, "Clearances")
    page.get_by_text("Filter and group").click()
    select(page, field(page, "State"), "stop")
    select(page, field(page, "Of part"), "part 42")
    tab(page, "Session")
    wait(lambda: seen(made, page, EVENTS, 0) == ["85.0 s"], "the one event")
    assert "199 left out by the filter" in page.inner_text("#pm-events ~ [data-word='unfilter:']")


# Whether the middle of the pill can be seen in the window.
PILL_SEEN = """() => {
  const pill = document.querySelector('#pm-connection .pm-pill');
  const r = pill.getBoundingClientRect();
  return pill.contains(
    document.elementFromPoint((r.left + r.right) / 2, (r.top + r.bottom) / 2));
}"""


@pytest.fixture
def short_session(browser, server, monkeypatch, tmp_path, wait):
    """A page in a low window with two events of a pair."""
    page = opened(browser, f"http://127.0.0.1:{server.get_port()}", height=400)
    wait(server.get_clients, "the browser")
    (client,) = server.get_clients().values()
    made = page_of(server, client, monkeypatch, tmp_path / "short.conflicts.json")
    made.tell(frame=frame(1.0, 0.01, STOP))
    made.tell(frame=frame(2.0))
    tab(page, "Session")
    yield made, page
    page.close()


def test_the_past_is_marked_also_where_the_panel_is_scrolled_down(short_session, wait):
    made, page = short_session
    wait(lambda: seen(made, page, EVENTS, 0) == ["2.0 s", "1.0 s"], "the events")
    event = page.locator(EVENTS).last
    event.dispatch_event("pointerdown")
    pill = page.locator("#pm-connection")
    wait(lambda: made.tell() or pill.get_attribute("data-state") == "past", "the past")
    event.evaluate("each => each.scrollIntoView({block: 'start'})")
    assert page.locator("#pm-banner").bounding_box()["y"] < 0.0
    assert page.evaluate(PILL_SEEN)


def test_what_is_not_proved_turns_grey_when_no_tick_comes(short_session, wait):
    made, page = short_session
    now, on = frame(3.0, -0.123, STOP), ("edge 1 0.3 0.3 0.4", "edge 123456 0.123 0.456 0.421")
    made.choice.pair = now.pairs.names[0]
    made.tell(
        frame=replace(now, pairs=replace(now.pairs, upper=np.array([0.234]), features={0: on}))
    )
    tab(page, "Clearances")
    told = page.locator("#pm-pairs .pm-unproved")
    wait(lambda: told.all_inner_texts() == ["not proved above stop"], "the doubt")
    assert page.locator("#pm-pairs .pm-on").count() == 2
    colour = "each => getComputedStyle(each).color"
    wait(lambda: told.evaluate(colour) == "rgb(122, 122, 133)", "the page to turn grey")
    assert page.evaluate(TOO_WIDE) <= 0.0  # although the row has all words that a row can have
