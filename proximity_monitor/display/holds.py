"""The bodies that are held here: their poses are published until they are released."""

from __future__ import annotations

import threading
from collections.abc import Mapping

import numpy as np

UNDO = 200
"""How many steps can be undone."""


class Holds:
    """Poses (7,), x y z in metres, quaternion w x y z, with undo. Any thread may call."""

    def __init__(self) -> None:
        """Begin without any held body."""
        self._lock = threading.Lock()
        self._poses: dict[str, np.ndarray] = {}
        self._first: dict[str, np.ndarray] = {}
        self._before: list[tuple[str, np.ndarray]] = []

    @property
    def poses(self) -> Mapping[str, np.ndarray]:
        """The poses to publish, by body."""
        with self._lock:
            return dict(self._poses)

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        with self._lock:
            return bool(self._before)

    def take(self, name: str, now: np.ndarray) -> None:
        """Begin a step with a body, and hold it where it is; the step can be undone."""
        with self._lock:
            self._before.append((name, self._poses.get(name, now)))
            del self._before[:-UNDO]
            self._poses.setdefault(name, now)
            self._first.setdefault(name, now)

    def move(self, name: str, pose: np.ndarray) -> None:
        """Move a held body within a step."""
        with self._lock:
            if name in self._poses:
                self._poses[name] = pose

    def place(self, name: str, pose: np.ndarray, now: np.ndarray) -> None:
        """Hold a body at a pose, as one step; `now` is where it is."""
        self.take(name, now)
        self.move(name, pose)

    def undo(self) -> str | None:
        """Undo a step; return the body, which stays held where the step began."""
        with self._lock:
            if not self._before:
                return None
            name, pose = self._before.pop()
            if name in self._poses:
                self._poses[name] = pose
            return name

    def reset(self, name: str) -> None:
        """Put a held body back to where it was first taken; this can be undone."""
        with self._lock:
            first, pose = self._first.get(name), self._poses.get(name)
            if first is not None and pose is not None:
                self._before.append((name, pose))
                self._poses[name] = first

    def release(self, name: str | None = None) -> None:
        """Release a body, or all of them, to their own sources."""
        with self._lock:
            for each in [name] if name is not None else list(self._poses):
                self._poses.pop(each, None)
                self._first.pop(each, None)
                self._before = [step for step in self._before if step[0] != each]
