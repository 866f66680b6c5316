"""How the inbox treats messages of two scenes."""

import threading
from dataclasses import replace

import pytest
from page_alone import PARTS, SCENE, frame

from proximity_monitor.display import inbox as inboxes
from proximity_monitor.display.inbox import GONE_S, Inbox
from proximity_monitor.display.state import Health

NEXT = replace(SCENE, name="the next")


def half(tick, stamp="1"):
    """Return one of the two messages of a tick: a stamp, then the tick's name."""
    return bytes(11) + f"{stamp}{tick}".encode()


@pytest.mark.parametrize("kind", ["read_parts", "_tick"])
def test_what_is_being_read_when_another_scene_begins_is_not_taken_for_its_own(kind, monkeypatch):
    inbox = Inbox()
    inbox.begin(SCENE)

    def read(*_):
        beginning = threading.Thread(target=inbox.begin, args=(NEXT,))
        beginning.start()
        beginning.join()
        return PARTS if kind == "read_parts" else {"frame": frame(1.0), "frame_at_s": 0.0}

    monkeypatch.setattr(inboxes, kind, read)
    if kind == "read_parts":
        inbox.put_parts(b"meshes")
    else:
        for tick in "12":
            for put in (inbox.put_pairs, inbox.put_poses):
                put(half(tick))
    news = inbox.read()
    assert (news.scene, news.parts, news.frame, news.passed) == (NEXT, None, None, ())
    assert not news.unreadable


def test_each_message_goes_with_the_one_of_its_tick_also_where_a_stamp_comes_again():
    inbox = Inbox()
    for put, tick in (
        (inbox.put_pairs, "1"), (inbox.put_pairs, "2"),  # the clock stands still
        (inbox.put_poses, "1"), (inbox.put_poses, "2"), (inbox.put_pairs, "3"),
        (inbox.put_poses, "3"),
    ):  # fmt: skip
        put(half(tick))
    inbox.put_poses(half("lost", "2"))
    inbox.put_pairs(half("4", "3"))
    inbox.put_poses(half("4", "3"))
    inbox.put_pairs(half("5", "2"))  # the clock went back
    inbox.put_poses(half("5", "2"))
    told = [(pairs[12:], poses[12:]) for pairs, poses, _ in inbox._matched]
    assert told == [(tick.encode(),) * 2 for tick in "12345"]


def test_what_the_monitor_told_of_itself_counts_for_its_scene_and_some_seconds():
    inbox, health = Inbox(), Health(schedule={"message": ""})
    inbox.begin(SCENE)
    inbox.put_health(health)
    heard_s = inbox.news.health_at_s
    assert inbox.read().health is health
    inbox.begin(NEXT)
    assert inbox.read().health is None
    assert inbox.news.health_at_s == heard_s, "the monitor is there"
    inbox.put_health(health)
    inbox.tell(health_at_s=heard_s - 1.0 - GONE_S)
    assert inbox.read().health is None
