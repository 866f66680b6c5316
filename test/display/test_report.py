"""The report of conflicts: which pairs are in it, and what it says, without a browser."""

import csv
import io
import re
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

import ticks
from page_alone import NAMES, PARTS, SCENE, frame, words
from viser.infra import StateSerializer

from proximity_monitor.display import replay, report
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.conflict_list import ConflictList
from proximity_monitor.display.conflicts import DecisionStore
from proximity_monitor.display.decisions import Decision
from proximity_monitor.display.events import Events
from proximity_monitor.display.export import csv_of, events_csv, pairs_csv
from proximity_monitor.display.found import conflicts, find, moment
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.portraits import Sitting, _aimed, _close
from proximity_monitor.display.report import conflicts_csv, report_html
from proximity_monitor.display.report_files import ReportFiles
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import OVERLAPPING, STALE, STOP, WARN

EVIL = Decision("accepted", "<script>alert(1)</script>", "stop", 0.01, 0.01, "2026-01-02T03:04:05")
FITS = Decision("accepted", "a press fit", "stop", 0.008, 0.01, "2026-01-02T03:04:05")


def of(*session):
    return conflicts(find(SCENE, *session), *session)


def told(*ticks):
    session, events = Session(), Events()
    for stamp_s, (clearance, level) in enumerate(ticks):
        each = frame(1e9 + stamp_s, clearance, level)
        session.add(each, keep=events.note(each, SCENE))
    return each, session, events


def test_what_was_near_for_one_tick_is_a_conflict_with_its_own_numbers():
    _, session, events = told((0.3, 0), (0.05, WARN), (0.0123456, STOP), (0.3, 0))
    (found,) = of(session, events, {})
    assert (found.pair, found.state, found.decision.status) == (NAMES, "stop", "new")
    assert (found.worst.lower, found.worst.stamp_s) == (0.0123456, 1e9 + 2)
    assert [event.lower for event in found.events] == [0.05, 0.0123456, 0.3]
    picture = found.worst.frame(NAMES)
    assert picture.pairs.places == {NAMES: 0}
    assert picture.pairs.level[0] == STOP


def test_the_newest_changes_of_state_have_pictures_the_worst_conflicts_first(monkeypatch):
    monkeypatch.setattr(report, "PICTURED", 3)
    _, session, events = told(*((0.3, 0), (0.05, WARN)) * 4)
    found = of(session, events, {})
    assert [event.stamp_s - 1e9 for event in report.pictured(found)] == [5, 6, 7]
    monkeypatch.setattr(report, "EVENT_PICTURES", 2)
    assert len(report.pictured(found)) == 2


def test_a_report_tells_how_many_moments_it_has_taken_and_is_made_once_at_a_time(server):
    last, session, events = told((0.3, 0), (0.0123456, STOP), (0.3, 0))
    shared = SimpleNamespace(session=session, events=events, decisions=DecisionStore())
    said = []

    def taken(*_):
        said.append((words(made._progress), made._button.disabled))
        return np.zeros((2, 2, 3), np.uint8)

    camera = SimpleNamespace(take=taken, take_with_gap=lambda *_: [taken()])
    made = ReportFiles(server.gui, shared, camera, lambda: None, lambda: None)
    shown = SimpleNamespace(scene=SCENE, newest=last)
    assert made._report(shown, None).count(b"<img") == 3
    moments = [f"taking pictures: moment {i} of 3" for i in (1, 2, 3)]
    assert said == [(moment, True) for moment in moments]
    assert (words(made._progress), made._button.disabled) == ("", False)
    camera.take_with_gap = lambda *_: 1 / 0
    with pytest.raises(ZeroDivisionError):
        made._report(shown, None)
    assert (words(made._progress), made._button.disabled) == ("", False)


def test_what_is_clear_or_stale_is_none_unless_somebody_decided_about_it():
    _, session, events = told((0.3, 0), (0.3, STALE), (0.3, 0))
    assert of(session, events, {}) == []
    (found,) = of(session, events, {frozenset(NAMES): EVIL})
    assert (found.state, found.decision) == ("clear", EVIL)


