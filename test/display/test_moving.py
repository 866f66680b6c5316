"""Which parts a page may move and what it shows of them, without a real browser."""

import asyncio
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import HERE, NAMES, SCENE, THERE, drag, frame, words

from proximity_monitor.display import drag as drags
from proximity_monitor.display.attaching import WAITS
from proximity_monitor.display.geometry import from_degrees, to_degrees
from proximity_monitor.display.guard import AT_STOP
from proximity_monitor.display.holds import Hand
from proximity_monitor.display.state import STOP, Thresholds

PERSON = SimpleNamespace(client=object())
ATTACHED = replace(SCENE, attachments={"b": NAMES[0]}, held={"b": NAMES[0]})
STEP = np.array([0.5, 0.0, 0.0]), np.zeros(3)


@pytest.fixture
def page(alone):
    return alone


def at(x, turn=(1.0, 0, 0, 0)):
    return np.array([x, 0.0, 0.0, *turn])


def typed(page, x, turn=(0.0, 0.0, 0.0)):
    """Type a pose without pressing anything."""
    page.move._position.value, page.move._turn.value = (x, 0.0, 0.0), turn
    page.move._on_typed(PERSON)


def test_nothing_is_moved_from_a_moment_that_is_over(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0, poses=(HERE, at(3.0))))
    page.tell(frame=frame(2.0, poses=(HERE, at(9.0))))
    page.choice.at_s = 1.0
    page.tell()
    assert page.move._position.value == (3000.0, 0.0, 0.0)
    assert page.move._apply.disabled
    assert "looking back" in words(page.move._note)
    page.move._on_step(*STEP)
    typed(page, 777.0)
    page.move._on_apply(PERSON)
    drag(page, "start", 3.5)
    assert not page.holds.poses
    page.choice.at_s = None  # and no step has shown that yet
    page.move._on_step(*STEP)
    assert page.holds.poses["b"][0] == pytest.approx(9.5)
    page.hand.undo()
    assert page.holds.poses["b"][0] == 9.0


