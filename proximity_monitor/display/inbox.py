"""What arrived last, handed from the ROS thread to the page's."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from proximity_monitor.display.received import Part, read_pairs, read_parts, read_poses
from proximity_monitor.display.state import Frame, Health, Scene

ALERTS = 200
"""So many of the last alerts are kept."""

_STAMP = slice(4, 12)  # of a serialised message that begins with a header


@dataclass(frozen=True)
class Alert:
    """One change of a pair's state, as ~/alerts tells it."""

    stamp_s: float
    level: str
    pair: str
    text: str


@dataclass(frozen=True)
class News:
    """All that is known at one moment."""

    scene: Scene | None = None
    parts: Sequence[Part] | None = None
    parts_seen: int = 0
    """How many messages of ~/parts came."""
    frame: Frame | None = None
    frames_seen: int = 0
    """How many ticks came."""
    frame_at_s: float = float("-inf")
    """When the last of them came, on the monotonic clock."""
    health: Health | None = None
    health_at_s: float = float("-inf")
    alerts: tuple[Alert, ...] = ()
    present: bool = False
    """Whether the monitor is on the network."""
    rivals: tuple[str, ...] = ()
    """Other publishers on the topics of the bodies that are held here."""
    refusal: str = ""
    """Why the monitor did not take the last parameters; empty where it did."""


class Inbox:
    """Takes messages in as bytes; only what is looked at is read."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._lock = threading.Lock()
        self._news = News()
        self._points = self._poses = self._parts = b""
        self._matched: tuple[bytes, bytes] | None = None
        self._alerts: deque[Alert] = deque(maxlen=ALERTS)

    @property
    def news(self) -> News:
        """What is known, as far as it was read."""
        with self._lock:
            return self._news

    def tell(self, **changes: object) -> None:
        """Change fields of the news."""
        with self._lock:
            self._news = replace(self._news, **changes)

    def put_points(self, data: bytes) -> None:
        """Take a serialised ~/closest_points."""
        with self._lock:
            self._points = data
            self._match()

    def put_poses(self, data: bytes) -> None:
        """Take a serialised ~/poses."""
        with self._lock:
            self._poses = data
            self._match()

    def put_parts(self, data: bytes) -> None:
        """Take a serialised ~/parts."""
        with self._lock:
            self._parts = data
            self._news = replace(self._news, parts_seen=self._news.parts_seen + 1)

    def put_health(self, health: Health) -> None:
        """Take what the monitor says of itself."""
        self.tell(health=health, health_at_s=time.monotonic(), present=True)

    def put_alert(self, alert: Alert) -> None:
        """Take an alert."""
        with self._lock:
            self._alerts.append(alert)
            self._news = replace(self._news, alerts=tuple(self._alerts))

    def forget(self) -> None:
        """Forget what belonged to another scene."""
        with self._lock:
            self._points = self._poses = self._parts = b""
            self._matched = None
            self._news = replace(self._news, parts=None, frame=None, alerts=())
            self._alerts.clear()

    def read(self) -> News:
        """Return the news, with what came since the last call read.

        Raises:
            ValueError: a message is not what a monitor publishes.
        """
        with self._lock:
            news = self._news
            matched, self._matched = self._matched, None
            parts, self._parts = self._parts, b""
        found: dict[str, object] = {}
        if matched is not None:
            stamp_s, pairs = read_pairs(matched[0])
            found["frame"] = Frame(stamp_s, read_poses(matched[1])[1], pairs)
        if parts:
            found["parts"] = read_parts(parts)
        if not found:
            return news
        self.tell(**found)
        return replace(news, **found)

    def _match(self) -> None:
        """A tick is complete when both messages of its stamp have come."""
        if self._points[_STAMP] == self._poses[_STAMP] and self._points:
            self._matched = (self._points, self._poses)
            self._news = replace(
                self._news,
                frames_seen=self._news.frames_seen + 1,
                frame_at_s=time.monotonic(),
            )
