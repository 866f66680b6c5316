"""The last messages, handed from the ROS thread to the page's thread."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from proximity_monitor.display.received import (
    OfAnotherSceneError,
    Part,
    read_pairs,
    read_parts,
    read_poses,
)
from proximity_monitor.display.state import Frame, Health, Playing, SceneInfo

GONE_S = 3.5
"""Diagnostics come each second. Without any for this many seconds, the monitor counts as gone."""

UNREAD = 16
"""How many ticks wait for the page to read them; beyond this number the oldest are dropped."""

_STAMP = slice(4, 12)  # bytes of the stamp in a serialised message that begins with a header


@dataclass(frozen=True)
class News:
    """Everything that is known at one moment."""

    scene: SceneInfo | None = None
    parts: Sequence[Part] | None = None
    frame: Frame | None = None
    """The last readable tick."""
    frame_at_s: float = float("-inf")
    """When that tick came, by the monotonic clock."""
    passed: tuple[Frame, ...] = ()
    """The readable ticks between that of the previous news and `frame`, the oldest first."""
    health: Health | None = None
    """The scene's last health; None: not heard yet, or too long ago."""
    health_at_s: float = float("-inf")
    """When the monitor last told its health, for any scene, by the monotonic clock."""
    unreadable: Mapping[str, str] = field(default_factory=dict)
    """By kind of message, why the last message of that kind could not be read."""
    present: bool = False
    """Whether the monitor is on the network."""
    rivals: tuple[str, ...] = ()
    """Other nodes that publish on the topics of bodies that are held here."""
    refusal: str = ""
    """Why the monitor refused the last parameters; empty if it took them."""
    refused: frozenset[str] = frozenset()
    """The names of the refused parameters."""
    playing: Playing | None = None
    """The player's motion; None: there is no player."""
    player_ended: bool = False
    """Whether there was a player before."""
    player_refusal: str = ""
    """Why the player refused the last parameters; empty if it took them."""
    reset: str = ""
    """The outcome of the last request to forget the monitor's smallest clearances."""

    @property
    def complete(self) -> bool:
        """Whether scene, parts and tick are all there and of one scene.

        The first messages may be those of the previous scene.
        """
        scene, parts, frame = self.scene, self.parts, self.frame
        return (
            not (scene is None or parts is None or frame is None)
            and len(parts) == len(scene.bodies)
            and len(frame.poses) == len(scene.moving)
        )


class Inbox:
    """Takes messages as bytes, and reads them when the page asks."""

    def __init__(self) -> None:
        """Begin without messages."""
        self._lock = threading.Lock()
        self._news = News()
        self._turn = 0  # how many scenes have begun
        self._parts = b""
        self._pairs: deque[bytes] = deque(maxlen=UNREAD)  # ~/pairs still without their ~/poses
        self._poses: deque[bytes] = deque(maxlen=UNREAD)
        self._matched: deque[tuple[bytes, bytes, float]] = deque(maxlen=UNREAD)
        self._came = threading.Event()

    @property
    def news(self) -> News:
        """The news so far, without unread messages."""
        with self._lock:
            old = time.monotonic() > self._news.health_at_s + GONE_S
            if old and self._news.health is not None:
                self._news = replace(self._news, health=None)
            return self._news

    def tell(self, **changes: object) -> None:
        """Change fields of the news."""
        with self._lock:
            self._news = replace(self._news, **changes)

    def put_pairs(self, data: bytes) -> None:
        """Take a serialised ~/pairs message."""
        with self._lock:
            self._match(data, self._pairs, self._poses)

    def put_poses(self, data: bytes) -> None:
        """Take a serialised ~/poses message."""
        with self._lock:
            self._match(data, self._poses, self._pairs)

    def put_parts(self, data: bytes) -> None:
        """Take a serialised ~/parts message."""
        with self._lock:
            self._parts = data

    def put_health(self, health: Health) -> None:
        """Take the monitor's report about itself."""
        self.tell(health=health, health_at_s=time.monotonic(), present=True)

    def judge(self, kind: str, error: str | None) -> None:
        """Remember why the last message of a kind could not be read; None: it could be read."""
        with self._lock:
            self._judge(kind, error)

    def begin(self, scene: SceneInfo) -> None:
        """Switch to a scene; forget the previous one, also a message of it that is being read."""
        with self._lock:
            self._turn += 1
            self._parts = b""
            self._pairs.clear()
            self._poses.clear()
            self._matched.clear()
            self._news = replace(
                self._news,
                scene=scene,
                parts=None,
                frame=None,
                passed=(),
                unreadable={},
                health=None,
            )

    def wait(self, timeout_s: float) -> bool:
        """Wait until an unread tick has come, for at most `timeout_s` seconds.

        Return whether one has come.
        """
        return self._came.wait(timeout_s)

    def read(self) -> News:
        """Read the messages since the last call, and return the news."""
        self._came.clear()
        with self._lock:
            matched, scene, turn = tuple(self._matched), self._news.scene, self._turn
            self._matched.clear()
            parts, self._parts = self._parts, b""
        if scene is not None:
            taken = (self._take("tick", turn, partial(_tick, *tick, scene)) for tick in matched)
            come = [found["frame"] for found in taken if found]
            with self._lock:
                if turn == self._turn:
                    self._news = replace(self._news, passed=tuple(come[:-1]))
        if parts:
            self._take("parts", turn, lambda: {"parts": read_parts(parts)})
        return self.news

    def _take(
        self, kind: str, turn: int, read: Callable[[], Mapping[str, object]]
    ) -> Mapping[str, object]:
        """Read a message that came while `_turn` was `turn`; return the fields that changed."""
        try:
            found, error = read(), None
        except OfAnotherSceneError:
            return {}  # the message for the known scene, or the next tick, is under way
        except ValueError as refused:  # the sender has another version, or is no monitor
            found, error = {}, str(refused)
        with self._lock:
            if turn != self._turn:
                return {}  # another scene has begun meanwhile
            self._judge(kind, error)
            self._news = replace(self._news, **found)
        return found

    def _judge(self, kind: str, error: str | None) -> None:
        others = {k: v for k, v in self._news.unreadable.items() if k != kind}
        told = others if error is None else others | {kind: error}
        self._news = replace(self._news, unreadable=told)

    def _match(self, data: bytes, own: deque[bytes], other: deque[bytes]) -> None:
        """Match ~/pairs and ~/poses of one stamp; a tick is complete when both have come.

        Each topic keeps its order. So messages before a matched one have lost their partner, and
        are dropped. If they stayed, a clock that repeats a stamp would match them with a later
        tick's message.
        """
        if all(each[_STAMP] != data[_STAMP] for each in other):
            own.append(data)
            return
        own.clear()
        while (half := other.popleft())[_STAMP] != data[_STAMP]:
            pass
        pairs, poses = (data, half) if own is self._pairs else (half, data)
        self._matched.append((pairs, poses, time.monotonic()))
        self._came.set()


def _tick(pairs: bytes, poses: bytes, came_s: float, scene: SceneInfo) -> Mapping[str, object]:
    stamp_s, read = read_pairs(pairs, scene)
    return {"frame": Frame(stamp_s, read_poses(poses)[1], read), "frame_at_s": came_s}
