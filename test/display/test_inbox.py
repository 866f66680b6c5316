"""What the inbox makes of messages of two scenes."""

import threading
from dataclasses import replace

import pytest
from page_alone import PARTS, SCENE, frame

from proximity_monitor.display import inbox as inboxes
from proximity_monitor.display.inbox import Inbox

NEXT = replace(SCENE, name="the next")


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
        for put in (inbox.put_pairs, inbox.put_poses):
            put(bytes(12))
            put(bytes(11) + b"1")
    news = inbox.read()
    assert (news.scene, news.parts, news.frame, news.passed) == (NEXT, None, None, ())
    assert not news.unreadable
