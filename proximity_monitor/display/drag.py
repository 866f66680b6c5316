"""A drag with the gizmo. The server's thread brings its events, the page's thread brings ticks."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.fine import Fine
from proximity_monitor.display.geometry import moved
from proximity_monitor.display.guard import FREE, carried, farthest, radius_of, slack
from proximity_monitor.display.holds import Hand
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.state import Frame, SceneInfo


class Room(NamedTuple):
    """The data that limit how far a part may be moved."""

    frame: Frame
    """The newest tick."""
    scene: SceneInfo
    parts: Parts


class Drag:
    """At most one drag at a time; it stays with its body, whatever is chosen meanwhile."""

    def __init__(self, hand: Hand, fine: Fine) -> None:
        """Begin without a drag by this hand; `fine` gears its drags."""
        self._hand = hand
        self._fine = fine
        self._lock = threading.Lock()  # without it, an older target could arrive last
        self._name: str | None = None
        self._target: np.ndarray | None = None

    @property
    def body(self) -> str | None:
        """The body that is dragged; None: no drag is on."""
        return self._name

    def begin(self, name: str, pose: np.ndarray, handles: np.ndarray, centre: np.ndarray) -> None:
        """Begin a drag of a body, if the hand may take the body.

        Args:
            name: the body's name.
            pose: (7,) its present pose, metres.
            handles: (7,) the pose of the handles.
            centre: (3,) the point at which the handles grip the body, in its own frame.
        """
        with self._lock:
            self._name = name if self._hand.take(name, pose) else None
            self._fine.grip(moved(pose, centre), handles)

    def follow(self, handles: np.ndarray, centre: np.ndarray) -> None:
        """Set the target of the drag from the handles' present pose; see `begin`."""
        with self._lock:
            if self._name is not None:
                self._target = moved(self._fine.followed(handles), -centre)

    def end(self) -> None:
        """End the drag; the body stays where it is."""
        with self._lock:
            self._name = self._target = None

    def advance(self, room: Room | None, where: str) -> tuple[str, np.ndarray] | None:
        """Move the dragged body towards its target, as far as it may.

        Args:
            room: the data that limit the motion; None: nothing is known.
            where: where drags stop; one of `guard`'s words.

        Returns:
            The body and its new pose (7,); None if it was not moved.
        """
        with self._lock:
            name, target = self._name, self._target
            if name is None or target is None:
                return None
            if where != FREE:
                target = self._guarded(name, target, room, where)
            if target is None:
                return None
            if not self._hand.move(name, target):  # the hand no longer holds the body
                self._name = self._target = None
                return None
            return name, target

    def _guarded(
        self, name: str, target: np.ndarray, room: Room | None, where: str
    ) -> np.ndarray | None:
        now = self._hand.poses.get(name)
        if room is None or now is None:
            return None
        frame, scene, parts = room
        group = carried(name, scene.held)
        radius = radius_of(name, group, frame, scene, parts)
        if radius is None:
            return None
        seen = frame.pose(scene.moving.index(name))
        centre = parts[name].centre / parts.scale
        return farthest(seen, now, target, centre, radius, slack(group, frame, scene, where))
