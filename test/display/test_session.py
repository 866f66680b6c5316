"""What the page keeps of a session: its ticks, its smallest clearances, its curves."""

from dataclasses import replace

import numpy as np
import pytest
from ticks import frame

from proximity_monitor.display import session as sessions
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import STALE, Frame, Pairs


def test_the_session_keeps_ten_ticks_a_second_and_every_worst():
    session = Session()
    for i in range(1000):
        lower = 0.5 if i != 777 else 0.001
        session.add(frame(i * 0.01, [1.0, lower]))
    assert len(session.frames) == pytest.approx(100, abs=2)
    assert session.span_s == (0.0, pytest.approx(9.9, abs=0.1))
    name, worst = session.worst()
    assert (name, worst.upper, worst.stamp_s) == (("a", "c"), 0.001, 777 * 0.01)
    assert (worst.poses == 777 * 0.01).all()
    assert session.worst(("a", "b"))[1].upper == 1.0
    assert session.worst(ignored={("a", "c")})[0] == ("a", "b")
    assert session.at(5.0).stamp_s == pytest.approx(5.0, abs=0.1)
    assert session.at(99.0) is session.frames[-1]


def test_the_smallest_clearances_of_pairs_that_come_and_go_are_kept():
    session = Session()
    full = frame(0.0, [0.3, 0.2])
    session.add(full)
    row = [1]
    alone = Pairs(
        (full.pairs.names[1],), *(getattr(full.pairs, name)[row] for name in (
            "lower", "upper", "points", "status", "level", "age_s", "stamp_s")), ("",),
    )  # fmt: skip
    nearer = replace(alone, lower=np.array([0.05]), upper=np.array([0.1]))
    session.add(Frame(1.0, np.full((2, 7), 1.0), nearer))
    session.add(frame(2.0, [0.25, 0.4]))
    found = [session.worst(name)[1] for name in full.pairs.names]
    found = [(each.lower, each.upper, each.stamp_s) for each in found]
    assert found == [(0.25, 0.25, 2.0), (0.05, 0.1, 1.0)]
    session.forget_worst()
    assert session.worst() is None
    session.add(frame(3.0, [0.25, np.nan]))
    assert session.worst(("a", "b"))[1].upper == 0.25
    assert session.worst(("a", "c")) is None


def test_a_stale_pair_is_no_worst():
    session = Session()
    session.add(frame(0.0, [0.1, 0.1], level=STALE))
    assert session.worst() is None


def test_a_clock_that_goes_back_begins_a_new_session():
    session = Session()
    session.add(frame(10.0, [0.1, 0.1]))
    session.add(frame(2.0, [0.3, 0.3]))
    assert [each.stamp_s for each in session.frames] == [2.0]
    assert session.worst()[1].upper == 0.3


def test_the_series_is_of_a_pair_or_of_the_nearest_and_keeps_each_dip():
    session = Session()
    for i in range(3000):
        session.add(frame(i * 0.1, [0.2 if i != 1234 else 0.01, 0.3], [0.4, 0.5]))
    stamps, lower, upper = session.series()
    assert len(stamps) <= 600
    assert lower.min() == 0.01
    assert (upper == 0.4).all()
    assert (session.series(("a", "c"))[1] == 0.3).all()
    assert (session.series(ignored={("a", "b")})[1] == 0.3).all()
    assert np.isnan(session.series(("x", "y"))[1]).all()


def test_the_series_goes_through_the_session_only_for_another_choice(monkeypatch):
    looked = []
    bounds = sessions._bounds
    monkeypatch.setattr(sessions, "_bounds", lambda *given: looked.append(given) or bounds(*given))
    session = Session()
    for i in range(100):
        session.add(frame(float(i), [0.2, 0.3]))
        session.series(("a", "c"))
    assert len(looked) < 110
    stamps, lower, _ = session.series(("a", "c"))
    assert stamps.tolist() == list(range(100))
    assert (lower == 0.3).all()


def test_a_session_that_begins_anew_or_forgets_has_no_older_curve(monkeypatch):
    monkeypatch.setattr(sessions, "BYTES", 20_000)
    session = Session()
    for i in range(100):
        session.add(frame(float(i), [0.2, 0.3]))
    assert session.series()[0].tolist() == [each.stamp_s for each in session.frames]
    session.add(frame(2.0, [0.4, 0.5]))
    assert [part.tolist() for part in session.series()] == [[2.0], [0.4], [0.4]]


def test_the_whole_session_is_kept_thinner_when_memory_is_full(monkeypatch):
    monkeypatch.setattr(sessions, "BYTES", 100_000)
    session = Session()
    for i in range(500):
        assert (session.thinned_s is None) is (len(session.frames) == i)
        session.add(frame(0.125 * i, [0.2, 0.3]))
    kept = [each.stamp_s for each in session.frames]
    assert 10 < len(kept) < 50
    assert kept[0] < 5.0 and kept[-1] > 55.0
    assert max(np.diff(kept)) < 2.0 * session.thinned_s
    session.clear()
    assert session.thinned_s is None


def test_ticks_that_are_kept_for_their_own_sake_leave_room_for_the_others(monkeypatch):
    monkeypatch.setattr(sessions, "BYTES", 100_000)
    session = Session()
    for i in range(2000):  # in five seconds
        session.add(frame(i / 400.0, [0.2, 0.3]), keep=True)
    for i in range(100):
        session.add(frame(6.0 + i, [0.2, 0.3]))
    stamps = [each.stamp_s for each in session.frames]
    assert session.thinned_s < 10.0
    assert stamps[0] == 0.0 and stamps[-1] > 95.0
    assert max(np.diff(stamps)) < 2.0 * session.thinned_s


def test_a_thinned_session_says_how_rare_its_ticks_are_where_few_came(monkeypatch):
    monkeypatch.setattr(sessions, "BYTES", 100_000)
    session = Session()
    for i in range(200):
        session.add(frame(5.0 * i, [0.2, 0.3]))
    stamps = [each.stamp_s for each in session.frames]
    assert session.thinned_s == np.median(np.diff(stamps)) >= 10.0
