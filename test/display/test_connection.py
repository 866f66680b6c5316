"""What the page says about how current it is, and which pair it warns about."""

import re
from dataclasses import replace

import numpy as np
import pytest

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.connection import (
    Connection,
    ConnectionState,
    banner,
    connection,
    pill,
)
from proximity_monitor.display.inbox import News
from proximity_monitor.display.listing import ROWS, listing
from proximity_monitor.display.order import urgent_first
from proximity_monitor.display.pairs import table
from proximity_monitor.display.signs import CLEAR_SIGN
from proximity_monitor.display.state import (
    BOUNDED,
    INTERSECTING,
    STALE,
    STOP,
    WARN,
    Frame,
    Health,
    Pairs,
    SceneInfo,
    Thresholds,
    Unit,
)

NOW = 1000.0
NAMES = (("a", "b"), ("a", "c"), ("b", "c"))
SCENE = SceneInfo(
    name="cell",
    description="",
    frame="world",
    unit=Unit("mm", 0.001),
    bodies=(),
    deforming=frozenset(),
    pairs=3,
    thresholds=Thresholds(0.1, 0.02, 0.0),
    own_thresholds={},
    own_parameters=True,
    settings={"rate_hz": 30.0},
)


def frame(
    level=(0, 0, 0), status=(0, 0, 0), silent=("", "", ""), stamps=(9.5, 9.0, 8.0), mute=None
):
    lower = np.array([0.3, 0.2, 0.01])
    told = Pairs(
        NAMES,
        lower,
        lower,
        np.zeros((3, 2, 3)),
        np.array(status, np.int8),
        np.array(level, np.int8),
        np.zeros(3),
        np.array(stamps),
        silent,
        silent_bodies=mute or {},
    )
    return Frame(10.0, np.zeros((0, 7)), told)


def news(**changes):
    told = {
        "scene": SCENE,
        "parts": [],
        "frame": frame(),
        "frame_at_s": NOW - 0.02,
        "health": Health(schedule={"message": "paused"}),
        "health_at_s": NOW - 0.5,
        "present": True,
    }
    return News(**(told | changes))


NEVER = float("-inf")


@pytest.mark.parametrize(
    "changes, state, text",
    [
        ({}, ConnectionState.LIVE, "the numbers match"),
        ({"frame_at_s": NOW - 2.0}, ConnectionState.STALE, "no tick for 2.0 s: paused"),
        (
            {"frame": frame(status=(BOUNDED, BOUNDED, 0))},
            ConnectionState.COMPUTING,
            "2 pairs are not exact",
        ),
        ({"parts": None}, ConnectionState.COMPUTING, "the meshes"),
        ({"frame": None, "frame_at_s": NEVER}, ConnectionState.COMPUTING, "the first tick"),
        (
            {"frame": None, "frame_at_s": NEVER, "health_at_s": NEVER},
            ConnectionState.COMPUTING,
            "is preparing its search",
        ),
        (
            {"frame": None, "frame_at_s": NEVER, "health_at_s": NEVER, "present": False},
            ConnectionState.DISCONNECTED,
            "waiting for a monitor: start one, or compare",
        ),
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0},
            ConnectionState.STALE,
            "no word from the monitor for 9 s",
        ),
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0, "present": False},
            ConnectionState.DISCONNECTED,
            "monitor gone for 8 s",
        ),
        ({"unreadable": {"tick": "cut"}}, ConnectionState.STALE, "cannot be read: tick: cut"),
        (
            {"scene": None, "frame": None, "unreadable": {"scene": "is the monitor older?"}},
            ConnectionState.STALE,
            "scene: is the monitor older?",
        ),
    ],
)
def test_the_state_of_the_connection(changes, state, text):
    told = connection(news(**changes), NOW)
    assert told.state is state
    assert text in told.text


def test_silent_bodies_are_named_with_how_long():
    mute = {1: ("c",), 2: ("b", "c")}
    told = connection(news(frame=frame(level=(0, STALE, STALE), mute=mute)), NOW)
    assert told.state is ConnectionState.STALE
    # c: from the pair in which only c is silent. b: from the pair in which both are silent.
    assert told.text == "no recent pose: c (1.0 s), b (2.0 s)"


def test_a_body_that_never_had_a_pose_is_named():
    stamps = (9.5, np.nan, 9.0)
    told = connection(news(frame=frame((0, STALE, 0), mute={1: ("c",)}, stamps=stamps)), NOW)
    assert told.text == "no recent pose: c (never)"