def test_the_report_holds_numbers_words_and_picture_and_no_html_of_others():
    last, session, events = told((0.3, 0), (0.0123456, STOP), (0.3, 0))
    found = of(session, events, {frozenset(NAMES): EVIL})
    html = report_html(found, {NAMES: [b"abc", b"near"]}, SCENE, last, session.span_s, {1: b"then"})
    for expected in (
        "&lt;i&gt;a - b", "lower bound 12.346 mm, upper bound 12.346 mm", "accepted", "■ STOP",
        "&lt;script&gt;", "data:image/png;base64,YWJj",
        "data:image/png;base64,dGhlbg==", "data:image/png;base64,bmVhcg==",
        "a section through the gap of &lt;i&gt;a - b then", "1.00 s (2001-09-09 01:46:41.000 UTC)",
        "warn 100.000 mm, stop 20.000 mm", "default-src 'none'",
    ):  # fmt: skip
        assert expected in html, expected
    assert "<script" not in html and "<i>" not in html
    assert "have no picture" not in html
    assert "1 pair is watched, 1 conflict found" in html
    assert "1 has no picture." in report_html(found, {}, SCENE, last, session.span_s, {})
    (row,) = csv.DictReader(io.StringIO(conflicts_csv(found, SCENE, last, session.span_s)))
    assert (row["a"], row["b"]) == NAMES
    assert (row["decided"], row["comment"]) == (EVIL.status, EVIL.comment)
    assert (row["decided_at"], row["decided_state"]) == (EVIL.decided, EVIL.state)
    assert [float(row[f"decided_{each} [mm]"]) for each in ("lower", "upper")] == [10.0, 10.0]
    assert float(row["min_lower [mm]"]) == pytest.approx(12.3456)
    assert (row["worst_state"], row["state"], row["events"]) == ("stop", "clear", "2")


def between(stamp_s, lower, upper, **given):
    """Return a tick at which only bounds are known."""
    tick = frame(1e9 + stamp_s, lower)
    columns = {name: np.full(1, value, np.int8) for name, value in given.items()}
    return replace(tick, pairs=replace(tick.pairs, upper=np.array([upper]), **columns))


def noted(*given):
    session, events = Session(), Events()
    for tick in given:
        session.add(tick, keep=events.note(tick, SCENE))
    return given[-1], session, events


def listed(session, events):
    """Return the page's list of conflicts as text."""
    page = SimpleNamespace(content="")
    gui = SimpleNamespace(add_folder=lambda _: nullcontext(), add_html=lambda _: page)
    shared = SimpleNamespace(session=session, events=events, decisions=DecisionStore())
    ConflictList(gui, shared, Choice()).show(SCENE, 0.0)
    return words(page)


def test_the_session_s_least_lower_bound_is_told_with_the_least_upper_bound():
    last, session, events = noted(
        between(0, -0.225, 0.03, level=STOP), between(1, 0.005, 0.01, level=STOP),
        between(2, -0.5, 0.01, level=STALE), between(3, 0.3, 0.3),
    )  # fmt: skip
    assert session.lowest(NAMES) == session.lowest() == -0.225
    assert np.isnan([session.lowest(("a", "z")), session.lowest(ignored={NAMES})]).all()
    assert "-225.000 … 10.000 mm 1.0 s" in listed(session, events)
    found = of(session, events, {})
    html = report_html(found, {}, SCENE, last, session.span_s, {})
    each = "lower bound 5.000 mm, upper bound 10.000 mm; at least -225.000 mm at every tick"
    assert each in html
    text = replay.report(SCENE, session, last, "")
    assert "<td class=pm-num>-225.000 … 10.000 mm</td>" in text
    (row,) = csv.DictReader(io.StringIO(conflicts_csv(found, SCENE, last, session.span_s)))
    bounds = [float(row[f"{each} [mm]"]) for each in ("min_lower", "min_upper")]
    assert bounds == pytest.approx([5.0, 10.0])
    assert float(row["session_min_lower [mm]"]) == pytest.approx(-225.0)
    (row,) = csv.DictReader(io.StringIO(pairs_csv(last, SCENE, session, {})))
    bounds = [float(row[f"{each} [mm]"]) for each in ("session_min_lower", "session_min")]
    assert bounds == pytest.approx([-225.0, 10.0])
    session.forget_worst()
    assert np.isnan(session.lowest(NAMES))


