"""The bodies that browsers hold: the display publishes their poses until they are released."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Iterable, Mapping

import numpy as np

UNDO = 200
"""How many steps each hand can undo."""


class Holds:
    """Poses (7,) of held bodies: x y z in metres, quaternion w x y z. Each belongs to one hand.

    Any thread may call the methods.
    """

    def __init__(self) -> None:
        """Begin without any held body."""
        self._lock = threading.RLock()
        self._poses: dict[str, np.ndarray] = {}
        self._owners: dict[str, Hand] = {}
        self._attached: frozenset[str] = frozenset()
        self._scene: Hashable = None
        self.on_move: Callable[[], None] = lambda: None
        """Called after a body was moved, in the thread that moved it."""

    @property
    def poses(self) -> Mapping[str, np.ndarray]:
        """The poses to publish, by body."""
        with self._lock:
            return dict(self._poses)

    def owner(self, name: str) -> Hand | None:
        """Return the hand that holds a body."""
        with self._lock:
            return self._owners.get(name)

    def begin(self, scene: Hashable) -> None:
        """Switch to a scene: release all bodies. From now on only hands of this scene take any."""
        with self._lock:
            self.release()
            self._scene = scene

    def follow(self, attached: Iterable[str]) -> None:
        """Release bodies that are attached to others, whoever holds them. No hand may take them."""
        with self._lock:
            self._attached = frozenset(attached)
            for name in self._attached & self._owners.keys():
                self._owners[name].release(name)

    def release(self) -> None:
        """Release all bodies to their own sources."""
        with self._lock:
            for hand in set(self._owners.values()):
                hand.release()


class Hand:
    """One browser's hand, with its own undo. It moves only bodies that it `may` move."""

    def __init__(self, holds: Holds, name: str) -> None:
        """Begin with nothing held; `name` tells the other browsers who holds a body."""
        self.name = name
        self._holds = holds
        self._lock = holds._lock
        self._first: dict[str, np.ndarray] = {}
        self._before: list[tuple[str, np.ndarray]] = []
        self._gone = False
        self._scene = holds._scene

    def begin(self, scene: Hashable) -> None:
        """Switch to a scene. While `Holds` has another one, this hand takes no body."""
        with self._lock:
            self._scene = scene

    @property
    def poses(self) -> Mapping[str, np.ndarray]:
        """The poses of all held bodies, including those in other hands."""
        return self._holds.poses

    @property
    def own(self) -> frozenset[str]:
        """The names of the bodies in this hand."""
        with self._lock:
            return frozenset(name for name, owner in self._holds._owners.items() if owner is self)

    def other(self, name: str | None) -> Hand | None:
        """Return the other hand that holds a body; None: the body is free or in this hand."""
        owner = None if name is None else self._holds.owner(name)
        return None if owner is self else owner

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        with self._lock:
            return bool(self._before)

    def may(self, name: str) -> bool:
        """Return whether this hand may move a body.

        It may not if another hand holds the body, if the body is attached to another one, or if
        `Holds` has another scene than this hand.
        """
        with self._lock:
            off = self._gone or self._scene != self._holds._scene
            attached = name in self._holds._attached
            return not (off or attached or self.other(name) is not None)

    def take(self, name: str, now: np.ndarray) -> bool:
        """Begin a step with a body and hold it where it is; return whether this hand `may`."""
        with self._lock:
            if not self.may(name):
                return False
            poses = self._holds._poses
            self._before.append((name, poses.get(name, now)))
            del self._before[:-UNDO]
            self._first.setdefault(name, now)
            poses.setdefault(name, now)
            self._holds._owners[name] = self
            return True

    def take_over(self, name: str) -> None:
        """Take a body out of another hand; it stays where it is."""
        with self._lock:
            other, pose = self.other(name), self._holds._poses.get(name)
            if other is not None:
                other.release(name)
                self.take(name, pose)

    def move(self, name: str, pose: np.ndarray) -> bool:
        """Move a body in this hand, within a step; return whether this hand holds the body."""
        with self._lock:
            if not self._has(name):
                return False
            self._holds._poses[name] = pose
        self._holds.on_move()
        return True

    def place(self, name: str, pose: np.ndarray, now: np.ndarray) -> bool:
        """Hold a body, now at `now`, at a pose as one step; return whether this hand `may`."""
        return self.take(name, now) and self.move(name, pose)

    def undo(self) -> str | None:
        """Undo the last step; return its body, which stays held where the step began."""
        with self._lock:
            if not self._before:
                return None
            name, pose = self._before.pop()
            self.move(name, pose)
            return name

    def reset(self, name: str) -> None:
        """Put a held body back where this hand first took it; this can be undone."""
        with self._lock:
            if self._has(name):
                self._before.append((name, self._holds._poses[name]))
                self._holds._poses[name] = self._first[name]

    def release(self, name: str | None = None) -> None:
        """Release a body, or all bodies in this hand, to their own sources."""
        with self._lock:
            for each in self.own if name is None else {name} & self.own:
                del self._holds._owners[each], self._holds._poses[each]
                self._first.pop(each, None)
                self._before = [step for step in self._before if step[0] != each]

    def leave(self) -> None:
        """Release all bodies for good, because the browser is gone."""
        with self._lock:
            self._gone = True
            self.release()

    def _has(self, name: str) -> bool:
        return self._holds._owners.get(name) is self