def test_what_never_had_a_pose_says_nothing_of_how_long_another_is_silent():
    mute = {0: ("a", "c"), 1: ("c",)}
    stamps = (np.nan, 7.0, 9.0)
    told = connection(news(frame=frame((STALE, STALE, 0), mute=mute, stamps=stamps)), NOW)
    assert told.text == "no recent pose: a (never), c (3.0 s)"


def test_nothing_is_live_with_a_stale_pair_of_which_no_silent_body_is_told():
    told = connection(news(frame=frame((0, STALE, 0))), NOW)
    assert told.state is ConnectionState.STALE
    assert told.text == "no recent pose: a (1.0 s), c (1.0 s)"


LIVE = Connection(ConnectionState.LIVE, "")


def words(html):
    """Return the text that is shown while the data is fresh."""
    html = re.sub("<span class=pm-then>[^<]*</span>", "", html)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", html)).strip()


def test_the_banner_names_the_worst_pair_and_its_threshold():
    told = banner(frame(level=(WARN, 0, STOP)), SCENE, Choice(), LIVE)
    assert words(told) == "■ STOP b - c: 10.000 mm, stop at 20.000 mm + 1 more"
    assert "role=alert" in told


def test_contact_comes_before_all_else():
    wrong = frame(level=(STOP, 0, STOP), status=(INTERSECTING, 0, 0))
    told = banner(wrong, SCENE, Choice(), LIVE)
    assert words(told).startswith("✖ CONTACT a - b")


def test_ignored_pairs_raise_no_alert_but_nothing_is_green_unless_they_are_clear_too():
    hidden = Choice(ignored=frozenset({("b", "c")}))
    told = banner(frame(level=(0, 0, STOP)), SCENE, hidden, LIVE)
    assert words(told) == (
        "◍ hidden 1 hidden pair is not clear: STOP b - c: 10.000 mm, stop at 20.000 mm"
    )
    assert CLEAR_SIGN.colour not in told
    stale = news(frame=frame((0, 0, STALE), silent=("", "", "no recent pose of c")))
    told = banner(stale.frame, SCENE, hidden, connection(stale, NOW))
    assert words(told).startswith("◍ hidden 1 hidden pair is not clear: stale b - c: no recent")
    assert CLEAR_SIGN.colour not in told
    told = banner(frame(), SCENE, hidden, LIVE)
    assert words(told) == "● clear all 3 pairs, 1 of them hidden; nearest b - c: 10.000 mm"
    assert CLEAR_SIGN.colour in told


def test_what_is_not_proved_above_a_threshold_reads_otherwise_than_what_is_below():
    given = frame(level=(0, 0, STOP))
    sure = banner(given, SCENE, Choice(), LIVE)
    assert words(sure) == "■ STOP b - c: 10.000 mm, stop at 20.000 mm"
    wide = replace(given.pairs, upper=given.pairs.lower + np.array([0.0, 0.0, 0.015]))
    unproved = banner(replace(given, pairs=wide), SCENE, Choice(), LIVE)
    assert words(unproved) == (
        "□ STOP? b - c: 10.000 … 25.000 mm, not proved above stop at 20.000 mm"
    )


def test_the_worst_state_comes_first_then_the_least_margin_to_the_pair_s_own_threshold():
    scene = replace(SCENE, own_thresholds={("a", "c"): Thresholds(0.3, 0.25, 0.0)})
    both = frame(level=(0, STOP, STOP))  # a - c: 50 mm below its own, b - c: 10 mm
    assert "STOP a - c: 200.000 mm" in words(banner(both, scene, Choice(), LIVE))
    assert urgent_first(both.pairs, scene).tolist() == [1, 2, 0]
    touching = frame(level=(STOP, STOP, WARN), status=(INTERSECTING, 0, 0))
    assert urgent_first(touching.pairs, scene).tolist() == [0, 1, 2]


