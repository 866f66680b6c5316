"""What the page says of how current it is, and which pair it warns of."""

import re

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


def frame(level=(0, 0, 0), status=(0, 0, 0), silent=("", "", ""), stamps=(9.5, 9.0, 8.0)):
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
        ({}, ConnectionState.LIVE, "every number"),
        ({"frame_at_s": NOW - 2.0}, ConnectionState.STALE, "no tick for 2.0 s: paused"),
        (
            {"frame": frame(status=(BOUNDED, BOUNDED, 0))},
            ConnectionState.COMPUTING,
            "2 pairs are not exact",
        ),
        ({"parts": None}, ConnectionState.COMPUTING, "the meshes"),
        ({"frame": None, "frame_at_s": NEVER}, ConnectionState.COMPUTING, "its first tick"),
        (
            {"frame": None, "frame_at_s": NEVER, "health_at_s": NEVER},
            ConnectionState.COMPUTING,
            "prepares its search",
        ),
        (
            {"frame": None, "frame_at_s": NEVER, "health_at_s": NEVER, "present": False},
            ConnectionState.DISCONNECTED,
            "waiting for the monitor",
        ),
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0},
            ConnectionState.STALE,
            "no word from the monitor for 9 s",
        ),
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0, "present": False},
            ConnectionState.DISCONNECTED,
            "the monitor is gone for 8 s",
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
    silent = ("", "no recent pose of c", "no recent pose of b and c")
    told = connection(news(frame=frame(level=(0, STALE, STALE), silent=silent)), NOW)
    assert told.state is ConnectionState.STALE
    # c by the pair in which it alone is silent; of b no more is known than of the two.
    assert told.text == "no recent pose: c for 1.0 s, b for 2.0 s"


def test_a_body_that_never_had_a_pose_is_named():
    silent = ("", "no pose yet of c", "")
    stamps = (9.5, np.nan, 9.0)
    told = connection(news(frame=frame((0, STALE, 0), silent=silent, stamps=stamps)), NOW)
    assert told.text == "no recent pose: c never given"


LIVE = Connection(ConnectionState.LIVE, "")


def words(html):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", html)).strip()


def test_the_banner_names_the_worst_pair_and_its_threshold():
    told = banner(frame(level=(WARN, 0, STOP)), SCENE, Choice(), LIVE)
    assert words(told) == "■ STOP b - c: 10.000 mm, stop at 20.000 mm + 1 more"
    assert "role=alert" in told


def test_contact_comes_before_all_else():
    wrong = frame(level=(STOP, 0, STOP), status=(INTERSECTING, 0, 0))
    told = banner(wrong, SCENE, Choice(), LIVE)
    assert words(told).startswith("✖ CONTACT a - b")


def test_ignored_pairs_raise_no_banner():
    hidden = Choice(ignored=frozenset({("b", "c")}))
    told = banner(frame(level=(0, 0, STOP)), SCENE, hidden, LIVE)
    assert words(told) == "● clear all but 1 hidden of 3 pairs"
    assert "role=status" in told
    # Nor do they where they are stale: the tick is of now all the same.
    stale = news(frame=frame((0, 0, STALE), silent=("", "", "no recent pose of c")))
    told = banner(stale.frame, SCENE, hidden, connection(stale, NOW))
    assert words(told) == "● clear all but 1 hidden of 3 pairs"


@pytest.mark.parametrize(
    "changes, text",
    [
        (
            {"frame_at_s": NOW - 9.0, "health_at_s": NOW - 8.0, "present": False},
            "the monitor is gone for 8 s",
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
    assert "every number is of the present poses" in pill(told, Choice())
    assert "looking back" in pill(told, Choice(at_s=3.0))
    assert "present poses" not in pill(told, Choice(at_s=3.0))
    assert 'data-state="live"' in pill(told, Choice(at_s=3.0))


def test_what_others_named_is_no_html():
    odd = Pairs(
        (("<b>", "x"),), *(np.array([0.01]),) * 2, np.zeros((1, 2, 3)), np.zeros(1, np.int8),
        np.array([STOP], np.int8), np.zeros(1), np.zeros(1), ("",),
    )  # fmt: skip
    assert "<b>" not in banner(Frame(1.0, np.zeros((0, 7)), odd), SCENE, Choice(), LIVE)
