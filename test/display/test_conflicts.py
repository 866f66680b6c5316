"""Decisions of people about conflicts, and the file in which they are kept."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import NAMES, SCENE, frame, words

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.conflicts import LOOK_S, DecisionStore, decision_line, decision_now
from proximity_monitor.display.decisions import Decision, place
from proximity_monitor.display.decisions import alone as alone_in
from proximity_monitor.display.listing import listing
from proximity_monitor.display.pairs import table
from proximity_monitor.display.state import OVERLAPPING, STOP, WARN
from proximity_monitor.scene import bundled

PAIR = ("螺栓 M8×40", 'plate "A" - left')
SEEN = '{"version": 1, "conflicts": [{"a": "x", "b": "y", "status": "new", "camera_m": %s}]}'
FITS = Decision("accepted", "a press fit, 0.02 mm 干涉", "stop", 1e-5, 2e-5, "2026-01-02")


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text("")
    return replace(SCENE, path=str(path))


@pytest.fixture
def beside(tmp_path):
    return tmp_path / "cell.conflicts.json"


def following(scene, now_s=0.0):
    made = DecisionStore()
    made.follow(scene, now_s)
    return made


def test_a_decision_is_kept_beside_the_scene_and_known_to_the_next_display(scene, beside):
    one = following(scene)
    assert (one.all, one.problem, one.path) == ({}, "", beside)
    one.decide(PAIR, FITS)
    assert not one.is_written(PAIR)
    one.follow(scene, 0.0)
    assert one.is_written(PAIR[::-1])
    assert following(scene).all == {frozenset(PAIR): FITS}
    assert [path.name for path in beside.parent.iterdir() if path.name != "cell.yaml"] == [
        beside.name
    ]
    one.decide(PAIR[::-1], Decision())
    one.follow(scene, 0.0)
    assert following(scene).all == {}


def test_the_camera_of_who_decided_is_kept_in_the_file(scene, beside):
    camera = (0.1, -0.2, 0.3, 0.0, 0.0, 0.05)
    one, pairs = following(scene), frame(0.0).pairs
    one.decide(NAMES, decision_now(pairs, 0, "accepted", "", camera))
    one.decide(PAIR, decision_now(pairs, 0, "accepted", "", (*camera[:5], np.nan)))
    one.follow(scene, 0.0)
    kept = following(scene).all
    assert kept[frozenset(NAMES)].camera == camera
    assert kept[frozenset(PAIR)].camera is None


def test_what_others_wrote_in_the_file_stays_and_is_seen(scene, beside):
    one, two = following(scene), following(scene)
    one.decide(PAIR, FITS)
    one.follow(scene, 0.0)
    told = json.loads(beside.read_text(encoding="utf-8"))
    told["reviewer"] = "Zoë"
    told["conflicts"][0]["ticket"] = 17
    beside.write_text(json.dumps(told), encoding="utf-8")
    two.decide(NAMES, Decision("ignored", "no matter"))
    two.follow(scene, 0.0)
    after = json.loads(beside.read_text(encoding="utf-8"))
    assert after["reviewer"] == "Zoë"
    assert after["conflicts"][0] == told["conflicts"][0]
    assert len(one.all) == 1
    one.follow(scene, 2.0 * LOOK_S)
    assert one.all.keys() == two.all.keys() == {frozenset(PAIR), frozenset(NAMES)}


@pytest.mark.parametrize(
    "content",
    [
        "{",
        "[]",
        "[" * 100_000,
        '{"version": 2, "conflicts": []}',
        '{"version": 1, "conflicts": [{"a": "x", "b": "y", "status": "fine"}]}',
        '{"version": 1, "conflicts": [{"a": "x", "b": "y", "status": "new", "upper_m": NaN}]}',
        SEEN % "[0, 0, 1, 0, 0]",
        SEEN % "[0, 0, 1, 0, 0, 1]",
        SEEN % '"000001"',
        b"\xff\xfe{}",
        '{"version": 1, "conflicts": [{"a": "x", "b": "y", "status": "new", "state": "\\ud83d"}]}',
        '{"version": 1, "conflicts": [], "conflicts": []}',
    ],
    ids=["cut", "list", "deep", "old", "bad", "nan", "five", "eye", "text", "bytes", "half", "two"],
)
def test_a_file_that_cannot_be_read_is_named_and_left_and_nothing_is_lost(scene, beside, content):
    data = content if isinstance(content, bytes) else content.encode()
    beside.write_bytes(data)
    one = following(scene)
    assert str(beside) in one.problem
    one.decide(PAIR, FITS)
    one.follow(scene, 0.0)
    assert str(beside) in one.problem and "kept in memory" in one.problem
    assert beside.read_bytes() == data
    assert one.all == {frozenset(PAIR): FITS}
    beside.unlink()
    one.follow(scene, 2.0 * LOOK_S)
    assert one.problem == ""
    assert following(scene).all == {frozenset(PAIR): FITS}


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_lost(scene, tmp_path):
    folder = tmp_path / "no_folder"
    folder.write_text("")  # so nobody can write below it, not even root
    one = DecisionStore(str(folder / "file.json"))
    one.follow(scene, 0.0)
    one.decide(PAIR, FITS)
    one.follow(scene, 0.0)
    assert str(folder / "file.json") in one.problem
    other = replace(scene, name="other", path=str(tmp_path / "other.yaml"))
    one.follow(other, 1.0)
    assert one.all == {}
    folder.unlink()
    one.follow(scene, 9.0)
    assert one.problem == ""
    assert one.all == {frozenset(PAIR): FITS}
    assert (folder / "file.json").is_file()


def test_a_scene_without_a_place_leaves_the_file_of_the_one_before_alone(scene, beside):
    one = following(scene)
    circle = beside.with_name("circle.yaml")
    circle.symlink_to(circle)
    there = replace(scene, name="circle", path=str(circle))
    one.follow(there, 1.0)
    one.decide(PAIR, FITS)
    one.follow(there, 2.0)
    assert (one.path, beside.exists()) == (None, False)
    assert str(circle) in one.problem and "conflicts:=FILE" in one.problem
    nobody = DecisionStore("~nobody_at_all/x.json")
    nobody.follow(scene, 0.0)
    assert "~nobody_at_all/x.json" in nobody.problem


def test_what_was_decided_just_before_another_scene_came_is_written(scene, beside):
    one = following(scene)
    one.decide(PAIR, FITS)
    one.follow(replace(scene, name="other", path=str(beside.with_name("other.yaml"))), 0.0)
    assert following(scene).all == {frozenset(PAIR): FITS}


def test_no_other_display_writes_between_read_and_write(scene, beside):
    one = following(scene)
    one.decide(PAIR, FITS)
    with alone_in(beside):
        one.follow(scene, 0.0)
        assert f"{beside}: another display is writing to it" in one.problem
    one.follow(scene, 2.0 * LOOK_S)
    assert one.problem == ""
    assert following(scene).all == {frozenset(PAIR): FITS}


def test_what_others_wrote_in_a_decision_and_who_may_read_it_stay(scene, beside):
    entry = {"a": NAMES[0], "b": NAMES[1], "status": "new", "comment": "x", "ticket": "PM-17"}
    beside.write_text(json.dumps({"version": 1, "conflicts": [entry]}))
    beside.chmod(0o660)
    one = following(scene)
    for decision in (FITS, Decision()):
        one.decide(NAMES, decision)
        one.follow(scene, 0.0)
        (after,) = json.loads(beside.read_text())["conflicts"]
        assert (after["ticket"], after["status"]) == ("PM-17", decision.status)
    assert beside.stat().st_mode & 0o777 == 0o660


def test_bundled_scenes_have_theirs_in_a_person_s_own_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    path, problem = place(replace(SCENE, path=str(bundled("peg"))), "")
    assert (path, problem) == (
        tmp_path / "data" / "proximity_monitor" / "peg.conflicts.json",
        "",
    )
    there = following(replace(SCENE, path=str(bundled("peg"))))
    there.decide(PAIR, FITS)
    there.follow(replace(SCENE, path=str(bundled("peg"))), 0.0)
    assert path.is_file()


def test_a_scene_of_another_machine_has_no_place_but_that_which_is_given(tmp_path):
    far = replace(SCENE, path="/on/another/machine.yaml")
    one = following(far)
    one.decide(PAIR, FITS)
    one.follow(far, 0.0)
    assert "/on/another/machine.yaml is not on this machine" in one.problem
    assert one.all == {frozenset(PAIR): FITS}
    assert place(far, str(tmp_path / "x.json")) == (Path(tmp_path / "x.json"), "")


def test_a_pair_that_got_worse_since_it_was_accepted_says_so():
    pairs = frame(0.0, 0.05, WARN).pairs
    as_warn = decision_now(pairs, 0, "accepted", "")
    assert (as_warn.state, as_warn.upper) == ("warn", 0.05)
    assert decision_line(as_warn, "warn", 0.05, SCENE.unit) == "accepted at 50.000 mm"
    assert "worse now" in decision_line(as_warn, "stop", 0.01, SCENE.unit)
    assert "worse" not in decision_line(as_warn, "stale", 0.05, SCENE.unit)
    assert "worse" not in decision_line(as_warn._replace(status="new"), "stop", 0.01, SCENE.unit)
    pairs.lower[:] = pairs.upper[:] = np.nan
    assert decision_now(pairs, 0, "ignored", "").upper is None


def test_an_overlap_is_worse_than_a_touch_and_so_is_a_much_deeper_one():
    touch = Decision("accepted", "", "contact", -0.002, 0.0)
    assert not touch.outgrown("contact", 0.0)
    assert touch.outgrown("contact", -1e-4)
    assert not touch.outgrown("stale", -1e-4)
    deep = touch._replace(upper=-0.001)
    assert not deep.outgrown("contact", -0.0039)
    assert deep.outgrown("contact", -0.0041)
    assert not deep.outgrown("contact", np.nan)
    for unknown in (touch._replace(upper=None), deep._replace(lower=None)):
        assert not unknown.outgrown("contact", -1.0)
    assert "worse now" in decision_line(touch, "contact", -1e-4, SCENE.unit)
    pairs = frame(0.0, -1e-4, STOP).pairs
    pairs.status[:] = OVERLAPPING
    touching = {frozenset(NAMES): touch}
    assert "accepted at 0.000 mm as contact, and worse now" in table(
        pairs, SCENE, Choice(), touching
    )


def test_the_list_tells_and_filters_by_status_but_hides_no_conflict():
    pairs = frame(0.0, 0.01, STOP).pairs
    evil = {frozenset(NAMES): Decision("ignored", "<script>", "warn", 0.05, 0.05)}
    html = table(pairs, SCENE, Choice(), evil)
    assert "ignored at 50.000 mm as warn, and worse now: <script>" not in html
    assert "&lt;script&gt;" in html
    assert listing(pairs, SCENE, Choice(status="ignored"), evil).groups == [("", [0])]
    assert listing(pairs, SCENE, Choice(status="new"), evil).left_out == 1
    assert listing(pairs, SCENE, Choice(status="new")).groups == [("", [0])]


def test_the_panel_keeps_what_is_decided_about_the_highlighted_pair(alone):
    panel = alone.all._deciding
    alone.choice.pair = NAMES
    alone.tell(frame=frame(1.0))
    assert words(panel._note).startswith("● &lt;i&gt;a - b 300.000 mm")
    panel._status.value, panel._comment.value = "accepted", "as drawn"
    for callback in panel._keep._impl.update_cb:
        callback(None)
    alone.tell(frame=frame(2.0))
    assert "accepted at 300.000 mm: as drawn" in words(panel._note)
    assert "accepted at 300.000 mm: as drawn" in words(alone.all._table)
    alone.choice.pair = None
    alone.tell(frame=frame(3.0))
    assert (panel._status.value, panel._comment.value) == ("new", "")
    alone.choice.pair = NAMES
    alone.tell(frame=frame(4.0))
    assert (panel._status.value, panel._comment.value) == ("accepted", "as drawn")


def test_a_list_without_rows_says_why(alone):
    assert "no conflict is known so far" in words(alone.all._conflict_list._list)
    assert "no pair has changed its state yet" in words(alone.all._event_list._list)


def test_what_is_told_of_a_moment_that_is_over_is_not_called_now(alone):
    row = frame(1.0, 0.01, STOP)
    none = np.zeros(0, int)
    arrays = ("lower", "upper", "points", "status", "level", "age_s", "stamp_s")
    taken = {name: getattr(row.pairs, name)[none] for name in arrays}
    alone.tell(frame=replace(row, pairs=replace(row.pairs, names=(), silent=(), **taken)))
    alone.pages._shared.decisions.decide(NAMES, Decision("ignored", "", "warn", 0.05, 0.05))
    for stamp_s in (2.0, 3.0):
        alone.tell(frame=frame(stamp_s, 0.01, STOP))
    alone.choice.pair, note = NAMES, alone.all._deciding._note
    alone.tell()
    assert "worse now" in words(note) and "worse now" in words(alone.all._table)
    alone.choice.at_s = 2.0
    alone.tell()
    assert "worse then" in words(note) and "worse then" in words(alone.all._table)
    alone.choice.at_s = 1.0
    alone.tell()
    assert "; then beyond its range" in words(note)
    assert "now" not in words(note)


def press(panel):
    for callback in panel._keep._impl.update_cb:
        callback(None)


def test_what_another_browser_decided_is_not_overwritten_unseen(alone):
    panel, decisions = alone.all._deciding, alone.pages._shared.decisions
    alone.choice.pair = NAMES
    alone.tell(frame=frame(1.0))
    decisions.decide(NAMES, FITS)
    alone.tell(frame=frame(2.0))
    assert (panel._status.value, panel._comment.value) == FITS[:2], "nobody touched them"
    panel._comment.value = "no, it does not fit"
    decisions.decide(NAMES, FITS._replace(status="ignored"))
    alone.tell(frame=frame(3.0))
    assert panel._comment.value == "no, it does not fit"
    press(panel)
    alone.tell(frame=frame(4.0))
    assert "somebody else chose ignored: a press fit" in words(panel._note)
    assert decisions.all[frozenset(NAMES)].comment == FITS.comment
    press(panel)
    alone.tell(frame=frame(5.0))
    assert "somebody else" not in words(panel._note)
    assert decisions.all[frozenset(NAMES)][:2] == ("accepted", "no, it does not fit")
