"""What the page says about pairs that a tick does not list."""

from dataclasses import replace

import numpy as np
import pytest
from page_alone import SCENE, words
from ticks import pairs

from proximity_monitor.display import state as states
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.connection import Connection, ConnectionState, banner
from proximity_monitor.display.events import Events
from proximity_monitor.display.pairs import table
from proximity_monitor.display.signs import CLEAR_SIGN
from proximity_monitor.display.state import STALE, STOP, Frame, Health
from proximity_monitor.display.unlisted import Unlisted, reason, unlisted

NAMES = (("a", "b"), ("a", "c"))
LIVE = Connection(ConnectionState.LIVE, "")


def frame(stamp_s, names=NAMES, level=0, silent=()):
    told = pairs([0.3] * len(names), [0.3] * len(names), level=level, names=names)
    return Frame(stamp_s, np.zeros((0, 7)), replace(told, silent_bodies=dict(enumerate(silent))))


def health(unsure, unwatched):
    told = {"pairs not listed": str(unsure), "pairs not watched": str(unwatched)}
    return Health(clearance=told)


@pytest.mark.parametrize(
    "told, count, line, told_of",
    [
        (health(0, 0), Unlisted(far=4), "4 beyond their range", "all 6 pairs"),
        (health(0, 3), Unlisted(far=1, unwatched=3), "3 not watched", "all 3 watched pairs"),
        (health(3, 0), Unlisted(far=1, unsure=3), "3 without a recent pose", None),
        (None, Unlisted(unexplained=4), "4 not listed", "all 2 listed pairs"),
        (Health(), Unlisted(unexplained=4), "4 not listed", "all 2 listed pairs"),
        (health("nan", 0), Unlisted(unexplained=4), "4 not listed", "all 2 listed pairs"),
    ],
)
def test_pairs_that_are_not_listed_are_clear_only_as_far_as_that_is_known(
    told, count, line, told_of
):
    scene, now = replace(SCENE, pairs=6), frame(1.0)
    left = unlisted(now.pairs, scene, told)
    assert left == count
    assert line in table(now.pairs, scene, Choice(), left=left)
    said = banner(now, scene, Choice(), LIVE, left)
    assert (CLEAR_SIGN.colour in said) is (told_of is not None)
    if told_of is not None:
        assert f"clear {told_of}; nearest of those listed a - b" in words_of(said)


@pytest.mark.parametrize(
    "left, line",
    [
        (Unlisted(far=1), "1 beyond its range"),
        (Unlisted(unwatched=1), "1 not watched: its bodies are attached to each other"),
        (Unlisted(unwatched=2), "2 not watched: their bodies are attached to each other"),
    ],
)
def test_one_unlisted_pair_is_told_in_the_singular(left, line):
    assert left.lines == [line]


@pytest.mark.parametrize(
    "clear, said",
    [
        (41, "1 more clear pair: search for it"),
        (42, "2 more clear pairs: search for them"),
    ],
)
def test_one_more_pair_than_the_list_has_room_for_is_told_in_the_singular(clear, said):
    told = frame(0.0, tuple(("a", f"b{i}") for i in range(clear))).pairs
    assert said in table(told, replace(SCENE, pairs=clear), Choice())
    kept = Choice(search="b0")
    one = frame(0.0, (("a", "b0"), ("a", "b1"))).pairs
    assert "1 clear pair is left out by the filter" in table(one, replace(SCENE, pairs=2), kept)


@pytest.mark.parametrize(
    "told, said",
    [(health(0, 0), "no pair is watched"), (health(0, 1), "no pair is watched"),
     (None, "no pair is listed")],
)  # fmt: skip
def test_where_no_pair_is_watched_none_is_clear(told, said):
    """The diagnostics may be older than the attachment; the scene already tells of it."""
    scene, now = replace(SCENE, unwatched={("a", "b")}), frame(1.0, names=())
    left = unlisted(now.pairs, scene, told)
    assert left.far == 0
    shown = banner(now, scene, Choice(), LIVE, left)
    assert CLEAR_SIGN.colour not in shown
    assert said in words_of(shown)


def words_of(html):
    class Html:
        content = html

    return words(Html)


def test_an_attached_pair_is_unwatched_and_not_clear():
    scene, events = replace(SCENE, unwatched={("a", "c")}), Events()
    events.note(frame(0.0, level=STOP), SCENE)
    events.note(frame(1.0, NAMES[:1], STOP), scene)
    assert reason(("a", "c"), frame(1.0).pairs, scene).startswith("not watched")
    assert reason(("a", "b"), frame(1.0).pairs, scene) == "beyond its range"
    events.note(frame(2.0, NAMES[:1], STOP), scene)
    events.note(frame(3.0), SCENE)
    changes = [(event.before.word, event.after.word) for event in events.all]
    assert changes == [("STOP", "unwatched"), ("STOP", "clear"), ("unwatched", "clear")]


def test_a_silent_pair_that_is_no_longer_listed_stays_stale_until_its_body_is_heard():
    events = Events()
    silent = (("a",), ("a", "c"))
    events.note(frame(0.0, level=STALE, silent=silent), SCENE)
    events.note(frame(1.0, NAMES[:1], STALE, silent[:1]), SCENE)
    assert not events.all
    events.note(frame(2.0, NAMES[:1]), SCENE)
    assert [(*event.pair, event.after.word) for event in events.all] == [
        ("a", "b", "clear"), ("a", "c", "clear"),
    ]  # fmt: skip


def test_a_pair_is_clear_only_if_no_silent_body_s_pairs_are_left_out(monkeypatch):
    silent = frame(0.0, level=STALE, silent=(("a",), ("a",))).pairs
    assert reason(("b", "d"), silent, SCENE) == "beyond its range"
    monkeypatch.setattr(states, "LISTED_SILENT", 2)
    silent = frame(0.0, level=STALE, silent=(("a",), ("a",))).pairs
    assert reason(("b", "c"), silent, SCENE) == "beyond its range"  # both are heard
    assert reason(("b", "d"), silent, SCENE).startswith("not listed")


def test_a_bound_that_falls_below_the_limit_proves_what_was_open():
    events = Events()
    for stamp_s, low, high in ((0.0, 0.01, 0.3), (1.0, 0.005, 0.015), (2.0, 0.01, 0.3)):
        told = replace(pairs([low], [high], level=STOP, names=NAMES[:1]))
        events.note(Frame(stamp_s, np.zeros((0, 7)), told), SCENE)
    assert [event.after.word for event in events.all] == ["STOP", "STOP?"]
