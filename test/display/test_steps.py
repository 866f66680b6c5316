"""The page's own steps, on a server without a real browser: their order, and what they keep."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray
from page_alone import CORNERS, HERE, NAMES, SCENE, THERE, drag, frame, words
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from proximity_monitor.display import move
from proximity_monitor.display import page as pages
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.player_panel import ENDED, NONE
from proximity_monitor.display.received import Part
from proximity_monitor.display.settings import ASK_S, HAND_S, SettingsPanel
from proximity_monitor.display.state import STALE, STOP, Playing, Thresholds, Unit
from proximity_monitor.display.tried import Tried
from proximity_monitor.ros.pairs_message import PairsMessage, checksum
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairState, PairStatus, as_arrays

PERSON = SimpleNamespace(client=object())


@pytest.fixture
def page(alone):
    return alone


def test_the_banner_is_of_now_while_somebody_looks_back(page):
    page.choice.at_s = 0.0
    page.tell(frame=frame(1.0, 0.01, STOP))
    assert words(page.all._banner).startswith("■ STOP")
    assert "looking back" in words(page.all._pill)
    assert "clear" in words(page.all._table)
    assert words(page.all._banner).startswith("■ STOP now: &lt;i&gt;a - b: 10.000 mm")


def test_a_list_that_is_shown_already_keeps_no_newer_one_waiting(page, monkeypatch):
    monkeypatch.setattr(pages, "TABLE_S", 1e6)
    monkeypatch.setattr(pages, "LONGEST_S", 1e6)
    page.pages.step()  # between two ticks: nothing is new
    page.tell(frame=frame(1.0, 0.25))
    assert "250.000 mm" in words(page.all._table)
    page.tell(frame=frame(2.0, 0.2))  # this one has to wait
    assert "250.000 mm" in words(page.all._table)


def test_a_tick_that_is_not_shown_still_counts(page):
    inbox = page.pages._inbox
    inbox.tell(scene=replace(SCENE, checksum=checksum(NAMES)))
    levels = [Level.STOP, Level.CLEAR, Level.CLEAR]
    for i, (lower, level) in enumerate(zip((0.01, 0.2, 0.3), levels, strict=True)):
        state = PairState(
            *NAMES, lower, lower, np.zeros(3), np.zeros(3), PairStatus.EXACT, 0.0, (), 0.1, 0.1
        )
        told = {"stamp": Time(sec=i + 1), "pose_stamp_ns": {}.get, "silent": {}}
        made = PairsMessage(NAMES, "world").serialised(as_arrays([state]), {0: level}, **told)
        header = Header(stamp=Time(sec=i + 1))
        inbox.put_pairs(made)
        inbox.put_poses(serialize_message(PoseArray(header=header, poses=[Pose(), Pose()])))
    page.pages.step()
    assert "300.000 mm" in words(page.all._table)
    assert page.session.worst(NAMES)[1].upper == 0.01
    assert [event.stamp_s for event in page.events.all] == [1.0, 2.0]
    page.pages.step()
    assert len(page.events.all) == 2


def test_a_part_s_numbers_do_not_wait_for_the_picture(page, monkeypatch):
    page.move.pick("b")
    page.tell(frame=frame(1.0, 0.3))
    assert "300.000 mm" in words(page.move._near)
    monkeypatch.setattr(page.all, "_draw", None)  # the picture never comes
    page.tell(frame=frame(2.0, 0.2))
    assert "200.000 mm" in words(page.move._near)


def test_an_event_is_seen_as_it_was_even_where_the_session_was_thinned(page):
    for i in range(1, 10):
        page.tell(frame=frame(float(i), 0.01 * (i % 2) + 0.01, STOP * (i % 2), (HERE, i * THERE)))
    for _ in range(3):
        page.session._thin()
    event = next(event for event in page.events.all if event.stamp_s == 3.0)
    assert page.session.at(3.0).stamp_s != 3.0
    page.all._event_list.go(f"{event.number}")
    page.tell()
    assert page.all._shown.frame.stamp_s == 3.0
    np.testing.assert_allclose(page.all._parts["b"].pose, 3.0 * THERE)


def test_a_player_that_has_ended_is_told_from_none(page):
    note = page.all._player._note
    assert words(note) == NONE
    page.tell(player_ended=True)
    assert words(note) == ENDED


def test_each_button_of_the_motion_does_one_thing_however_late_it_is_pressed(page, monkeypatch):
    monkeypatch.setattr("proximity_monitor.display.player_panel.ASK_S", 0.0)
    panel = page.all._player
    for speed in (1.0, 0.0):  # paused by another browser; this one may not show it yet
        page.tell(playing=Playing(0.0, 0.0, speed, 10.0))
        press(panel._pause)
        page.tell()
    press(panel._play)
    page.tell()
    assert page.asked == [{"speed": 0.0}, {"speed": 0.0}, {"speed": 1.0}]
    press(panel._pause)
    page.tell(scene=replace(SCENE, name="another"))
    assert len(page.asked) == 3, "it was meant for the motion of the scene before"


def press(button):
    for callback in button._impl.update_cb:
        callback(None)


def test_a_banner_does_not_outlive_its_scene(page):
    assert "clear" in words(page.all._banner)
    page.tell(frame=None, parts=None)
    assert words(page.all._banner) == ""


def test_all_parts_come_into_view_once_they_have_poses(page):
    camera = page.all._server.initial_camera
    middle = camera.look_at.copy()
    nowhere = replace(SCENE, name="another")
    page.tell(scene=nowhere, frame=frame(1.0, np.nan, STALE, (HERE, np.zeros(7))))
    assert camera.look_at[0] < 0.5 * middle[0]
    page.tell(frame=frame(2.0))
    np.testing.assert_allclose(camera.look_at, middle)
    page.tell(frame=frame(3.0, poses=(HERE, 9.0 * THERE)))
    np.testing.assert_allclose(camera.look_at, middle)


def test_new_settings_change_nothing_that_another_scene_begins_anew(page):
    page.choice.ignore(NAMES)
    page.hand.place("b", THERE, now=HERE)
    page.tell(scene=replace(SCENE, settings=SCENE.settings | {"budget_ms": 5.0}))
    assert page.choice.ignored
    assert page.holds.poses
    other = tuple(replace(body, mesh="2") for body in SCENE.bodies)
    bent = [Part(HERE, np.ones(4), 2.0 * CORNERS) for _ in NAMES]
    page.tell(scene=replace(SCENE, bodies=other), parts=bent)
    assert not page.choice.ignored
    assert not page.holds.poses
    mesh = page.all._parts["b"].mesh
    drawn = mesh.vertices[mesh.faces].reshape(-1, 3)
    np.testing.assert_allclose(drawn, page.all._parts.scale * bent[1].corners)


def test_the_worst_pose_of_a_body_that_has_none_now_comes_back(page):
    page.tell(frame=frame(1.0, np.nan, STALE, (np.zeros(7), THERE)))
    page.all._return_to_worst()
    np.testing.assert_array_equal(page.holds.poses[NAMES[0]], HERE)
    while page.hand.undo():
        pass
    np.testing.assert_array_equal(page.holds.poses[NAMES[0]], HERE)


def test_a_drag_stays_with_its_body_and_ends_whatever_is_chosen_meanwhile(page):
    page.move.pick("b")
    page.tell()
    drag(page, "start", 3.5)
    drag(page, "update", 4.0)
    begun = page.holds.poses["b"]
    page.move.pick(None)
    drag(page, "update", 5.0)
    drag(page, "end", 5.0)
    assert page.holds.poses["b"][0] == pytest.approx(begun[0] + 1.0)
    page.move.pick("b")
    page.holds.release()
    page.tell(frame=frame(1.0, poses=(HERE, HERE)))
    np.testing.assert_allclose(page.move._gizmo.position, [0.5, 0.5, 0.0])


def test_a_drag_does_not_outlive_its_scene(page):
    page.move.pick("b")
    page.tell()
    drag(page, "start", 3.5)
    page.tell(scene=replace(SCENE, name="other"))
    drag(page, "update", 4.0)
    assert not page.holds.poses
    page.move.pick("b")
    page.tell(frame=frame(1.0, poses=(HERE, HERE)))
    np.testing.assert_allclose(page.move._gizmo.position, [0.5, 0.5, 0.0])


def test_letting_nothing_go_keeps_what_is_held(page):
    page.hand.place("b", THERE, now=HERE)
    page.move.pick(None)
    page.move._on_release(None)
    assert page.holds.poses
    page.move.pick("b")
    page.move._on_release(None)
    assert not page.holds.poses


def test_what_others_named_is_no_html(page):
    page.move.pick("b")
    page.hand.place("b", THERE, now=HERE)
    page.choice.pair = NAMES
    page.all._timeline._due_s = 0.0
    page.tell(rivals=("<i>robot",), refusal="<i>no")
    panel = page.all._settings
    own = replace(SCENE, own_thresholds={NAMES: Thresholds(0.2, 0.1, 0.0)})
    panel.show(own, None, "<i>no", time.monotonic())
    told = (page.move._note, page.all._timeline._worst, panel._refusal, panel._whose)
    for html in told:
        assert "&lt;i&gt;" in html.content
        assert "<i>" not in html.content


@pytest.fixture
def panel(server):
    asked = []
    made = SettingsPanel(server.gui, Choice(), Tried(), asked.append)
    return SimpleNamespace(all=made, asked=asked, lengths=made._lengths)


def set_by_hand(panel, name, value):
    slider = panel.lengths[name]
    slider.value = value
    panel.all._on_length(name, slider)(PERSON)


def show(panel, scene, now_s, refusal=""):
    panel.all.show(scene, None, refusal, now_s)


def test_a_slider_shows_what_is_in_force_however_far_and_another_leaves_it(panel):
    show(panel, SCENE, 0.0)
    settings = SCENE.settings | {"budget_ms": 900.0, "rel_err": 0.8, "abs_err": 2.0}
    far = replace(SCENE, thresholds=Thresholds(7.0, 0.02, 0.0), settings=settings)
    show(panel, far, 10.0)
    assert panel.lengths["warn"].value == 7000.0
    made = panel.all
    assert (made._budget.value, made._rel.value, made._abs.value) == (900.0, 80.0, 2000.0)
    set_by_hand(panel, "stop", 800.0)
    show(panel, far, 20.0)
    assert panel.asked == [{"thresholds.stop": pytest.approx(0.8)}]


def test_the_sliders_of_a_scene_of_contacts_alone_can_be_used(panel):
    show(panel, replace(SCENE, thresholds=Thresholds(0.0, 0.0, 0.0)), 0.0)
    assert panel.lengths["warn"].max == 5.0  # mm
    assert panel.all._abs.max == 1.0


def test_what_was_moved_before_another_scene_came_is_not_asked_of_it(panel):
    show(panel, SCENE, 0.0)
    set_by_hand(panel, "warn", 200.0)
    show(panel, replace(SCENE, name="another", thresholds=Thresholds(0.005, 0.001, 0.0)), 0.01)
    assert panel.asked == []
    assert panel.lengths["warn"].value == 5.0


def test_warn_and_stop_push_each_other(panel):
    show(panel, SCENE, 0.0)
    set_by_hand(panel, "warn", 10.0)
    show(panel, SCENE, 10.0)
    set_by_hand(panel, "stop", 40.0)
    show(panel, SCENE, 20.0)
    assert panel.asked == [
        {f"thresholds.{name}": pytest.approx(metres) for name in ("warn", "stop")}
        for metres in (0.01, 0.04)
    ]
    assert panel.lengths["warn"].value == 40.0


@pytest.mark.parametrize("refusal", ["", "too small"])
def test_a_slider_follows_once_its_request_was_answered(panel, refusal):
    show(panel, SCENE, 0.0)
    set_by_hand(panel, "hysteresis", 5.0)
    show(panel, SCENE, 10.0)
    show(panel, SCENE, 60.0)
    assert panel.lengths["hysteresis"].value == 5.0
    answer = SCENE if refusal else replace(SCENE, thresholds=Thresholds(0.1, 0.02, 0.004))
    show(panel, answer, 61.0, refusal)
    assert panel.lengths["hysteresis"].value == (0.0 if refusal else pytest.approx(4.0))


def test_a_slider_is_not_pulled_from_the_hand(panel):
    show(panel, SCENE, 0.0)
    set_by_hand(panel, "hysteresis", 5.0)
    show(panel, SCENE, 10.0)
    show(panel, replace(SCENE), 10.0 + ASK_S)
    assert panel.lengths["hysteresis"].value == 5.0
    show(panel, replace(SCENE), 10.0 + HAND_S)
    assert panel.lengths["hysteresis"].value == 0.0


def test_sliders_have_the_unit_of_the_scene(panel):
    show(panel, SCENE, 0.0)
    inches = replace(SCENE, unit=Unit("in", 0.0254))
    show(panel, inches, 10.0)
    assert panel.lengths["warn"].label == "warn [in]"
    set_by_hand(panel, "warn", 10.0)
    show(panel, inches, 20.0)
    assert panel.asked == [{"thresholds.warn": pytest.approx(0.254)}]


def elsewhere(x):
    return HERE, np.array([x, 0.0, 0, 1, 0, 0, 0])


def test_the_fields_of_a_part_that_others_move_wait_until_it_rests(page, monkeypatch):
    page.move.pick("b")
    page.tell(frame=frame(1.0, poses=elsewhere(3.0)))
    assert page.move._position.value == (3000.0, 0.0, 0.0)  # it has just been chosen
    assert words(page.move._now) == ""
    page.tell(frame=frame(2.0, poses=elsewhere(3.5)))
    page.tell()
    assert page.move._position.value == (3000.0, 0.0, 0.0)  # somebody may be typing
    assert "now at 3500.0, 0.0, 0.0 mm" in words(page.move._now)
    monkeypatch.setattr(move, "REST_S", 0.0)
    page.tell()
    assert page.move._position.value == (3500.0, 0.0, 0.0)
    assert words(page.move._now) == ""


def test_the_fields_of_a_part_that_is_held_here_follow_the_hand(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    for x in (3.25, 3.5):
        page.hand.place("b", elsewhere(x)[1], now=THERE)
        page.tell()
        assert page.move._position.value == (1e3 * x, 0.0, 0.0)