@pytest.mark.parametrize(
    ("lower", "upper", "status", "word"),
    [
        (0.02, 0.02, 0, "stop"), (0.0199, 0.0200000005, 0, "stop?"),
        (-0.02, -0.01, OVERLAPPING, "overlap"),
    ],
)  # fmt: skip
def test_the_tables_of_conflicts_and_of_events_tell_the_same_state(lower, upper, status, word):
    last, session, events = noted(
        between(0, 0.3, 0.3), between(1, lower, upper, level=STOP, status=status)
    )
    found = of(session, events, {})
    (row,) = csv.DictReader(io.StringIO(conflicts_csv(found, SCENE, last, session.span_s)))
    (event,) = csv.DictReader(io.StringIO(events_csv(events, session, SCENE, {})))
    assert row["worst_state"] == row["state"] == event["after"] == word
    assert f" {word} " in f" {listed(session, events).lower()} "


def test_one_number_is_shown_if_both_bounds_print_alike_and_an_overlap_is_so_deep():
    assert " 12.346 mm 0.0 s" in listed(*told((0.0123456, STOP))[1:])
    overlap = between(0, -0.0005, -0.000499, level=STOP, status=OVERLAPPING)
    assert " 0.499 … 0.500 mm deep 0.0 s" in listed(*noted(overlap)[1:])


def status_of(*ticks, **changes):
    """Return the row "status" of a pair that was accepted and then had these ticks."""
    last, session, events = told(*ticks)
    found = of(session, events, {frozenset(NAMES): FITS._replace(**changes)})
    html = report_html(found, {}, SCENE, last, session.span_s, {})
    return re.search("<th>status</th><td>(.*?)</td>", html)[1]


def test_what_was_accepted_stands_beside_what_the_session_had():
    when = "(decided 2026-01-02T03:04:05): a press fit"
    at_stop, clear, overlap = (0.01, STOP), (0.3, 0), (-0.01, STOP)
    assert status_of(at_stop) == f"accepted at 8.000 … 10.000 mm as stop {when}"
    assert status_of(at_stop, lower=0.01) == f"accepted at 10.000 mm as stop {when}"
    worse = "accepted at 8.000 … 10.000 mm as stop, and worse now "
    assert status_of(clear, overlap) == worse + when
    was_worse = "accepted at 8.000 … 10.000 mm as stop, and was worse in this session "
    assert status_of(clear, overlap, clear) == was_worse + when
    assert status_of(clear, overlap, (0.3, STALE)) == was_worse + when
    as_overlap = status_of(overlap, state="contact", lower=-0.02, upper=-0.01)
    assert as_overlap == f"accepted at -20.000 … -10.000 mm as contact {when}"


def test_what_is_not_known_of_a_decision_is_left_out():
    at_stop = (0.01, STOP)
    assert status_of(at_stop, state="", lower=None) == (
        "accepted at 10.000 mm (decided 2026-01-02T03:04:05): a press fit"
    )
    bare = {"state": "", "lower": None, "upper": None, "decided": "", "comment": ""}
    assert status_of(at_stop, **bare) == "accepted"
    assert status_of(at_stop, **bare | {"state": "<b>"}) == "accepted as &lt;b&gt;"
    # Nobody accepted a new conflict, so it cannot have become worse.
    assert status_of(at_stop, status="new", state="clear", decided="") == "new: a press fit"


@pytest.mark.parametrize(
    ("pairs", "expected"), [(0, "0 pairs are"), (1, "1 pair is"), (2, "2 pairs are")]
)
def test_the_report_counts_pairs_conflicts_and_pictures(pairs, expected):
    last, session, events = told((0.3, 0), (0.05, WARN))
    (one,) = of(session, events, {})
    for found, rest in (
        ([], "0 conflicts found"), ([one], "1 conflict found"), ([one, one], "2 conflicts found")
    ):  # fmt: skip
        html = report_html(found, {}, replace(SCENE, pairs=pairs), last, session.span_s, {})
        assert f"{expected} watched, {rest}" in html
        assert ("2 have no picture." in html) == (len(found) == 2)
        assert ("1 has no picture." in html) == (len(found) == 1)


def test_the_report_counts_the_changes_that_it_leaves_out(monkeypatch):
    last, session, events = told((0.3, 0), (0.05, WARN), (0.3, 0), (0.05, WARN))
    found = of(session, events, {})
    for most, expected in (
        (2, "1 older change is left out."),
        (1, "2 older changes are left out."),
    ):
        monkeypatch.setattr(report, "EVENTS", most)
        assert expected in report_html(found, {}, SCENE, last, session.span_s, {})


