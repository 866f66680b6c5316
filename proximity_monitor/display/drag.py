"""A drag by the gizmo. Its events come in the server's thread, ticks in that of the page."""

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
    """What says how far a part may be moved."""

    frame: Frame
    """The newest tick."""
    scene: SceneInfo
    parts: Parts


class Drag:
    """One at a time; it stays with its body, whatever is chosen meanwhile."""

    def __init__(self, hand: Hand, fine: Fine) -> None:
        """Begin without a drag of this hand, which `fine` gears."""
        self._hand = hand
        self._fine = fine
        self._lock = threading.Lock()  # else an older target could be the last to arrive
        self._name: str | None = None
        self._target: np.ndarray | None = None

    @property
    def body(self) -> str | None:
        """The body that is dragged."""
        return self._name

    def begin(self, name: str, pose: np.ndarray, handles: np.ndarray, centre: np.ndarray) -> None:
        """Take a body, if the hand may.

        Args:
            name: of the body.
            pose: (7,) where it is, metres.
            handles: (7,) where the handles are.
            centre: (3,) where they grip it, in its own frame.
        """
        with self._lock:
            self._name = name if self._hand.take(name, pose) else None
            self._fine.grip(moved(pose, centre), handles)

    def follow(self, handles: np.ndarray, centre: np.ndarray) -> None:
        """Let the hand want the body where the handles are now; see `begin`."""
        with self._lock:
            if self._name is not None:
                self._target = moved(self._fine.followed(handles), -centre)

    def end(self) -> None:
        """Leave the body where it is."""
        with self._lock:
            self._name = self._target = None

    def advance(self, room: Room | None, where: str) -> tuple[str, np.ndarray] | None:
        """Move the body towards where the hand wants it, as far as it may.

        Args:
            room: None: nothing is known.
            where: drags stop; one of `guard`'s words.

        Returns:
            The body and its pose (7,), if it was moved.
        """
        with self._lock:
            name, target = self._name, self._target
            if name is None or target is None:
                return None
            if where != FREE:
                target = self._guarded(name, target, room, where)
            if target is None:
                return None
            if not self._hand.move(name, target):  # it is in this hand no longer
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