def test_a_pair_that_is_not_clear_is_listed_among_however_many_nearer_ones_that_are():
    count = 90
    names = tuple(("a", f"p{i}") for i in range(count))
    lower, level = np.full(count, 2e-5), np.zeros(count, np.int8)
    lower[77], level[77], level[78] = 0.004, STOP, WARN
    told = Pairs(
        names, lower, lower, np.zeros((count, 2, 3)), np.zeros(count, np.int8), level,
        np.zeros(count), np.zeros(count), ("",) * count,
    )  # fmt: skip
    own = {names[77]: Thresholds(0.01, 0.005, 0.0)}
    scene = replace(SCENE, pairs=count, thresholds=Thresholds(1e-5, 1e-6, 0), own_thresholds=own)
    found = listing(told, scene, Choice())
    assert [rows[:2] for _, rows in found.groups] == [[77, 78]]
    assert len(found.groups[0][1]) == ROWS + 2
    assert found.more_clear == count - 2 - ROWS
    # If a filter leaves such pairs out, the list says so.
    found = listing(told, scene, Choice(search="p5"))
    assert found.left_out == 2
    text = words(table(told, scene, Choice(search="p5")))
    assert "2 pairs are not clear and left out" in text
    assert f"{found.clear_left_out} clear pairs are left out by the filter" in text
    assert found.clear_left_out > 0
    assert listing(told, scene, Choice(state="stop")).groups == [("", [77])]
    assert listing(told, scene, Choice(part="p78")).groups == [("", [78])]
    assert [title for title, _ in listing(told, scene, Choice(group="state")).groups] == [
        "stop", "warn", "clear",
    ]  # fmt: skip
    ((title, rows),) = listing(told, scene, Choice(group="part")).groups
    assert (title, rows[0]) == ("a", 77)
    # A hidden pair that is not clear is named as well.
    hidden = table(told, scene, Choice(ignored=frozenset({names[77]})))
    assert "a - p77 ■ STOP" in words(hidden)


def test_many_that_are_not_clear_are_all_listed():
    count = 250
    names = tuple(("a", f"p{i}") for i in range(count))
    lower = np.linspace(0.001, 0.01, count)
    told = Pairs(
        names, lower, lower, np.zeros((count, 2, 3)), np.zeros(count, np.int8),
        np.full(count, STOP, np.int8), np.zeros(count), np.zeros(count), ("",) * count,
    )  # fmt: skip
    html = table(told, replace(SCENE, pairs=count), Choice())
    assert re.findall('data-pair="a - (p[0-9]+)"', html) == [b for _, b in names]


@pytest.mark.parametrize(
    "changes, text",
    [
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0, "present": False},
            "monitor gone for 8 s",
        ),
        ({"frame_at_s": NOW - 2.0}, "no tick for 2.0 s: paused"),
        ({"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0}, "no word from the monitor for 9 s"),
        ({"unreadable": {"tick": "cut"}}, "cannot be read: tick: cut"),
    ],
)
def test_what_was_clear_is_no_longer_said_to_be_when_no_tick_comes(changes, text):
    given = news(**changes)
    told = banner(given.frame, SCENE, Choice(), connection(given, NOW))
    assert words(told) == f"? stale {text}"
    assert "role=alert" in told
    stop = banner(frame(level=(0, 0, STOP)), SCENE, Choice(), connection(given, NOW))
    assert words(stop).startswith("■ STOP b - c")


def test_who_looks_back_is_told_what_is_of_now():
    told = connection(news(), NOW)
    assert "the numbers match the present poses" in pill(told, Choice())
    assert "looking back" in pill(told, Choice(at_s=3.0))
    assert "present poses" not in pill(told, Choice(at_s=3.0))
    deformed = pill(told, Choice(at_s=3.0), 15.5, {"<hose", "belt"})
    assert "only the banner and the shape of &lt;hose, belt are current" in deformed
    past = pill(told, Choice(at_s=3.0), newest_s=15.5)
    assert 'data-state="past"' in past
    assert "looking back 12.5 s:" in past
    assert "live" not in past
    other = pill(told, Choice(at_s=3.0), 15.5, shown_s=3.5)
    assert "looking back 12.0 s, at the tick 0.5 s after that moment: only" in other
    gone = connection(news(frame_at_s=NOW - 2.0), NOW)
    assert "now stale: no tick for 2.0 s" in pill(gone, Choice(at_s=3.0), newest_s=15.5)


def test_what_others_named_is_no_html():
    odd = Pairs(
        (("<b>", "x"),), *(np.array([0.01]),) * 2, np.zeros((1, 2, 3)), np.zeros(1, np.int8),
        np.array([STOP], np.int8), np.zeros(1), np.zeros(1), ("",),
    )  # fmt: skip
    assert "<b>" not in banner(Frame(1.0, np.zeros((0, 7)), odd), SCENE, Choice(), LIVE)
