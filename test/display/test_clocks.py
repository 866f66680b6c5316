"""A session ends when its clock jumps, and so does everything that pages show of it."""

import numpy as np
import pytest
import ticks
from page_alone import NAMES, frame, page_of, words
from raw_browser import RawBrowser

from proximity_monitor.display import serving
from proximity_monitor.display.session import LEAP_S, Session
from proximity_monitor.display.state import STALE, STOP


@pytest.fixture
def page(monkeypatch, tmp_path):
    server = serving.serve("127.0.0.1", 0, "test")
    browser = RawBrowser(server)
    yield page_of(server, browser.client, monkeypatch, tmp_path / "conflicts.json")
    browser.close()
    serving.stop(server)


def test_what_a_page_shows_of_an_older_session_ends_with_it(page):
    page.tell(frame=frame(100.0))
    page.tell(frame=frame(101.0, 0.01, STOP))
    (first,) = page.events.all
    page.all._on_word(f"event:{first.number}")
    assert (page.choice.at_s, page.choice.pair) == (101.0, NAMES)
    page.tell(frame=frame(2.0))
    assert page.choice.at_s is page.choice.seen is None
    assert page.all._shown.frame.stamp_s == 2.0
    # The browser may still show the first event's row: a press on it goes to no other event.
    page.tell(frame=frame(3.0, 0.01, STOP))
    (second,) = page.events.all
    page.all._on_word(f"event:{first.number}")
    assert page.choice.at_s is None
    assert (page.events.at(second.number), page.events.lost) == (second, 0)


def test_a_moment_whose_tick_was_not_kept_is_said_to_be_another_tick_s(page):
    page.tell(frame=frame(100.0))
    page.tell(frame=frame(101.0, 0.01, STOP))
    page.tell(frame=frame(101.5))
    (event, _) = page.events.all
    page.session._frames = [each for each in page.session.frames if each.stamp_s != 101.0]
    page.all._on_word(f"event:{event.number}")
    page.tell(frame=frame(102.0))
    assert "looking back 1.0 s: only" in words(page.all._pill)  # its pair and poses are known
    page.choice.pair = None
    page.tell(frame=frame(102.0))
    assert page.all._shown.frame.stamp_s == 101.5
    assert "looking back 0.5 s, at the tick 0.5 s after that moment: only" in words(page.all._pill)


@pytest.mark.parametrize("first, then", [(0.0, 30.0), (0.0, 1.7e9), (50.0, 51.0 + LEAP_S)])
def test_a_tick_of_another_clock_begins_a_new_session(first, then):
    session = Session()
    session.add(ticks.frame(first, [0.1, 0.1]))
    session.add(ticks.frame(then, [0.3, 0.3]))
    assert session.span_s == (then, then)
    session.add(ticks.frame(then + 3600.0, [0.3, 0.3]))
    assert session.span_s == (then, then + 3600.0)


def test_ten_ticks_a_second_are_all_kept_though_some_come_early():
    session = Session()
    for i in range(100):
        session.add(ticks.frame(1.7e9 + 0.1 * i + 0.001 * (i % 3), [0.2, 0.3]))
    assert len(session.frames) == 100


def test_the_smallest_clearance_of_all_is_not_known_while_a_counted_pair_is_stale():
    session = Session()
    session.add(ticks.frame(0.0, [0.2, 0.3]))
    session.add(ticks.frame(1.0, [0.2, 0.01], level=np.array([0, STALE])))
    assert np.isnan(session.series()[1]).tolist() == [False, True]
    assert session.series(ignored={("a", "c")})[1].tolist() == [0.2, 0.2]


def test_a_gap_that_is_shorter_than_a_point_of_the_plot_is_seen_and_hides_no_dip():
    session = Session()
    for i in range(6000):
        level = STALE if 3003 <= i < 3008 else 0
        session.add(ticks.frame(float(i), [0.01 if i == 3001 else 0.2, 0.3], level=level))
    stamps, lower, _ = session.series(("a", "b"))
    assert np.isnan(lower).sum() == 1
    assert np.nanmin(lower) == 0.01
    assert (np.diff(stamps) > 0.0).all()


def test_the_times_of_a_thinned_session_count_from_its_first_tick(monkeypatch):
    monkeypatch.setattr("proximity_monitor.display.session.BYTES", 100_000)
    session = Session()
    for i in range(500):
        session.add(ticks.frame(100.0 + i, [0.2, 0.3]))
    assert session.thinned_s is not None
    assert session.span_s[0] == 100.0


def test_poses_of_the_smallest_clearances_stay_bounded_and_those_of_the_nearest_known(monkeypatch):
    monkeypatch.setattr("proximity_monitor.display.smallest.BYTES", 100 * 2 * 7 * 8)
    names = tuple(("a", f"p{i}") for i in range(400))
    session = Session()
    lower = np.full(len(names), 9.0)
    for i in range(len(names)):
        lower[i] = 0.001 * (1 + (i * 7) % 400)  # each at its own tick
        session.add(ticks.frame(1.0 + i, lower.copy(), names=names))
    worst = [session.worst(name)[1] for name in names]
    known = [each for each in worst if each.placed]
    assert 50 <= len({id(each.poses) for each in known}) <= 100
    assert all(each.placed for each in sorted(worst, key=lambda each: each.upper)[:50])
    assert all((each.poses == each.stamp_s).all() for each in known)
    assert all(each.upper < 9.0 and not each.poses.any() for each in worst if not each.placed)