def test_the_other_tables_tell_bounds_and_decisions_too():
    last, session, events = told((0.3, 0), (0.0123456, STOP))
    decisions = {frozenset(NAMES): EVIL}
    for text in (
        events_csv(events, session, SCENE, decisions),
        pairs_csv(last, SCENE, session, decisions),
    ):
        (row,) = csv.DictReader(io.StringIO(text))
        assert float(row["lower [mm]"]) == pytest.approx(12.3456)
        assert (row["decided"], row["comment"]) == (EVIL.status, EVIL.comment)


def test_a_simulation_s_moments_have_no_date():
    assert moment(12.5, 10.0) == "2.50 s"


def test_the_smallest_clearance_keeps_nothing_else_of_its_tick():
    tick, session = frame(0.0), Session()
    session.add(tick)
    points = session.worst(NAMES)[1].points
    assert points.base is None
    assert not np.shares_memory(points, tick.pairs.points)


@pytest.mark.parametrize("position", [(0, 0, 9), (0, 0, -9), (3, 2, 1), (5, 0, 0)])
def test_a_picture_looks_at_the_gap_across_it(position):
    ends = np.array([(0.1, 0.2, 0.3), (0.1, 0.2, 0.5)])
    for turned in (ends, ends[:, [2, 1, 0]], np.repeat(ends[:1], 2, axis=0)):
        view = _aimed(turned, np.array(position, float), 1.0, (400, 300))
        np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-9)
        places, depth = view.project(turned)
        assert (depth > 0.0).all()
        np.testing.assert_allclose(places.mean(axis=0), (200, 150), atol=1e-6)


@pytest.mark.parametrize("across", [0.0, 1e-9, 2e-4, 0.03])
def test_a_small_gap_is_seen_from_the_same_place_as_large_as_the_picture_is_sharp(across):
    ends = np.array([(0.1, 0.2, 0.3), (0.1, 0.2, 0.3 + across)])
    view = _aimed(ends, np.array([0.0, 3.0, 1.0]), 1.0, (400, 300))
    close = _close(Sitting(None, NAMES, view), ends, 0.04)
    shown = np.linalg.norm(np.diff(close.view.project(ends)[0], axis=0))
    assert shown == pytest.approx({0.0: 0.0, 1e-9: 0.006, 2e-4: 120.0, 0.03: 120.0}[across])
    np.testing.assert_allclose((ends - close.cut.middle) @ close.cut.normal, 0.0, atol=1e-12)
    assert (view.position - close.cut.middle) @ close.cut.normal > 0.5
    np.testing.assert_array_equal(close.view.position, view.position)


def test_a_large_gap_has_no_second_picture():
    ends = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.5)])
    view = _aimed(ends, np.array([0.0, 3.0, 1.0]), 1.0, (960, 600))
    assert _close(Sitting(None, NAMES, view), ends, 0.04) is None


def test_a_replay_s_table_has_pairs_that_are_not_listed_at_the_end():
    _, session, _ = told((0.01, STOP))
    gone = replace(frame(1e9 + 60.0), pairs=ticks.pairs([], [], names=()))
    session.add(gone)
    text = re.sub("<[^>]*>", " ", replay.report(SCENE, session, gone, ""))
    assert re.search(r"i&gt;a - b\s+10.000 mm\s+0.0 s\s+beyond its range\s+● clear", text)


def test_a_replay_ends_with_the_session_and_waits_for_no_clock(monkeypatch):
    monkeypatch.setattr(replay, "FRAMES", 2)
    slept, shown = [], []
    monkeypatch.setattr(StateSerializer, "insert_sleep", lambda _, pause_s: slept.append(pause_s))
    monkeypatch.setattr(Parts, "show", lambda _, frame, *rest: shown.append(frame.stamp_s))
    session = Session()
    for stamp_s in (0.0, 1.0, 2.0, 3000.0, 3000.01):
        session.add(frame(1e9 + stamp_s))
    document = replay.replay_html(SCENE, PARTS, session, Choice(), np.eye(3)[:2])
    assert [stamp_s - 1e9 for stamp_s in shown] == pytest.approx([0.0, 2.0, 3000.01])
    assert slept == [2.0, 10.0, 0.0]
    assert "plays 2 of 4 kept ticks, pauses cut to 10 s" in document


@pytest.mark.parametrize("text", ["one\rtwo", "one\r\ntwo", 'a "b", c', "\ud7ff"])
def test_every_text_comes_back_from_a_table(text):
    table = csv_of(["a", "b"], [["x", text], ["y", "z"]])
    assert list(csv.reader(io.StringIO(table, newline="")))[1:] == [["x", text], ["y", "z"]]