def test_no_step_is_undone_while_one_looks_back(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    page.hand.place("b", at(4.0), THERE)
    drag(page, "start", 3.5)
    page.choice.at_s = 0.0
    page.tell(frame=frame(2.0))
    assert page.move._undo.disabled and page.move._reset.disabled
    page.move._on_undo(PERSON)
    page.move._on_reset(PERSON)
    drag(page, "update", 9.0)
    assert page.holds.poses["b"][0] == 4.0
    page.choice.at_s = None
    page.move._on_reset(PERSON)
    assert page.holds.poses["b"][0] == 3.0


def test_nothing_of_a_scene_is_held_after_another_has_begun(page, monkeypatch):
    told = []
    monkeypatch.setattr(page.all._client, "add_notification", lambda *x, **_: told.append(x[1]))
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    drag(page, "start", 3.5)
    page.tell(scene=replace(SCENE, name="other"), frame=None)
    assert page.move._apply.disabled and not page.move._gizmo.visible
    drag(page, "update", 9.0)
    drag(page, "start", 3.5)
    drag(page, "update", 9.0)
    page.move._on_step(*STEP)
    page.all._return_to_worst()
    assert not page.holds.poses
    assert told == [f"{name}: another scene has begun" for name in NAMES]
    page.tell(frame=frame(2.0))
    page.move.pick("b")
    page.move._on_step(*STEP)
    assert page.holds.poses["b"][0] == pytest.approx(3.5)


def test_what_is_attached_is_moved_by_no_hand(page):
    page.move.pick("b")
    page.tell(scene=ATTACHED, frame=frame(1.0, 0.01, STOP))
    page.move._on_step(*STEP)
    typed(page, 777.0)
    page.move._on_apply(PERSON)
    drag(page, "start", 3.5)
    drag(page, "update", 4.0)
    page.all._return_to_worst()
    assert page.holds.poses.keys() == {NAMES[0]}


def test_what_becomes_attached_is_let_go_whoever_holds_it(page):
    other = Hand(page.holds, "browser 2")
    other.place("b", at(2.0), THERE)
    page.tell(frame=frame(1.0, poses=(HERE, at(2.0))))
    page.tell(scene=ATTACHED, frame=frame(2.0, poses=(at(1.0), at(3.0))))
    assert not page.holds.poses
    assert not other.can_undo
    assert page.all._parts["b"].pose[0] == 3.0
    page.tell(scene=SCENE)
    assert other.place("b", at(2.0), THERE)


def test_what_waits_to_be_attached_is_held_here_until_the_monitor_has_it(page):
    page.tell(frame=frame(1.0, poses=(HERE, np.zeros(7))))
    page.hand.place("b", at(2.0), at(2.0))
    page.tell(scene=replace(ATTACHED, held={}))
    assert page.holds.poses.keys() == {"b"}, "else nobody might give it the pose it waits for"
    assert page.hand.may("b")
    page.tell(scene=ATTACHED)
    assert not page.holds.poses
    assert not page.hand.may("b")


def test_an_attachment_that_waits_is_told(page):
    told = page.move._attaching._note
    page.move.pick("b")
    page.tell(scene=replace(ATTACHED, held={}), frame=frame(1.0))
    assert words(told) == WAITS
    page.tell(scene=ATTACHED)
    assert words(told) == ""
    page.tell(scene=replace(ATTACHED, attachments={}))
    assert words(told) == "", "it is being detached"


def attach(page, parent):
    field = page.move._attaching._parent
    field._impl.value = parent
    for act in field._impl.update_cb:
        act(PERSON)


def test_a_part_is_held_until_the_monitor_has_attached_it(page):
    page.move.pick("b")
    page.hand.place("b", at(4.0), THERE)
    page.tell(frame=frame(1.0))
    attach(page, NAMES[0])
    told = page.move._attaching._note
    page.tell(refusal="a circle", refused=frozenset({"attachments.b"}))
    assert page.holds.poses["b"][0] == 4.0
    assert "a circle" in words(told)
    page.move.pick(NAMES[0])
    page.tell()
    assert words(told) == ""
    page.move.pick("b")
    page.tell(refusal="must be positive", refused=frozenset({"budget_ms"}))
    assert words(told) == ""
    page.tell(scene=ATTACHED, refusal="", refused=frozenset())
    assert not page.holds.poses


def test_the_last_pose_of_a_drag_is_the_last_one(page, monkeypatch):
    page.move.pick("b")
    page.move._stop.value = AT_STOP
    page.tell(frame=frame(1.0))
    centre = page.move._gizmo.position[0]
    drag(page, "start", centre)
    drag(page, "update", centre + 0.01)
    inside, go, sound = threading.Event(), threading.Event(), drags.slack

    def slow(*given):
        room = sound(*given)
        if threading.current_thread().name == "page":
            inside.set()
            assert go.wait(5.0)
        return room

    def released():
        drag(page, "update", centre + 0.05)
        drag(page, "end", centre + 0.05)

    monkeypatch.setattr(drags, "slack", slow)
    step = threading.Thread(target=page.pages.step, name="page")
    step.start()
    assert inside.wait(5.0)
    hand = threading.Thread(target=released)
    hand.start()
    hand.join(0.1)
    go.set()
    hand.join()
    step.join()
    assert page.holds.poses["b"][0] == pytest.approx(3.05)


def test_a_drag_stops_at_the_limit_that_is_in_force(page):
    page.move.pick("b")
    page.move._stop.value = AT_STOP
    page.tell(frame=frame(1.0))
    page.tell(scene=replace(SCENE, thresholds=Thresholds(0.25, 0.25, 0.0)))
    centre = page.move._gizmo.position[0]
    drag(page, "start", centre)
    drag(page, "update", centre + 0.2)
    assert page.holds.poses["b"][0] == pytest.approx(3.05)


def test_what_only_waits_to_be_attached_to_a_part_stops_its_drag(page):
    page.move.pick(NAMES[0])
    page.move._stop.value = AT_STOP
    page.tell(scene=replace(ATTACHED, held={}), frame=frame(1.0))
    centre = page.move._gizmo.position[0]
    drag(page, "start", centre)
    drag(page, "update", centre + 1.0)
    assert page.holds.poses[NAMES[0]][0] == pytest.approx(0.28)


def test_a_drag_ends_when_another_hand_takes_the_part(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    drag(page, "start", 3.5)
    drag(page, "update", 4.0)
    other = Hand(page.holds, "browser 2")
    other.take_over("b")
    other.move("b", at(7.0))
    page.tell(frame=frame(2.0, poses=(HERE, at(7.0))))
    drag(page, "update", 5.0)
    page.tell()
    assert page.holds.poses["b"][0] == 7.0
    np.testing.assert_allclose(page.move._gizmo.position[0], 7.5)


def turn(page, phase, degrees, x=3.5):
    target = SimpleNamespace(position=(x, 0.5, 0.0), wxyz=tuple(from_degrees(0, 0, degrees)))
    asyncio.run(page.move._on_drag(SimpleNamespace(phase=phase, target=target)))


def test_a_geared_turn_goes_on_beyond_half_a_turn(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    page.move._fine._gear.value = "1 : 10"
    turn(page, "start", 0.0)
    for degrees in (90.0, 170.0, 181.0, 190.0, 300.0, 361.0):
        turn(page, "update", degrees)
        assert to_degrees(page.holds.poses["b"][3:])[2] == pytest.approx(degrees / 10.0)


def test_another_gear_counts_from_when_it_was_taken(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    page.move._fine._gear.value = "1 : 1000"
    turn(page, "start", 0.0, 3.5)
    turn(page, "update", 0.0, 4.5)
    page.move._fine._gear.value = "1 : 1"
    turn(page, "update", 0.0, 4.75)
    assert page.holds.poses["b"][0] == pytest.approx(3.251)


def test_numbers_that_were_typed_in_vain_are_not_taken_for_the_part_s_place(page):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    typed(page, 777.0)
    page.tell()
    assert page.move._position.value == (777.0, 0.0, 0.0)
    assert "now at 3000.0" in words(page.move._now)
    page.move.pick("b")
    page.tell(frame=frame(2.0))
    assert page.move._position.value == (3000.0, 0.0, 0.0)
    assert words(page.move._now) == ""


@pytest.mark.parametrize("angles", [(30.0, 90.0, 10.0), (-170.0, -90.0, 5.0), (0.0, 100.0, 0.0)])
def test_angles_that_were_typed_stay(page, angles):
    page.move.pick("b")
    page.tell(frame=frame(1.0))
    typed(page, 500.0, angles)
    page.move._on_apply(PERSON)
    held = page.holds.poses["b"]
    page.tell(frame=frame(2.0, poses=(HERE, held)))
    assert page.move._turn.value == angles
    assert words(page.move._now) == ""


def test_another_scene_begins_with_no_part_chosen_and_all_as_it_says(page):
    page.move.pick("b")
    page.all._inspect._bands.value = True
    page.all._inspect._opacity.value = 0.3
    page.tell(scene=replace(SCENE, name="other"), frame=frame(5.0))
    assert page.choice.body is None
    assert page.move._who.value == "(none)"
    assert not page.all._inspect._bands.value
    assert page.all._inspect._opacity.value == 1.0


def test_what_does_not_come_back_to_its_worst_pose_is_told(page, monkeypatch):
    told = []
    monkeypatch.setattr(page.all._client, "add_notification", lambda *x, **_: told.append(x))
    page.tell(frame=frame(1.0, 0.01, STOP, (HERE, at(1.0))))
    Hand(page.holds, "browser 2").take("b", THERE)
    page.tell(frame=frame(2.0))
    page.all._return_to_worst()
    assert page.holds.poses["b"][0] == 3.0
    assert told == [("Not returned", "b: browser 2 holds it: take it over first")]
