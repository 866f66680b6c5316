"""Several browsers at one display: what belongs to each, and what an error in one does."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
import ticks
from deadlines import DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import CORNERS, HERE, NAMES, SCENE, THERE, drag, frame, words
from raw_browser import RawBrowser

from proximity_monitor.display import labels, tried
from proximity_monitor.display import pages as all_pages
from proximity_monitor.display.bridge import pair_word
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import STOP, Health


@pytest.fixture
def page(alone):
    return alone


def numbers(page):
    """Return the clearance in the list and the one on the label, as texts."""
    label = page.all._labels._nodes[0]
    assert label.visible
    return re.search(r"[\d.]+ mm", words(page.all._table))[0], label.text.split("\n")[0][2:]


def test_the_labels_are_of_the_tick_that_the_list_shows(page, monkeypatch):
    monkeypatch.setattr(labels, "places", lambda all, *_: [np.zeros(2)] * len(all))
    page.all._labels._every_s = np.inf  # a moving camera alone would not place them anew
    for stamp_s, clearance in ((1.0, 0.25), (2.0, 0.24), (3.0, 0.23)):
        page.tell(frame=frame(stamp_s, clearance))
        told = f"{1e3 * clearance:.3f} mm"
        assert numbers(page) == (told, told)
    page.all._table_due_s = np.inf  # a long list is updated less often
    page.all._labels._every_s, page.all._labels._due_s = 0.0, -np.inf
    page.tell(frame=frame(4.0, 0.22))
    assert numbers(page) == (told, told)


def test_an_error_in_one_browser_s_page_is_shown_there_logged_once_and_survived(
    page, server, monkeypatch
):
    other = RawBrowser(server)
    page.tell()
    theirs = page.pages._pages[other.client.client_id]
    sound = theirs._lines.show
    monkeypatch.setattr(theirs._lines, "show", lambda *_: 1 / 0)
    for stamp_s in (1.0, 2.0):
        page.tell(frame=frame(stamp_s, 0.01, STOP))
        assert re.search("ZeroDivisionError.*reload it", words(theirs._fault))
        assert "STOP" in words(page.all._banner)
        assert words(page.all._fault) == ""
    (told,) = page.logged
    assert "test_pages.py" in told and "ZeroDivisionError" in told
    assert all(line.startswith("  ") for line in told.splitlines()[1:])  # for the demo
    monkeypatch.setattr(theirs._lines, "show", sound)
    page.tell(frame=frame(3.0, 0.3))
    assert "ZeroDivisionError" in words(theirs._fault)  # still shown for a while
    assert "clear" in words(theirs._banner)
    theirs._fault_until_s = 0.0
    page.tell()
    assert words(theirs._fault) == ""
    other.close()


def test_an_error_in_what_all_share_is_shown_to_all_and_survived(page, monkeypatch):
    beat = page.all._beat._html.content
    monkeypatch.setattr(page.session, "add", lambda *_, **__: 1 / 0)
    page.tell(frame=frame(1.0, 0.01, STOP))
    assert "ZeroDivisionError" in words(page.all._fault)
    assert page.all._beat._html.content == beat  # the shown data becomes old
    monkeypatch.undo()
    page.tell(frame=frame(1.5, 0.01, STOP))
    assert "STOP" in words(page.all._banner)
    assert page.all._beat._html.content != beat


def test_many_browsers_share_the_time_and_each_has_its_turn(page, server, monkeypatch):
    others = [RawBrowser(server) for _ in range(2)]
    page.tell()
    monkeypatch.setattr(all_pages, "STEP_S", 0.0)
    for stamp_s in (1.0, 2.0, 3.0):
        page.tell(frame=frame(stamp_s))
    shown = {each._shown.frame.stamp_s for each in page.pages._pages.values()}
    assert shown == {1.0, 2.0, 3.0}
    for each in others:
        each.close()


def test_an_error_in_what_a_browser_s_message_causes_is_shown_and_survived(
    page, raw, server, monkeypatch
):
    monkeypatch.setattr(page.hand, "undo", lambda: 1 / 0)
    for stamp_s in (1.0, 2.0):
        raw.set(page.move._undo, True)
        raw.heard(server)
        page.tell(frame=frame(stamp_s, 0.01, STOP))
        assert "ZeroDivisionError" in words(page.all._fault)
        assert "STOP" in words(page.all._banner)
    assert len(page.logged) == 1


def test_what_a_browser_asks_for_has_its_turn_between_two_steps(page, raw, server):
    before = page.move._stop.value
    raw.set(page.move._who, "b")
    raw.set(page.move._stop, "at stop")
    raw.heard(server)
    assert page.move._stop.value != before  # it has come,
    assert page.choice.body is None  # but a step may be in the middle of its work
    page.tell()
    assert page.choice.body == "b"


def test_each_has_its_turn_with_the_value_that_a_person_gave(page, raw, server):
    word = next(each for each in raw.inputs() if getattr(each, "label", "") == "pressed")
    raw.set(word, f"ignore:{' - '.join(NAMES)}#1")
    raw.set(word, f"ignore:{' - '.join(NAMES)}#2")
    raw.set(word, "unfilter:#3")
    raw.set(word, f"pick:{' - '.join(NAMES)}#4")  # done twice it would be undone
    raw.set(page.move._who, "b")
    raw.heard(server)
    page.move._who.value = "(none)"  # a step may show this before it handles the choice
    page.tell()
    assert page.choice.ignored == frozenset()
    assert page.choice.pair == NAMES
    assert page.choice.body == page.move._who.value == "b"


def test_each_has_its_turn_with_what_the_other_fields_showed_then(page, raw, server):
    inspect = page.all._inspect
    raw.set(inspect._bands, True)
    raw.heard(server)
    page.tell()
    assert all(page.choice.looks[name].bands for name in NAMES)
    raw.set(inspect._bands, False)  # for all parts
    raw.set(inspect._whose, "b")
    raw.set(inspect._opacity, 0.5)  # for b alone
    raw.heard(server)
    page.tell()
    assert not any(page.choice.looks[name].bands for name in NAMES)
    assert [page.choice.looks[name].opacity for name in NAMES] == [None, 0.5]
    assert inspect._whose.value == "b"


def test_a_step_is_as_long_as_was_shown_when_it_was_pressed(page, raw, server):
    labelled = {getattr(each, "label", ""): each for each in raw.inputs()}
    raw.set(page.move._who, "b")
    raw.set(labelled["Step [mm]"], 2.0)
    raw.set(labelled["Step by"], "+X")
    raw.set(labelled["Step [mm]"], 5.0)
    raw.set(labelled["Step by"], "+Y")
    raw.heard(server)
    page.tell()
    assert page.holds.poses["b"][:3] == pytest.approx([3.002, 0.005, 0.0])
    assert labelled["Step [mm]"].value == 5.0


def test_the_least_step_is_one_of_the_last_shown_digit(page, raw, server):
    labelled = {getattr(each, "label", ""): each for each in raw.inputs()}
    step = labelled["Step [mm]"]
    assert step.min == pytest.approx(0.001)  # the browser raises smaller ones to it
    raw.set(page.move._who, "b")
    step.value = 0.0
    raw.set(labelled["Step by"], "+X")
    raw.heard(server)
    page.tell()
    assert page.holds.poses["b"][0] == pytest.approx(3.000001, abs=1e-9)


def test_each_tick_is_good_for_a_second_from_when_it_came(page):
    told = []
    for stamp_s in (1.0, 2.0):
        page.tell(frame=frame(stamp_s))
        page.tell()  # the same tick again
        told.append(page.all._beat._html.content)
    names, seconds = zip(
        *(re.search(r"(pm-old-\d) 1ms linear (.*)s f", x).groups() for x in told), strict=True
    )
    assert set(names) == {"pm-old-0", "pm-old-1"}  # a new name restarts the animation
    assert all(0.5 < float(each) <= 1.0 for each in seconds)
    page.pages._inbox.tell(frame_at_s=time.monotonic() - 2.0, frame=frame(3.0))
    page.pages.step()
    assert page.all._beat._html.content == told[-1]


def test_what_was_tried_in_one_scene_is_not_told_in_another(page):
    times = {"search_p50_ms": "1.25", "search_p99_ms": "2.5", "message": ""}
    for _ in range(3):
        page.tell(health=Health(times))
    assert "Search now: 1.25 ms" in words(page.all._settings._cost)
    assert "1.25 2.50 0.000 mm 0" in words(page.all._settings._cost)
    page.tell(scene=replace(SCENE, name="another"), health=Health(times))
    told = words(page.all._settings._cost)
    assert "1.25 ms a tick" in told
    assert "1.25 2.50" not in told.split("tried in this scene")[1]


def test_a_pair_is_found_by_its_names_whatever_hyphens_they_have(page):
    bodies = ("x -", "y", "x", "- y", "p-q", "p%2Dq")
    pairs = (("x -", "y"), ("x", "- y"), ("y", "p-q"), ("y", "p%2Dq"))
    scene = replace(
        SCENE, pairs=4, bodies=tuple(replace(SCENE.bodies[0], name=name) for name in bodies)
    )
    told = ticks.frame(1.0, [0.3] * 4, names=pairs)
    parts = [Part(HERE, np.ones(4), CORNERS)] * len(bodies)
    page.tell(scene=scene, parts=parts, frame=replace(told, poses=np.tile(HERE, (6, 1))))
    words_of = {pair: re.search('"(.*)"', pair_word("", pair))[1] for pair in pairs}
    for pair in pairs:
        assert f'data-word="ignore{words_of[pair]}"' in page.all._table.content
        page.all._on_word(f"ignore{words_of[pair]}")
        assert pair in page.choice.ignored
    assert page.choice.ignored == frozenset(pairs)
    for what in ("ignore", "pick", "conflict"):
        page.all._on_word(f"{what}:no such - pair")
        page.all._on_word(f"{what}:nothing")
    assert page.choice.ignored == frozenset(pairs)
    assert page.choice.pair is None
    for pair in pairs:
        page.all._on_word(f"conflict{words_of[pair]}")
        assert page.choice.pair == pair


@pytest.mark.parametrize(
    "rel, absolute, told",
    [
        (None, 0.0, "as the scene says, 5 ms"),
        (None, 0.001, "1 mm or as the scene says, 5 ms"),
        (0.02, None, "2 % or as the scene says, 5 ms"),
        (0.0, 0.0, "exact, 5 ms"),
    ],
)
def test_what_each_pair_has_of_its_own_is_not_called_exact(rel, absolute, told):
    settings = {"rel_err": rel, "abs_err": absolute, "budget_ms": 5.0}
    assert tried._named(settings, "mm", 0.001) == told


def test_a_browser_that_goes_lets_go_what_it_holds(page, server):
    other = RawBrowser(server)
    page.tell()
    theirs = page.pages._pages[other.client.client_id].hand
    theirs.place("b", THERE, now=HERE)
    page.move.pick("b")
    page.tell()
    assert f"held by {theirs.name}" in words(page.move._note)
    drag(page, "start", 3.5)
    drag(page, "update", 4.0)
    assert page.holds.poses["b"] is THERE
    page.move._on_release(None)  # which is to take it over
    assert page.holds.owner("b") is page.hand
    page.hand.release()
    theirs.place("b", THERE, now=HERE)
    other.close()
    deadline = time.monotonic() + DEADLINE_S
    while page.holds.poses:
        assert time.monotonic() < deadline
        page.tell()


def test_a_browser_hears_on_whose_sender_was_called_just_before_it_waited(page, raw, wait):
    event = raw.client._websock_connection.get_message_buffer().message_event
    missed = threading.Event()

    class Late(deque):
        """The event's waiters. Just before a sender is added, another thread sets the event."""

        def append(self, sender):
            calling = threading.Thread(target=event.set)  # as another thread's message does
            calling.start()
            calling.join()
            missed.set()
            super().append(sender)

    page.tell(frame=frame(1.0))
    event._waiters = Late(event._waiters)
    page.tell(frame=frame(2.0, 0.2))
    wait(missed.is_set, "the sender to have nothing to send")
    before = -1
    while before < (before := raw.messages):  # until all earlier messages have arrived
        time.sleep(0.1)
    page.tell(frame=frame(3.0, 0.1))
    wait(lambda: raw.messages > before, "a message after that")
